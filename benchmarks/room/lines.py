"""Straight lines of a tool of the bay, driven at a speed, and what a guard says."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from operator import attrgetter
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from armguard import Guard, Level, Scene
from armguard.cli.console import progress_bar
from armguard.robot.kinematics import forward_kinematics
from armguard.scene.settings import Mode
from armguard.scene.tables import SceneTables
from arrays import Floats
from episodes.follower import Arms

MODES: tuple[Mode, ...] = ("path", "speed", "fixed")

JOINTS = 7
PERIOD = 1e-3  # [s]

# From knot to knot of a line [m], and of a finite difference of a joint [rad].
STEP = 2e-3
NUDGE = 1e-6

# No line bends so much that its fastest drive [m/s] requires more than this of a joint:
# a share of its top speed [-], and an acceleration, half of the bay's [rad/s²].
FASTEST = 0.6
SPEED_SHARE = 0.95
ACCELERATION = 4.0

# Joints keep this distance from their limits [rad].
ROOM = 0.05

# How much an arm swings besides leading its tool [-].
SWINGS = (0.0, 0.5, 1.0)

# How far a ruler sees [m]: across the bay.
SIGHT = 3.0


class Hand:
    """A point that is fixed to the last link of an arm.

    Args:
        tables: The scene.
        robot: Name of the arm.
        local: The point in the frame of that link, shape (3,) [m].
    """

    def __init__(self, tables: SceneTables, robot: str, local: Floats) -> None:
        self._tables, self._robot = tables, robot
        self.joints = Arms(tables).own[robot]
        primitive = tables.body_names.index(f"{robot}/link{JOINTS}")
        self._body = int(tables.bodies[primitive])
        self._local = local

    def holding(self, q: Floats, point: Floats) -> "Hand":
        """The same for a point of the world that the link holds at q, (3,) [m]."""
        R, p = self._pose(q)
        return Hand(self._tables, self._robot, R.T @ (point - p))

    def at(self, q: Floats) -> Floats:
        """Where the point is, shape (3,) [m]."""
        R, p = self._pose(q)
        return p + R @ self._local

    def jacobian(self, q: Floats) -> Floats:
        """How it moves with the arm's joints, shape (3, JOINTS) [m/rad]."""
        columns = []
        for j in range(*self.joints.indices(len(q))):
            step = np.zeros_like(q)
            step[j] = NUDGE
            columns.append((self.at(q + step) - self.at(q - step)) / (2.0 * NUDGE))
        return np.stack(columns, axis=1)

    def _pose(self, q: Floats) -> tuple[Floats, Floats]:
        """Rotation and origin of the last link."""
        t = self._tables
        T = np.zeros((len(t.parent), 12))
        forward_kinematics(
            q,
            t.parent,
            t.joint_kind,
            t.q_index,
            t.gain,
            t.T_parent_joint,
            t.axis,
            T,
        )
        row = T[self._body].reshape(3, 4)
        return row[:, :3], row[:, 3]


@dataclass(frozen=True, slots=True)
class Line:
    """A straight line of a point of the tool.

    Attributes:
        length: Its length [m].
        q_of: All joint positions over the way made on it [m].
    """

    length: float
    q_of: CubicSpline

    def drive(self, speed: float) -> Iterator[tuple[Floats, Floats, float]]:
        """Positions, velocities and tool speed of each cycle, from standstill on.

        Args:
            speed: Speed of the tool [m/s].
        """
        slope = np.abs(self.q_of(np.arange(0.0, self.length, STEP), 1)).max()
        push = ACCELERATION / float(slope)
        for k in range(int((self.length / speed + speed / push) / PERIOD)):
            pace = min(push * k * PERIOD, speed)
            until = speed / push
            t = k * PERIOD
            way = 0.5 * push * min(t, until) ** 2 + speed * max(t - until, 0.0)
            if way > self.length:
                return
            yield self.q_of(way), self.q_of(way, 1) * pace, pace


def next_slope(hand: Hand, q: Floats, along: Floats, swing: Floats) -> Floats:
    """Change of the joints for a metre of the line, shape (n,) [rad/m].

    Args:
        hand: The point that is led.
        q: Positions, shape (n,).
        along: Unit direction of the line, shape (3,).
        swing: What the arm does besides that leaves the point where it is, in shares of
            what the line takes, before it is projected, shape (JOINTS,) [-].
    """
    J = hand.jacobian(q)
    inverse = np.linalg.pinv(J)
    least = inverse @ along
    free = swing - inverse @ (J @ swing)
    slope = np.zeros_like(q)
    slope[hand.joints] = least + np.linalg.norm(least) * free
    return slope


