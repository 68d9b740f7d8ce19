"""Self-test of the filter: stop a robot that is pushed at a body, then release it."""

from collections.abc import Callable

import numpy as np

from armguard.errors import SelfTestError
from armguard.guard.approach import Approach, find_approaches
from armguard.guard.loop import Loop
from armguard.guard.self_test import SelfTestLine, see_movers, touches
from armguard.guard.walk import GRACE, PATIENCE
from armguard.respond.command import Action, Command
from armguard.robot.stopping.distance import stop_travel

Filter = Callable[..., Command]
Engage = Callable[[str], None]

# Cycles in which the motion away must have begun, beyond the time of a stop.
OUT_CYCLES = 100


def filter_line(guard: Loop, filter: Filter, engage: Engage) -> SelfTestLine:
    """Push a simulated robot at a body through the filter, then lead it away.

    It must move, never touch the body, and follow the motion away. The guard is reset
    afterwards.

    Args:
        guard: The guard.
        filter: See `Guard.filter`.
        engage: See `Guard.engage`.

    Raises:
        SelfTestError: The robot touches, never moves, or may not move away.
    """
    watch, settings = guard._watch, guard._settings
    seen, sensed = watch.seen_at.copy(), int(settings.sensed)
    settings.sensed = 0
    see_movers(watch)
    try:
        for approach in find_approaches(guard):
            return pushed(guard, filter, engage, approach)
        why = "no pair can be approached from home"
        return SelfTestLine("SKIP", f"filter: {why}")
    finally:
        guard.reset()
        watch.seen_at[:] = seen
        settings.sensed = sensed


def pushed(
    guard: Loop, filter: Filter, engage: Engage, approach: Approach
) -> SelfTestLine:
    """Push one joint at a body through the filter, and then lead it away.

    Raises:
        SelfTestError: The robot touches, never moves, or may not move away.
    """
    guard.reset()
    name, robot = guard.q_names[approach.joint], approach.robot.name
    tables = guard.tables
    stop = stop_travel(
        approach.figures, approach.place, approach.speed, tables.period, tables.late
    )
    q, v = guard.home, np.zeros(len(guard.q_names))
    q[approach.joint] = approach.start
    desired = np.zeros_like(v)
    desired[approach.joint] = approach.direction * approach.speed
    time, fastest = 0.0, 0.0
    cycles = PATIENCE * (stop.travel / approach.speed + stop.time + GRACE)
    for _ in range(int(cycles / tables.period) + OUT_CYCLES):
        command = filter(q, desired, time, velocity=v)
        if touches(command.verdict):
            raise SelfTestError(
                f"self-test: joint '{name}' was pushed through the filter until it "
                f"touched: {command.verdict.why}"
            )
        v = command.velocity
        q = q + v * tables.period
        time += tables.period
        fastest = max(fastest, abs(float(v[approach.joint])))
    if fastest == 0.0:
        raise SelfTestError(
            f"self-test: joint '{name}' was pushed through the filter, and was "
            f"commanded to stay from the beginning: {command.verdict.why}"
        )
    engage(robot)
    for k in range(int(stop.time / tables.period) + OUT_CYCLES):
        command = filter(q, -desired, time, velocity=v)
        v = command.velocity
        q = q + v * tables.period
        time += tables.period
        if command.actions[robot] is Action.FOLLOW and float(desired @ v) < 0.0:
            after = 1e3 * (k + 1) * tables.period
            return SelfTestLine(
                "PASS",
                f"filter: joint '{name}' pushed on at {approach.speed:.2f} a second: "
                f"did not touch, and was let out after {after:.0f} ms",
            )
    raise SelfTestError(
        f"self-test: joint '{name}' was to be led out through the filter, and was "
        f"commanded to stay: {command.verdict.why}"
    )
