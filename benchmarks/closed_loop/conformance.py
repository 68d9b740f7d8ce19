"""Whether a plant conformed to its declared figures, from its true motion alone.

Sensors use only a part of the declared errors. The rest is the arm's: it may move as if
its state at any instant had been wrong by that much, which is all the proof assumes.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from armguard.robot.stopping import StoppingFigures
from arrays import Bools, Floats, Ints
from closed_loop.settings import SUBSTEP
from closed_loop.truth import Truth, joined

# Figures are kept to rounding errors [rad, rad/s].
GRAIN = 1e-9

# Farthest instants that are compared with what was commanded [s].
HORIZON = 0.01


# Figures of `StoppingFigures` that have other names here.
NAMES = {
    "most": "deceleration_most",
    "back": "settle",
    "brake": "brake_deceleration",
    "tracking": "tracking_error",
}


class Declared(NamedTuple):
    """Figures of all joints, each shape (n,).

    Attributes:
        velocity: Top speed [rad/s].
        acceleration: Greatest acceleration until a stop takes effect [rad/s²].
        deceleration: Least deceleration of a stop [rad/s²].
        most: Its greatest [rad/s²].
        ramp: Time in which it rises [s].
        settle: Swing beyond the rest after a stop from top speed [rad].
        back: Swing before it [rad].
        settle_time: Longest time of a swing [s].
        brake: Least deceleration of the brake [rad/s²].
        tracking: How far velocities may miss commands [rad/s].
        position: Part of the position error that sensors leave to the arm [rad].
        speed: The same of the velocity error [rad/s].
    """

    velocity: Floats
    acceleration: Floats
    deceleration: Floats
    most: Floats
    ramp: Floats
    settle: Floats
    back: Floats
    settle_time: Floats
    brake: Floats
    tracking: Floats
    position: Floats
    speed: Floats

    def of(self, joints: slice) -> "Declared":
        """The figures of some joints."""
        return Declared(*(figure[joints] for figure in self))


def declared_of(figures: Sequence[StoppingFigures], truth: Truth) -> Declared:
    """What is declared of all joints of some arms.

    Args:
        figures: Declared figures of each arm.
        truth: True figures of the episode; what its sensors leave of the declared
            errors is the arm's.
    """
    names = Declared._fields[:10]
    known = {name: joined(figures, NAMES.get(name, name)) for name in names}
    known["back"] *= truth.swings_back
    return Declared(
        **known,
        position=joined(figures, "position_error") - truth.position_error + GRAIN,
        speed=joined(figures, "velocity_error") - truth.velocity_error + GRAIN,
    )


class Stopping(NamedTuple):
    """A stop or brake of an arm.

    Attributes:
        arm: The arm.
        at: Time at which it took effect [s].
        brake: Whether it was the brake.
    """

    arm: int
    at: float
    brake: bool


class Commanded(NamedTuple):
    """Velocities sent to an arm.

    Attributes:
        at: When they were sent [s].
        arm: The arm.
        velocity: Velocities of its joints, shape (k,) [rad/s].
    """

    at: float
    arm: int
    velocity: Floats


def broken(
    q: Floats,
    v: Floats,
    free: Bools,
    first: Ints,
    stops: Sequence[Stopping],
    declared: Declared,
) -> str | None:
    """The figure a plant broke first in this order, None if it kept all.

    Args:
        q: True positions at every substep, shape (t, n) [rad].
        v: True velocities, shape (t, n) [rad/s].
        free: Whether each arm was its operator's after each substep, shape (t, a).
        first: First joint of each arm, and n, shape (a + 1,).
        stops: Every stop and brake that took effect, in the order of time.
        declared: What was declared.
    """
    if (np.abs(v) > declared.velocity + GRAIN).any():
        return "velocity"
    for arm in range(free.shape[1]):
        own = slice(int(first[arm]), int(first[arm + 1]))
        figures = declared.of(own)
        for period in runs(free[:, arm]):
            # A stop may take effect within the last substep.
            gain = gained(v[period, own], figures.acceleration)
            if (gain > figures.speed).any():
                return "acceleration"
        ordered = [stop for stop in stops if stop.arm == arm]
        ends = [*(stop.at for stop in ordered[1:]), np.inf]
        for stop, end in zip(ordered, ends, strict=False):
            rows = stopped_rows(free[:, arm], stop.at, end)
            found = leaves(q[:, own], v[:, own], rows, stop, figures)
            if found is not None:
                return f"{'brake' if stop.brake else 'stop'}, {found}"
    return None


def runs(free: Bools) -> Iterator[slice]:
    """Rows of each period in which an arm was its operator's."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], free, [False]])))
    for begin, end in edges.reshape(-1, 2):
        yield slice(int(begin), int(end))


