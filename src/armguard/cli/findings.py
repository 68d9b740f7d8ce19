"""The lines of `armguard check`: what was examined, PASS, WARN or FAIL, the remedy."""

from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from platform import machine, python_version

from armguard.cli.console import say
from armguard.cli.cycles import cycle_findings
from armguard.cli.finding import Finding
from armguard.cli.home import (
    close_findings,
    contact_findings,
    roomier,
    settle_pairs,
)
from armguard.cli.stopping import lacking_figures_finding
from armguard.errors import ArmguardError, HomeContactError, SelfTestError
from armguard.guard import Level, self_test
from armguard.guard.approach import has_stops
from armguard.respond import Guard
from armguard.respond.self_test import filter_line
from armguard.robot.model import FittedLink, RobotModel
from armguard.scene.allowed import allowed_pairs
from armguard.scene.scene import Scene, SceneRobot
from armguard.scene.yaml_source import Problem, SceneFileError


def versions() -> Finding:
    """Versions of the guard and of what it runs on."""
    parts = [f"{name} {version(name)}" for name in ("armguard", "numba", "numpy")]
    where = f"Python {python_version()} on {machine()}"
    return Finding("versions", "PASS", ", ".join([*parts, where]))


def file_findings(error: ArmguardError, file: Path) -> list[Finding]:
    """Each problem of a scene file that cannot be loaded."""
    if not file.exists():
        remedy = "give the path of a scene, or write one: `armguard init ROBOT ROBOT`"
        return [Finding("scene", "FAIL", str(error), remedy)]
    if not isinstance(error, SceneFileError):
        return [Finding("scene", "FAIL", str(error), f"change {file.name}")]
    return [found for problem in error.problems for found in problem_findings(problem)]


def problem_findings(problem: Problem) -> list[Finding]:
    """A problem of a scene file; one finding a robot if each lacks a line."""
    if problem.robots:
        return [
            lacking_figures_finding(("robots", name), problem.paste)
            for name in problem.robots
        ]
    remedy = f"fix {problem.file}, or give the path of another scene file"
    if problem.line:
        remedy = f"fix line {problem.line} of {problem.file}"
    return [Finding("scene", "FAIL", str(problem), remedy)]


def exact_overreach(fit: FittedLink) -> float:
    """How far the exact shapes of a link reach beyond its geometry [m]."""
    return max((placed.model_error for placed in fit.exact), default=0.0)


def scene_findings(scene: Scene, file: str, proves: bool) -> Iterator[Finding]:
    """The scene's joints, meshes, exact shapes, notes and allowed pairs.

    Args:
        scene: The scene.
        file: Name of its file.
        proves: Whether claims about pairs are proven as well.
    """
    for robot in scene.robots.values():
        yield from robot_findings(robot)
    if not any(robot.model.notes for robot in scene.robots.values()):
        yield Finding("notes", "PASS", "every visible link has collision geometry")
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
            f"{srdf + own} claims are unproven and accepted as they are; prove them "
            f"with `armguard check {file} --prove`"
        )
        yield Finding("allowed pairs", "WARN", sentence, remedy)


def robot_findings(robot: SceneRobot) -> Iterator[Finding]:
    """The joints and meshes of a robot, and the second, exact stage of its links."""
    names = robot.model.q_names
    yield Finding(
        "joints",
        "PASS",
        f"{len(names)} positions [rad, m] in this order: {', '.join(names)}",
        keys=("robots", robot.name),
    )
    meshes = sum(
        hasattr(element.geometry, "path")
        for link in robot.model.links.values()
        for element in link.collisions
    )
    found = f"{meshes} mesh files, all found"
    yield Finding("meshes", "PASS", found, keys=("robots", robot.name))
    both = [fit for fit in robot.fits.values() if fit.exact]
    contained = sum(fit.contained for fit in both)
    better = sum(exact_overreach(fit) < fit.overreach for fit in both)
    stage = (
        f"second stage: {len(both)} of {len(robot.fits)} links use mesh hulls and true "
        f"cylinders ({better} closer than the primitives, {contained} proven inside "
        "them)"
        if both
        else "its primitives are exact"
    )
    yield Finding("exact shapes", "PASS", stage, keys=("robots", robot.name))
    for note in robot.model.notes:
        yield Finding(
            "notes",
            "WARN",
            note,
            note_remedy(robot.model, note),
            ("robots", robot.name),
        )


def note_remedy(model: RobotModel, note: str) -> str:
    """File and line that a note about a robot is about."""
    file = model.path.name if model.path else f"the model '{model.name}'"
    for link in model.links.values():
        if link.has_visual and not link.collisions and f"'{link.name}'" in note:
            if model.expanded is None:
                return f"add a <collision> to line {link.line} of {file}"
    return f"change {file} or its SRDF; see docs/robots.md"


def guard_findings(scene: Scene, file: str) -> Iterator[Finding]:
    """Results of the guard: overlap and closeness at home, index, cycle time."""
    try:
        guard = Guard(scene, progress=say, self_test=False)
        home = guard.home_verdict
        error = None
    except HomeContactError as found:
        error = found
    except ArmguardError as found:
        yield Finding("guard", "FAIL", str(found), f"change {file}")
        return
    if error is not None or home.level is Level.STOP:
        settled = list(settle_pairs(scene))
        if settled:
            yield from settled
            yield from guard_findings(scene, file)
            return
    if error is not None:
        yield from contact_findings(scene, error)
        return
    if home.level is Level.STOP:
        yield from close_findings(scene, home)
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
        yield from self_test_findings(guard, scene)
    yield from cycle_findings(guard, scene)


def self_test_findings(guard: Guard, scene: Scene) -> Iterator[Finding]:
    """Results of the guard's self-test."""
    try:
        lines = self_test(guard).lines
        if all(part.mode != "fixed" for part in guard.tables.robots):
            lines = (*lines, filter_line(guard, guard.filter, guard.engage))
    except SelfTestError as error:
        yield from roomier(scene, str(error), "FAIL")
        return
    skipped = []
    for line in lines:
        if line.status == "PASS":
            yield Finding("self-test", "PASS", line.sentence)
        else:
            skipped.append(line.sentence)
    if skipped:
        yield from roomier(scene, "; ".join(skipped), "WARN")
