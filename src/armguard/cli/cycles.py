"""Cycles in `armguard check`: their time, and whether the arms may rest at home."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armguard.cli.finding import Finding, in_yaml
from armguard.cli.plausibility import same
from armguard.guard import Level
from armguard.guard.verdict import Verdict
from armguard.respond import Guard
from armguard.robot.stopping import StoppingFigures
from armguard.scene.scene import Scene

Floats = NDArray[np.float64]

# Cycles the cycle time is measured over, and the step of each joint between them.
CYCLES = 2000
JITTER = 1e-4

# The measurement ends when its cycles took this long together [s].
LONGEST_TIMING = 3.0

# Cycles after which a guard has judged arms that rest.
SETTLED = 3

# Shares of the declared top speeds that are tried in turn.
SHARES = (0.7, 0.5, 0.35, 0.25, 0.18, 0.12)


def cycle_findings(guard: Guard, scene: Scene) -> Iterator[Finding]:
    """Whether `Guard.step` lets the arms rest at home, and how long a cycle takes."""
    verdict = at_rest(guard)
    if verdict.level < Level.STOP:
        yield timing(guard, lambda q, stamp: step(guard, q, stamp))
        return
    yield from resting(scene, verdict)
    # A step that finds no proof takes longest: the time of the other call counts.
    other = Guard(scene, self_test=False)
    yield timing(other, lambda q, stamp: hold(other, q, stamp), " of Guard.filter")


def at_rest(guard: Guard) -> Verdict:
    """The first stop of arms that rest at home; else the last verdict."""
    verdict = guard.home_verdict
    for k in range(SETTLED):
        verdict = step(guard, guard.home, k * guard.tables.period)
        if verdict.level >= Level.STOP:
            break
    return verdict


def step(guard: Guard, q: Floats, stamp: float) -> Verdict:
    """The verdict of a cycle of arms that rest."""
    return guard.step(q, stamp, velocity=np.zeros_like(q))


def hold(guard: Guard, q: Floats, stamp: float) -> Verdict:
    """The verdict of a cycle of arms that rest, and are to go on resting."""
    still = np.zeros_like(q)
    return guard.filter(q, still, stamp, velocity=still).verdict


def resting(scene: Scene, verdict: Verdict) -> Iterator[Finding]:
    """Arms that a guard stops at home, as nothing limits their next commands."""
    sentence = (
        "at home, at rest, Guard.step orders a stop: it allows for any command that "
        f"may follow, and headroom is {-verdict.headroom.m * 1e3:.0f} mm short of that"
    )
    remedy = "call Guard.filter, which limits the commands"
    found = slower(scene)
    if not found:
        yield Finding("rest", "WARN", sentence, f"{remedy}, or move the bases apart")
    remedy += ", or declare what the drives are limited to"
    for name, limits in found.items():
        paste = f"stopping: {in_yaml(limits)}"
        yield Finding("rest", "WARN", sentence, remedy, ("robots", name), paste)


def slower(scene: Scene) -> dict[str, dict[str, object]]:
    """Speeds and accelerations with which arms may rest at home, by robot.

    They are the greatest of those tried; none if the least are too great. The
    acceleration falls with the square of the speed: a joint reaches its top speed on
    the same way.

    Args:
        scene: The scene; unchanged afterwards.
    """
    declared = {
        name: robot.stopping
        for name, robot in scene.robots.items()
        if robot.stopping is not None
    }
    try:
        for share in SHARES:
            tried = {name: scaled(one, share) for name, one in declared.items()}
            for name, figures in tried.items():
                scene.set_stopping(name, figures)
            if at_rest(Guard(scene, self_test=False)).level < Level.STOP:
                return {name: limits_of(figures) for name, figures in tried.items()}
    finally:
        for name, figures in declared.items():
            scene.set_stopping(name, figures)
    return {}


def scaled(figures: StoppingFigures, share: float) -> StoppingFigures:
    """Figures at a share of the top speeds, in two digits."""
    return replace(
        figures,
        velocity=two_digits(share * figures.velocity),
        acceleration=two_digits(share**2 * figures.acceleration),
    )


def two_digits(values: Floats) -> Floats:
    """Values rounded to two digits."""
    return np.array([float(f"{value:.2g}") for value in values])


def limits_of(figures: StoppingFigures) -> dict[str, object]:
    """Top speed and acceleration as a scene file has them."""
    return {
        key: same(
            dict(zip(figures.joints, getattr(figures, key).tolist(), strict=True))
        )
        for key in ("velocity", "acceleration")
    }


def timing(
    guard: Guard, cycle: Callable[[Floats, float], Verdict], call: str = ""
) -> Finding:
    """How long a cycle takes on this machine, all joints moving."""
    period = guard.tables.period
    median, p99 = np.percentile(cycle_times(guard, cycle), [50, 99]) * 1e6
    sentence = f"median {median:.1f} µs, p99 {p99:.1f} µs around home{call}"
    if p99 < period * 1e6:
        return Finding("cycle time", "PASS", sentence)
    return Finding(
        "cycle time",
        "WARN",
        f"{sentence}; the period is {period * 1e6:g} µs",
        "use fewer primitives or a quieter machine, or call the guard less often",
        paste=f"cycle: {{period: {2e-6 * p99:.1g}}}",
    )


def cycle_times(guard: Guard, cycle: Callable[[Floats, float], Verdict]) -> list[float]:
    """Times of cycles around home, all joints moving [s]."""
    rng = np.random.default_rng(0)
    q = guard.home + rng.uniform(-JITTER, JITTER, size=(CYCLES, len(guard.home)))
    q = np.clip(q, guard.tables.lower, guard.tables.upper)
    period = guard.tables.period
    times: list[float] = []
    for k, row in enumerate(q, SETTLED):
        times.append(cycle(row, k * period).cycle_time)
        if sum(times) > LONGEST_TIMING:
            break
    return times