def gained(v: Floats, acceleration: Floats) -> Floats:
    """Most speed a joint gained beyond its acceleration, from any row to a later one.

    Args:
        v: Velocities, shape (t, n) [rad/s].
        acceleration: Shape (n,) [rad/s²].
    """
    allowed = acceleration * (np.arange(len(v)) * SUBSTEP)[:, None]
    beyond = np.zeros(v.shape[1])
    for sign in (1.0, -1.0):
        left = sign * v - allowed
        gain = left - np.minimum.accumulate(left, axis=0)
        beyond = np.maximum(beyond, gain.max(axis=0))
    return beyond


def stopped_rows(free: Bools, begin: float, end: float) -> slice:
    """Rows after the effect of a stop until the arm is given back, or another stop."""
    start = int(np.ceil(begin / SUBSTEP - 1e-9))
    given = np.flatnonzero(free[start + 1 :])
    last = start + 1 + int(given[0]) if len(given) else len(free)
    if np.isfinite(end):
        last = min(last, int(np.ceil(end / SUBSTEP - 1e-9)))
    return slice(start, last)


def leaves(
    q: Floats, v: Floats, rows: slice, stop: Stopping, figures: Declared
) -> str | None:
    """How the joints of an arm that stops leave what is declared, None if none does.

    Args:
        q: Positions of its joints at every substep, shape (t, k) [rad].
        v: Velocities, shape (t, k) [rad/s].
        rows: Rows of the stop.
        stop: The stop.
        figures: Of these joints.
    """
    k = max(rows.start - 1, 0)
    late = stop.at - k * SUBSTEP
    speed = v[k] + (v[k + 1] - v[k]) * late / SUBSTEP if k + 1 < len(v) else v[k]
    way = q[rows] - (q[k] + 0.5 * (v[k] + speed) * late)
    t = (np.arange(rows.start, rows.start + len(way)) * SUBSTEP - stop.at)[:, None]
    for sign in (1.0, -1.0):
        fast = sign * speed + figures.speed
        if (sign * way > farthest(t, fast, figures, stop.brake)).any():
            return "too far"
        slow = sign * speed - figures.speed
        if not stop.brake and (sign * way < nearest(t, slow, figures)).any():
            return "too hard"
    begun = np.abs(speed) + figures.speed
    rest = rest_time(begun, *least_of(figures, stop.brake))
    at_rest = t > rest + figures.settle_time
    if (at_rest & (np.abs(v[rows]) > figures.speed)).any():
        return "no rest"
    return None


def least_of(figures: Declared, brake: bool) -> tuple[Floats, Floats]:
    """Least deceleration of a stop or brake, and its ramp."""
    if brake:
        return figures.brake, np.zeros_like(figures.ramp)
    return figures.deceleration, figures.ramp


def farthest(t: Floats, speed: Floats, figures: Declared, brake: bool) -> Floats:
    """Farthest way of a stop, by time; its swing adds to it after the latest rest.

    Args:
        t: Times since the effect, shape (t, 1) [s].
        speed: Greatest speed then in this direction, of either sign, shape (k,).
        figures: Figures.
        brake: Whether it is a brake.
    """
    least, ramp = least_of(figures, brake)
    begun = np.maximum(speed, 0.0)
    way = travelled(t, begun, least, ramp)
    swing = figures.settle * begun / figures.velocity
    swinging = t > rest_time(begun, least, ramp)
    back = figures.back * np.maximum(-speed, 0.0) / figures.velocity
    return way + np.where(swinging, np.maximum(swing, back), 0.0) + figures.position


