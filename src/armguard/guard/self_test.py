"""Self-test of a guard: a simulated approach must pass through every level.

The guard receives consecutive samples of a simulated robot, as from its operator's
loop. The state of the guard is restored afterwards.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import inf, nan

from armguard.errors import HomeContactError, SelfTestError
from armguard.guard.approach import (
    Approach,
    find_approaches,
    has_stops,
)
from armguard.guard.levels import Level, Reason
from armguard.guard.loop import Loop
from armguard.guard.verdict import Verdict
from armguard.guard.walk import Walk, late_cycle
from armguard.guard.watch import SLOW_TIME_DEFAULT, Watch
from armguard.scene import Scene
from armguard.scene.posture import coinciding

# Count of approaches tried until one reaches its speed before it must stop.
TRIES = 6

# Cycles that the time in which a robot is slowed must hold for SLOW to be required [-].
CYCLES_OF_SLOW = 4.0


@dataclass(frozen=True, slots=True)
class SelfTestLine:
    """One part of the test.

    Attributes:
        status: "PASS", or "SKIP" where the scene does not permit this part.
        sentence: Observed levels, or the reason of the skip.
    """

    status: str
    sentence: str


@dataclass(frozen=True, slots=True)
class SelfTestReport:
    """Report of a self-test that passed; a failed one raises `SelfTestError`.

    Attributes:
        lines: Its parts.
    """

    lines: tuple[SelfTestLine, ...]


NOT_TESTED = SelfTestReport((SelfTestLine("SKIP", "not requested"),))


def check_home(verdict: Verdict, scene: Scene) -> None:
    """Refuse a home configuration at which checked bodies overlap.

    Args:
        verdict: Verdict of the home configuration.
        scene: The scene.

    Raises:
        HomeContactError: Some of them overlap.
    """
    contacts = tuple(p for p in verdict.near if not p.distance >= 0.0)
    if contacts:
        pairs = "; ".join(
            f"{c.a} and {c.b} by {-c.distance * 1e3:.1f} mm" for c in contacts[:8]
        )
        more = f" and {len(contacts) - 8} more" if len(contacts) > 8 else ""
        bases = "".join(
            f"bases of '{a}' and '{b}' coincide, give one a `base`; "
            for a, b in coinciding(scene, [(c.a, c.b) for c in contacts])
        )
        raise HomeContactError(
            f"{bases}at the home configuration these overlap: {pairs}{more}; give "
            "another "
            "`home`, fit the links more closely (fit_target), or allow the pair with a "
            "reason",
            contacts,
        )


def self_test(guard: Loop) -> SelfTestReport:
    """Lead a simulated robot through every level, then give wrong inputs.

    Levels must rise in order to a stop that ends before contact; standstill must be
    detected; a robot that does not decelerate must be answered by a brake, and then by
    a stop from outside; NaN, a late cycle and a stamp that goes back must stop in the
    same cycle. The state of the guard is restored.

    Args:
        guard: The guard under test.

    Raises:
        SelfTestError: A verdict is not the required one.
    """
    if not has_stops(guard.tables):
        return SelfTestReport((SelfTestLine("SKIP", "no stops are predicted"),))
    with untouched(guard):
        return SelfTestReport((*approach_lines(guard), fault_line(guard)))


@contextmanager
def untouched(guard: Loop) -> Iterator[None]:
    """Restore the state of a guard afterwards.

    Meanwhile moving objects count as always seen, cells are left out, and intents are
    not read: a test approach must not open a contract.
    """
    watch, grips, settings = guard._watch, guard._grips, guard._settings
    before = {name: array.copy() for name, array in watch._asdict().items()}
    contracts, may, intents = (
        grips.contracts.copy(),
        grips.may.copy(),
        int(settings.intents),
    )
    sensed = int(settings.sensed)
    settings.intents = settings.sensed = 0
    see_movers(watch)
    try:
        yield
    finally:
        guard.reset()
        for name, array in before.items():
            getattr(watch, name)[...] = array
        grips.contracts[:], grips.may[:] = contracts, may
        settings.intents, settings.sensed = intents, sensed


def see_movers(watch: Watch) -> None:
    """Let moving objects count as just seen, without sightings."""
    if len(watch.seen_at):
        watch.seen_at[watch.movers] = inf


def approach_lines(guard: Loop) -> Iterator[SelfTestLine]:
    """Test an approach, first with a robot that obeys, then with one that does not."""
    for k, approach in enumerate(find_approaches(guard)):
        if k == TRIES:
            break
        walk = Walk(guard, approach)
        if not walked_up_to(walk):
            continue
        yield obeyed(guard, approach, walk)
        yield ran_away(guard, approach)
        return
    why = "no pair can be approached from home with room for every level"
    yield SelfTestLine("SKIP", f"levels: {why}")
    yield SelfTestLine("SKIP", f"supervision: {why}")


def walked_up_to(walk: Walk) -> bool:
    """Move forward until a stop is ordered.

    Returns:
        Whether the approach is valid: below SLOW at its start, at speed before its end.

    Raises:
        SelfTestError: No stop was ordered before contact.
    """
    for verdict in walk.forward():
        if walk.level >= Level.STOP:
            return walk.is_up_to_speed and walk.levels[0] < Level.SLOW
        if touches(verdict):
            raise SelfTestError(
                f"self-test: {walk.words} met something without a stop: {verdict.why}"
            )
    raise SelfTestError(f"self-test: {walk.words} came too near, and no stop was given")


def obeyed(guard: Loop, approach: Approach, walk: Walk) -> SelfTestLine:
    """Test a robot that stops as declared.

    Raises:
        SelfTestError: A level was left out, or the stop ended in contact, was called
            lagging, or was not recognised as standstill.
    """
    levels = list(walk.levels)
    slows = guard.tables.period * CYCLES_OF_SLOW < SLOW_TIME_DEFAULT
    if slows and Level.SLOW not in levels:
        raise SelfTestError(
            f"self-test: {walk.words} went through {named(levels)}; it must be slowed "
            "before it is stopped"
        )
    verdict = None
    for verdict in walk.stop():
        if touches(verdict):
            raise SelfTestError(
                f"self-test: {walk.words} was stopped too late: {verdict.why}"
            )
        if walk.level >= Level.BRAKE:
            raise SelfTestError(
                f"self-test: {walk.words} stopped as declared, and was answered by "
                f"{walk.level.name}: {verdict.why}"
            )
        if walk.level is not Level.STOP:
            break
    if verdict is None or walk.level is Level.STOP:
        raise SelfTestError(f"self-test: {walk.words} rests, and that was not noticed")
    return SelfTestLine("PASS", f"levels: {walk.words}: {named(walk.levels)}")


def ran_away(guard: Loop, approach: Approach) -> SelfTestLine:
    """Test a robot that ignores an ordered stop.

    Raises:
        SelfTestError: The guard did not order BRAKE and HARDWARE_STOP.
    """
    if not approach.shows_lag:
        return SelfTestLine(
            "SKIP", "supervision: the robot may settle as fast as it can be led"
        )
    walk = Walk(guard, approach)
    for _ in walk.run_away():
        if walk.level >= Level.HARDWARE_STOP:
            break
    if Level.BRAKE not in walk.levels or Level.HARDWARE_STOP not in walk.levels:
        raise SelfTestError(
            f"self-test: {walk.words} did not slow down after a stop, and was answered "
            f"by {named(walk.levels)}; BRAKE and HARDWARE_STOP must follow"
        )
    return SelfTestLine(
        "PASS", f"supervision: {walk.words}, going on: {named(walk.levels)}"
    )


def fault_line(guard: Loop) -> SelfTestLine:
    """Test wrong inputs, each after two valid cycles.

    Raises:
        SelfTestError: An input did not lead to a stop in the same cycle, with its
            reason.
    """
    tables, home = guard.tables, guard.home
    broken = home.copy()
    broken[0] = nan
    late = late_cycle(tables)
    faults = (
        ("a NaN", broken, 2.0 * tables.period, Reason.NOT_FINITE),
        ("a late cycle", home, tables.period + late, Reason.CYCLE_LATE),
        ("a stamp that goes back", home, 0.0, Reason.TIME_BACKWARDS),
    )
    still = home * 0.0
    for name, q, stamp, reason in faults:
        guard.reset()
        for k in range(2):
            guard.step(home, k * tables.period, velocity=still)
        verdict = guard.step(q, stamp, velocity=still)
        if verdict.level < Level.STOP or verdict.reason is not reason:
            raise SelfTestError(
                f"self-test: {name} was answered by {verdict.level.name}, "
                f"{verdict.reason.name}; it must be a stop for {reason.name}"
            )
    return SelfTestLine("PASS", f"faults: {', '.join(f[0] for f in faults)}: STOP")


def touches(verdict: Verdict) -> bool:
    """Whether the nearest pair touches or overlaps."""
    nearest = verdict.nearest
    return nearest is not None and not nearest.distance > 0.0


def named(levels: list[Level]) -> str:
    """Names of levels, joined."""
    return ", ".join(level.name for level in levels)