def knots(
    tables: SceneTables, hand: Hand, q: Floats, along: Floats, swing: Floats
) -> Iterator[Floats]:
    """Positions along a line, STEP apart, until a joint gets to its limits.

    Raises nothing: a line that cannot be driven at FASTEST ends there.
    """
    top = SPEED_SHARE * Arms(tables).joined("velocity")
    while ((q > tables.lower + ROOM) & (q < tables.upper - ROOM))[hand.joints].all():
        yield q
        slope = next_slope(hand, q, along, swing)
        if not (np.abs(slope) * FASTEST < top).all():
            return
        middle = q + 0.5 * STEP * slope
        q = q + STEP * next_slope(hand, middle, along, swing)


def line_through(rows: list[Floats]) -> Line | None:
    """The line through its knots; None if it bends too much to be driven."""
    ways = STEP * np.arange(len(rows))
    q_of = CubicSpline(ways, np.array(rows))
    bend = np.abs(q_of(ways, 2)).max() * FASTEST**2
    return Line(float(ways[-1]), q_of) if bend < ACCELERATION else None


def drawn_swing(rng: np.random.Generator) -> Floats:
    """What an arm does besides leading its tool, see `next_slope`."""
    swing = rng.normal(size=JOINTS)
    return swing * (rng.choice(SWINGS) / np.linalg.norm(swing))


def ruler_of(scene: Scene) -> Guard:
    """A guard that measures every pair of a scene."""
    scene.set_margin(SIGHT)
    return Guard(scene, self_test=False)


# Reasons from here on are about the input, which is as it should be here [-].
FAULTS = 100


@dataclass(frozen=True, slots=True)
class Warned:
    """A warning.

    Attributes:
        distance: True distance of the pair it is for [m].
        pair: Its two bodies.
        speed: Speed of the tool [m/s].
        budget: What the pair needs, by cause [m]; None where buffers are fixed.
        closing: Closing speed the guard counts with for the time left [m/s]; None
            where there is none left.
    """

    distance: float
    pair: tuple[str, str]
    speed: float
    budget: dict[str, float] | None
    closing: float | None


def first_warnings(
    guard: Guard, motion: Iterable[tuple[Floats, Floats, float]]
) -> tuple[Warned | None, Warned | None]:
    """The first slow and the first stop of a motion, which ends there.

    The guard gets every sample with its stamp and its velocity, all exact, and does not
    know how old it is: it counts as late as declared.

    Raises:
        RuntimeError: The guard refused the input: the motion is not what it should be.
    """
    guard.reset()
    slow: Warned | None = None
    for k, (q, v, speed) in enumerate(motion):
        verdict = guard.step(q, k * PERIOD, velocity=v)
        if verdict.reason >= FAULTS:
            raise RuntimeError(verdict.why)
        if verdict.level < Level.SLOW:
            continue
        near, budget = verdict.near, verdict.budget
        stopped = verdict.level >= Level.STOP
        # A stop is for what lacks most, a slow for what has least time.
        lacks = "headroom" if stopped else "time_left"
        pair = min(near, key=attrgetter(lacks))
        warning = Warned(
            pair.primitive_distance,
            (pair.a, pair.b),
            speed,
            None if budget is None else asdict(budget),
            pair.headroom / pair.time_left if pair.time_left > 0.0 else None,
        )
        if stopped:
            return slow or warning, warning
        slow = slow or warning
    return slow, None


def rows_of(
    name: str,
    motions: Iterable[Any],
    count: int,
    speeds: Sequence[float],
    of: Callable[[Any, Mode, float], Any],
) -> list[dict[str, Any]]:
    """What comes of motions at some speeds in each mode.

    Args:
        name: What they are.
        motions: The motions; those with a kind have it in their rows.
        count: How many.
        speeds: Speeds of the tool [m/s].
        of: What comes of one.
    """
    rows = []
    with progress_bar(f"{name}s", count * len(speeds)) as advance:
        for number, motion in enumerate(motions):
            kind = {"kind": motion.kind} if hasattr(motion, "kind") else {}
            for speed in speeds:
                modes = {mode: of(motion, mode, speed) for mode in MODES}
                rows.append({name: number, **kind, "tool_speed": speed, "modes": modes})
                advance(1)
    return rows