def nearest(t: Floats, speed: Floats, figures: Declared) -> Floats:
    """Least way of a stop in a direction, by time; see `farthest`."""
    none = np.zeros_like(figures.ramp)
    begun = np.maximum(speed, 0.0)
    way = travelled(t, begun, figures.most, none)
    back = travelled(t, np.maximum(-speed, 0.0), figures.deceleration, figures.ramp)
    swinging = t > rest_time(begun, figures.most, none)
    swing = np.maximum(figures.back * begun, figures.settle * np.maximum(-speed, 0.0))
    swing = np.where(swinging, swing / figures.velocity, 0.0)
    return way - back - swing - figures.position


def rest_time(speed: Floats, deceleration: Floats, ramp: Floats) -> Floats:
    """Time from the effect of a stop until the joint rests [s]."""
    short = np.sqrt(2.0 * ramp * speed / deceleration)
    long = 0.5 * ramp + speed / deceleration
    return np.where(speed <= 0.5 * deceleration * ramp, short, long)


def travelled(t: Floats, speed: Floats, deceleration: Floats, ramp: Floats) -> Floats:
    """Way of a stop, without any swing, shape (t, k) [rad].

    Args:
        t: Times since the effect, shape (t, 1) [s].
        speed: Speed then, >= 0, shape (k,) [rad/s].
        deceleration: Its full value, shape (k,) [rad/s²].
        ramp: Time in which it rises to that, shape (k,) [s].
    """
    t = np.minimum(t, rest_time(speed, deceleration, ramp))
    rising = np.minimum(t, ramp)
    with np.errstate(divide="ignore", invalid="ignore"):
        jerk = np.where(ramp > 0.0, deceleration / ramp, 0.0)
    way = speed * rising - jerk * rising**3 / 6.0
    on = t - rising
    left = speed - 0.5 * deceleration * rising
    return way + np.where(on > 0.0, left * on - 0.5 * deceleration * on**2, 0.0)


def misses(
    v: Floats,
    free: Bools,
    first: Ints,
    sent: Sequence[Commanded],
    declared: Declared,
    command: Floats,
) -> bool:
    """Whether a joint left what was commanded by more than its tracking error.

    From any instant to a later one its velocity stays between what it was and the
    commands under way: those sent within `command` before the first instant or later,
    and the one before them.

    Args:
        v: True velocities at every substep, shape (t, n) [rad/s].
        free: Whether each arm was its operator's after each substep, shape (t, a).
        first: First joint of each arm, and n, shape (a + 1,).
        sent: All commands, in the order of time.
        declared: What was declared.
        command: Longest delay of each arm's orders, shape (a,) [s].
    """
    held = np.zeros_like(v)
    for each in sent:
        own = slice(int(first[each.arm]), int(first[each.arm + 1]))
        held[round(each.at / SUBSTEP) :, own] = each.velocity
    for arm in range(free.shape[1]):
        own = slice(int(first[arm]), int(first[arm + 1]))
        error = declared.tracking[own] + declared.speed[own] + GRAIN
        delay = int(np.ceil(command[arm] / SUBSTEP - 1e-9))
        for period in runs(free[:, arm]):
            for sign in (1.0, -1.0):
                speed, sent_last = sign * v[period, own], sign * held[:, own]
                if exceeds(speed, sent_last, period.start, delay, error):
                    return True
    return False


def exceeds(speed: Floats, held: Floats, start: int, delay: int, error: Floats) -> bool:
    """Whether speeds of a period exceed the commands under way.

    Args:
        speed: Speeds, shape (t, k) [rad/s].
        held: The command sent last at every substep of the episode, shape (s, k).
        start: Substep at which the period begins.
        delay: Longest delay of a command in substeps.
        error: What is allowed beyond, shape (k,) [rad/s].
    """
    count = len(speed)
    rows = np.arange(start, start + count)
    sent = [held[np.maximum(rows - back, 0)] for back in range(delay + 1)]
    highest = np.max(sent, axis=0)
    for back in range(1, min(round(HORIZON / SUBSTEP), count - 1) + 1):
        earlier = held[np.maximum(rows - delay - back, 0)]
        highest = np.maximum(highest, earlier)
        allowed = np.maximum(highest[back:], speed[:-back]) + error
        if (speed[back:] > allowed).any():
            return True
    return False
