"""The lines of `armguard check`: what was examined, PASS, WARN or FAIL, the remedy."""

from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import version
from platform import machine, python_version
from typing import Literal

import numpy as np

from armguard.cli.console import say
from armguard.errors import ArmguardError, HomeContactError, SelfTestError
from armguard.guard import Level, self_test
from armguard.guard.approach import has_stops
from armguard.respond import Guard
from armguard.robot.model import FittedLink
from armguard.scene.allowed import allowed_pairs
from armguard.scene.scene import Scene, SceneRobot

# Cycles the cycle time is measured over, and the step of each joint between them.
CYCLES = 2000
JITTER = 1e-4

# A cycle that takes longer than this does not fit a 1 kHz loop [s].
PERIOD = 1e-3

Status = Literal["PASS", "WARN", "FAIL"]


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the check.

    Attributes:
        topic: What was examined.
        status: PASS, WARN or FAIL.
        sentence: What was found.
        remedy: What to do about it, "" if nothing.
    """

    topic: str
    status: Status
    sentence: str
    remedy: str = ""


def versions() -> Finding:
    """Versions of the guard and of what it runs on."""
    parts = [f"{name} {version(name)}" for name in ("armguard", "numba", "numpy")]
    where = f"Python {python_version()} on {machine()}"
    return Finding("versions", "PASS", ", ".join([*parts, where]))


def exact_overreach(fit: FittedLink) -> float:
    """How far the exact shapes of a link reach beyond its geometry [m]."""
    return max((placed.model_error for placed in fit.exact), default=0.0)


def scene_findings(scene: Scene, proves: bool) -> Iterator[Finding]:
    """The scene's joints, meshes, exact shapes, notes, fits and allowed pairs.

    Args:
        scene: The scene.
        proves: Whether claims about pairs are proven as well.
    """
    for robot in scene.robots.values():
        yield from robot_findings(robot)
    for note in scene.notes:
        yield Finding("notes", "WARN", note, "see docs/robots.md")
    if not scene.notes:
        yield Finding("notes", "PASS", "every visible link has collision geometry")
    wide = [
        Finding(
            "fit",
            "WARN",
            f"{name}/{link} overreaches by {fit.overreach * 1e3:.1f} mm, "
            f"target {robot.fit_target * 1e3:.1f} mm",
            "raise max_primitives, or live with an earlier stop there",
        )
        for name, robot in scene.robots.items()
        for link, fit in robot.fits.items()
        if round(fit.overreach * 1e3, 1) > round(robot.fit_target * 1e3, 1)
    ]
    yield from wide or [Finding("fit", "PASS", "every link is within its fit target")]
    sources = [rule.source for rule in allowed_pairs(scene)]
    rigid, adjacent, srdf, own = map(
        sources.count, ("rigid", "adjacent", "srdf", "scene")
    )
    sentence = (
        f"{rigid} rigid, {adjacent} adjacent, {srdf} claimed by SRDF, {own} allowed by "
        "the scene"
    )
    if proves or not srdf + own:
        yield Finding("allowed pairs", "PASS", sentence)
    else:
        remedy = (
            f"{srdf + own} claims are unproven, taken as claims; prove them with "
            "--prove"
        )
        yield Finding("allowed pairs", "WARN", sentence, remedy)


def robot_findings(robot: SceneRobot) -> Iterator[Finding]:
    """The joints and meshes of a robot, and the second, exact stage of its links."""
    who, names = f"robot '{robot.name}'", robot.model.q_names
    yield Finding(
        "joints",
        "PASS",
        f"{who} takes {len(names)} positions [rad, m] in this order: "
        + ", ".join(names),
    )
    meshes = sum(
        hasattr(element.geometry, "path")
        for link in robot.model.links.values()
        for element in link.collisions
    )
    yield Finding("meshes", "PASS", f"{who}: {meshes} mesh files, all found")
    both = [fit for fit in robot.fits.values() if fit.exact]
    contained = sum(fit.contained for fit in both)
    better = sum(exact_overreach(fit) < fit.overreach for fit in both)
    stage = (
        f"{len(both)} links are measured again by hulls and true cylinders before they "
        f"stop the arm; {contained} of these are proven to lie in the link's "
        f"primitives, {better} reach less far beyond the mesh than the primitives do"
        if both
        else "its primitives are exact"
    )
    yield Finding("exact shapes", "PASS", f"{who}: {stage}")


def guard_findings(scene: Scene) -> Iterator[Finding]:
    """What the guard says: overlap and closeness at home, index, cycle time."""
    try:
        guard = Guard(scene, progress=say, self_test=False)
    except HomeContactError as error:
        yield Finding("home", "FAIL", str(error), "see docs/concepts.md, home")
        return
    except ArmguardError as error:
        yield Finding("guard", "FAIL", str(error), "fix the scene")
        return
    home = guard.home_verdict
    if home.level is Level.STOP:
        remedy = "give another home, or a smaller buffer to this pair"
        yield Finding("home", "FAIL", home.why, remedy)
    else:
        yield Finding("home", "PASS", home.why)
    guard.index.check()
    tables = guard.tables
    yield Finding(
        "index",
        "PASS",
        f"{len(tables.kinds)} primitives, {tables.moving_count} moving, "
        f"{tables.checkable_pairs} pairs to check; the index passes its audit",
    )
    # Without predicted stops there is nothing to test.
    if has_stops(tables):
        yield from self_test_findings(guard)
    yield cycle_time(guard)


def self_test_findings(guard: Guard) -> Iterator[Finding]:
    """Results of the guard's self-test."""
    try:
        report = self_test(guard)
    except SelfTestError as error:
        yield Finding("self-test", "FAIL", str(error), "do not arm this guard")
        return
    skipped = "give a home with room around it, and it will be tried"
    for line in report.lines:
        if line.status == "PASS":
            yield Finding("self-test", "PASS", line.sentence)
        else:
            yield Finding("self-test", "WARN", line.sentence, skipped)


def cycle_time(guard: Guard) -> Finding:
    """How long a cycle takes on this machine, all joints moving."""
    rng = np.random.default_rng(0)
    q = guard.home + rng.uniform(-JITTER, JITTER, size=(CYCLES, len(guard.home)))
    q = np.clip(q, guard.tables.lower, guard.tables.upper)
    period, still = guard.tables.period, np.zeros_like(guard.home)
    times = [
        guard.step(row, k * period, velocity=still).cycle_time
        for k, row in enumerate(q)
    ]
    median, p99 = np.percentile(times, [50, 99]) * 1e6
    sentence = f"median {median:.1f} µs, p99 {p99:.1f} µs around home"
    if p99 < PERIOD * 1e6:
        return Finding("cycle time", "PASS", sentence)
    remedy = "too long for 1 kHz: fewer primitives, a quieter machine"
    return Finding("cycle time", "WARN", sentence, remedy)
