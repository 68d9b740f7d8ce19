"""Faults of time and of measurements: which are noticed, and after how many cycles?"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from armguard.cli.console import say
from armguard.guard import Level, Reason
from armguard.respond import Guard
from arrays import Floats
from closed_loop.plant import stopping_travel
from closed_loop.scenes import build_scene
from closed_loop.settings import Setting
from motions.slower import LEFT

SETTING = Setting("bay", "path", "even", 0.001, 0.0005, 0.005)

# When a fault begins, and for how many cycles it is waited to be noticed [cycles].
BEGIN = 400
PATIENCE = 1000

# How fast the first joint goes, to and fro [rad/s], and how often [1/s].
SPEED = 0.1
PACE = 0.5

# Speeds a stop begins with [rad/s], and delays beyond the declared one [s].
SPEEDS = (0.05, 0.1, 0.2, 0.4, 0.8)
DELAYS = (0.002, 0.005, 0.010, 0.020)

# Cycle that comes late, so that a stop is ordered while a joint goes evenly; how fast
# the joint got its speed before [rad/s²].
CALM = 400
RISE = 3.0


@dataclass(frozen=True)
class Input:
    """What a guard is given in a cycle.

    Attributes:
        q: Joint positions, shape (n,) [rad].
        v: Velocities, shape (n,) [rad/s].
        left: Stamp of the left robot [s].
        right: Stamp of the right one [s].
        now: Time of the cycle [s].
    """

    q: Floats
    v: Floats
    left: float
    right: float
    now: float


# What becomes of an input; k counts cycles since the fault began.
Change = Callable[[Input, int, Guard], Input]


@dataclass(frozen=True)
class Fault:
    """Something that goes wrong.

    Attributes:
        name: In words.
        change: What it makes of an input.
        breaks: First cycle whose input breaks a declared figure, counted since it
            began; None if none does.
        says_now: Whether the guard gets the time of the cycle.
    """

    name: str
    change: Change
    breaks: int | None = 0
    says_now: bool = True


def aged(age: float, fresh: bool = False) -> Change:
    """Measurements of the left robot stand still until they are so much older.

    Args:
        age: How much [s].
        fresh: Whether only their stamps are; the clock of the robot is wrong.
    """

    def change(i: Input, k: int, guard: Guard) -> Input:
        left = max(i.left - age, stamp_at(BEGIN))
        return replace(i, left=left) if fresh else measured_at(left, i, guard)

    return change


def later(extra: float) -> Change:
    """One cycle comes later than period and lateness, and all after it."""
    wait = extra + SETTING.late

    def change(i: Input, k: int, guard: Guard) -> Input:
        left, right, now = (x + wait for x in (i.left, i.right, i.now))
        return measured_at(left, replace(i, right=right, now=now), guard)

    return change


def moved_stamp(by: float, each: float = 0.0) -> Change:
    """The stamp of the left robot is off, and each cycle by so much more [s]."""
    return lambda i, k, guard: replace(i, left=i.left + by + k * each)


def old(i: Input, k: int, guard: Guard) -> Input:
    """All measurements get 50 ms old, and are stamped as new."""
    lag = min(1e-4 * k, 0.05)
    return replace(measured_at(i.left - lag, i, guard), left=i.left)


def still(i: Input, k: int, guard: Guard) -> Input:
    """No new measurements of either robot."""
    return replace(measured_at(stamp_at(BEGIN), i, guard), right=stamp_at(BEGIN))


def stuck(i: Input, k: int, guard: Guard) -> Input:
    """Positions stay where they were; stamps and velocities go on."""
    return replace(i, q=positions(stamp_at(BEGIN), guard))


def half(i: Input, k: int, guard: Guard) -> Input:
    """Measured velocities are half of the true ones."""
    return replace(i, v=0.5 * i.v)


def jumped(i: Input, k: int, guard: Guard) -> Input:
    """Positions are off by 20 mrad from now on."""
    return replace(i, q=i.q + 0.02)


# Measurements are 1 ms old, may be 2 ms (`sensing`), and are refused from 20 ms on.
FAULTS = (
    Fault("a cycle 0.1 ms later than `period + late`", later(1e-4)),
    Fault("a cycle 0.1 ms before that", later(-1e-4), breaks=None),
    Fault("a measurement gets 0.1 ms older than `stale`", aged(0.0191), breaks=20),
    Fault("no new measurement of one robot any more", aged(1e3), breaks=20),
    Fault("a measurement gets older than `sensing`, not than `stale`", aged(0.015), 2),
    Fault("a stamp 1.1 ms back", moved_stamp(-0.0021)),
    Fault("one robot's clock jumps 1.1 ms ahead", moved_stamp(0.0011)),
    Fault("one robot's clock falls 5 ms behind", aged(0.005, fresh=True), 2),
    Fault("one robot's clock falls behind by 10 %", moved_stamp(0.0, -1e-4), 191),
    Fault("without `now`: no new measurements at all", still, 1, says_now=False),
    Fault("without `now`: one robot's are no longer new", aged(1e3), 21, False),
    Fault("all get 50 ms old, stamped as new", old, 11),
    Fault("positions stand still, stamps and velocities go on", stuck),
    Fault("measured velocities are half of the true ones", half),
    Fault("positions jump by 20 mrad", jumped),
)


def stamp_at(cycle: int) -> float:
    """Stamp of both robots where nothing is wrong [s]."""
    return cycle * SETTING.period - 0.001


def measured_at(left: float, i: Input, guard: Guard) -> Input:
    """What the left robot measured at another time."""
    return replace(i, q=positions(left, guard), v=velocities(left, guard), left=left)


def positions(t: float, guard: Guard) -> Floats:
    """Where the joints are, shape (n,) [rad]; they rest until 0 s."""
    q, turn = guard.home, 2.0 * np.pi * PACE
    q[0] += SPEED / turn * (1.0 - np.cos(turn * max(t, 0.0)))
    return q


def velocities(t: float, guard: Guard) -> Floats:
    """How fast they are, shape (n,) [rad/s]."""
    v = np.zeros(len(guard.home))
    v[0] = SPEED * np.sin(2.0 * np.pi * PACE * max(t, 0.0))
    return v


def input_at(cycle: int, guard: Guard) -> Input:
    """A right input."""
    stamp = stamp_at(cycle)
    return Input(
        positions(stamp, guard),
        velocities(stamp, guard),
        stamp,
        stamp,
        cycle * SETTING.period,
    )


def noticed(guard: Guard, fault: Fault) -> tuple[int | None, str]:
    """Cycles since a fault began until it is answered, None if it is not, and how."""
    guard.reset()
    for cycle in range(BEGIN + PATIENCE):
        given = input_at(cycle, guard)
        since = cycle - BEGIN
        if since >= 0:
            given = fault.change(given, since, guard)
        verdict = guard.step(
            given.q,
            {"left": given.left, "right": given.right},
            velocity=given.v,
            now=given.now if fault.says_now else None,
        )
        if verdict.level >= Level.STOP:
            assert since >= 0, f"stopped before the fault: {verdict.why}"
            return since, verdict.reason.name
    return None, ""


def clock_figures() -> dict[str, Any]:
    """Faults of time and measurements, and delays of orders."""
    guard = Guard(build_scene(SETTING), self_test=False)
    say(f"{len(FAULTS)} faults")
    faults = []
    for fault in FAULTS:
        cycles, reason = noticed(guard, fault)
        faults.append(
            {
                "fault": fault.name,
                "broken": fault.breaks is not None,
                "cycles": None if cycles is None else cycles - (fault.breaks or 0),
                "reason": reason,
            }
        )
    say("stops that are late or slow")
    cases = [(0.0, 1.0), *((delay, 1.0) for delay in DELAYS), (0.0, LEFT)]
    lags = [
        {
            "speed": speed,
            "delay_ms": 1e3 * delay,
            "left": left,
            "ms": escalated(guard, speed, delay, left),
        }
        for delay, left in cases
        for speed in SPEEDS
    ]
    return {"period_ms": 1e3 * SETTING.period, "faults": faults, "lags": lags}


def escalated(guard: Guard, speed: float, delay: float, left: float) -> float | None:
    """Time from the order of a stop until the brake is ordered; None if never [ms].

    One joint goes at a speed and is stopped for a late cycle; measurements are exact.

    Args:
        guard: The guard.
        speed: Its speed [rad/s].
        delay: How much later than declared the drives obey [s].
        left: Share of the declared deceleration [-].
    """
    figures = guard.tables.robots[0].stopping
    assert figures is not None
    guard.reset()
    period, late = SETTING.period, SETTING.late
    ordered = effect = np.inf
    now = 0.0
    for cycle in range(PATIENCE):
        now += period + (2.0 * late if cycle == CALM else 0.0)
        q, v = guard.home, np.zeros(len(guard.home))
        # From standstill at 3 rad/s², then even.
        q[0], v[0] = driven(now, speed)
        if now > effect:
            begin = driven(effect, speed)[0]
            gone, slowed = stopping_travel(
                now - effect,
                speed,
                left * float(figures.deceleration[0]),
                figures.ramp,
            )
            q[0], v[0] = begin + gone, slowed
        verdict = guard.step(q, now, velocity=v, now=now)
        level = verdict.levels["left"]
        if level >= Level.BRAKE:
            return 1e3 * (now - ordered)
        if level >= Level.STOP and ordered == np.inf:
            assert verdict.reason is Reason.CYCLE_LATE, verdict.why
            ordered, effect = now, now + figures.command + delay
    return None


def driven(t: float, speed: float) -> tuple[float, float]:
    """Position off home [rad] and speed [rad/s] of a joint that starts from rest."""
    begin = CALM * SETTING.period - speed / RISE - 0.05
    on = max(t - begin, 0.0)
    rise = min(on, speed / RISE)
    return 0.5 * RISE * rise * rise + speed * (on - rise), RISE * rise
