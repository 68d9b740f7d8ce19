"""Operators that steer straight at what they want, and plan nothing."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from arrays import Floats
from reach.arena import Arena

# Share of their accelerations operators use, the top speed reached after a while [-].
GENTLE = 0.3

# Time in which an operator takes back what is left of the way, near its end [s].
ARRIVAL = 0.15

# A place on the way is passed when it is this near, in time at top speed [s].
PASSED = 0.02

# Speeds of tools at full share [m/s], [rad/s], and how fast these are reached [1/s].
TOOL_SPEED = 1.0
TOOL_TURN = 2.5
TOOL_RISE = 1.5

# What counts as there [rad or m]; of tools [m], [rad].
JOINT_THERE = 0.02
TOOL_THERE = 0.010
TURN_THERE = np.radians(3.0)


# Damping of the inverse near singular poses [m²], [rad²].
DAMPING = 4e-4


@dataclass(slots=True)
class Asked:
    """Desired motion of an operator.

    Attributes:
        joints: Joint velocities, shape (n,) [rad/s or m/s].
        twists: Twists of tools, where these are desired, each (6,).
    """

    joints: Floats
    twists: Mapping[str, Floats] | None = None


class Operator:
    """Desires velocities that lead to a goal, seeing the truth.

    Attributes:
        nominal: Time an unobstructed robot needs at least [s].
    """

    nominal = 0.0
    _speed = 0.0

    def ask(self, q: Floats, dt: float) -> Asked:
        """What is desired after a time dt, at a true configuration."""
        raise NotImplementedError

    def let_go(self) -> None:
        """Begin from standstill."""
        self._speed = 0.0

    def left(self, q: Floats) -> float:
        """What is left to do, in units of what counts as there [-]; never there."""
        return np.inf

    def goals(self, arena: Arena) -> Mapping[str, Floats]:
        """The goals: positions by robot, or poses by tool, (4, 4)."""
        return {}


class Joints(Operator):
    """Steers all joints along straight lines, all at the same place of each.

    Args:
        arena: Where.
        way: Configurations to pass, the last one the goal, each shape (n,).
        share: Share of the top speeds [-].
    """

    def __init__(self, arena: Arena, way: Sequence[Floats], share: float) -> None:
        self._velocity = arena.velocity
        self._way = list(way)
        self._share = share
        self._at = 0
        # Share of top speed by which all joints can speed up in a second [1/s].
        used = arena.driven
        rate = (arena.acceleration / arena.velocity)[used].min()
        self._rate = GENTLE * float(rate)
        self._nowhere = np.zeros(len(arena.velocity))

    def start(self, q: Floats) -> "Joints":
        """Note how long it takes from a configuration."""
        for a, b in pairwise([q, *self._way]):
            self.nominal += self._time(b - a) / self._share
            self.nominal += self._share / self._rate + ARRIVAL
        return self

    def ask(self, q: Floats, dt: float) -> Asked:
        """See `Operator`."""
        way = self._way[self._at] - q
        time = self._time(way)
        if time < PASSED and self._at + 1 < len(self._way):
            self._at += 1
            way = self._way[self._at] - q
            time = self._time(way)
        if time == 0.0:
            return Asked(self._nowhere.copy())
        last = self._at + 1 == len(self._way)
        speed = min(
            self._share,
            self._speed + self._rate * dt,
            max(np.sqrt(self._rate * time), 0.0 if last else 0.1 * self._share),
        )
        if last:
            speed = min(speed, time / ARRIVAL)
        self._speed = speed
        return Asked(way * (speed / time))

    def left(self, q: Floats) -> float:
        """See `Operator`; places that are still to be passed count as well."""
        corners = [q, *self._way[self._at :]]
        return (
            sum(float(np.abs(b - a).max()) for a, b in pairwise(corners)) / JOINT_THERE
        )

    def goals(self, arena: Arena) -> Mapping[str, Floats]:
        """See `Operator`; places on the way are left out."""
        return {name: self._way[-1][own] for name, own in arena.own.items()}

    def _time(self, way: Floats) -> float:
        """Time a way takes at top speed [s]."""
        return float((np.abs(way) / self._velocity).max())


class Tools(Operator):
    """Steers tools straight to poses.

    Args:
        arena: Where.
        goals: Poses of the arena's tools, each shape (4, 4).
        share: Share of the tools' speeds [-].
    """

    def __init__(self, arena: Arena, goals: Sequence[Floats], share: float) -> None:
        self._arena = arena
        self._goals = goals
        self._share = share

    def start(self, q: Floats) -> "Tools":
        """Note how long it takes from a configuration."""
        slowest = max(map(time_of, self._ways(self._arena.tool_poses(q))))
        self.nominal = slowest / self._share + self._share / TOOL_RISE + ARRIVAL
        return self

    def ask(self, q: Floats, dt: float) -> Asked:
        """See `Operator`."""
        poses, jacobians = self._arena.tool_state(q)
        ways = self._ways(poses)
        time = max(map(time_of, ways))
        if time > 0.0:
            self._speed = min(
                self._share,
                self._speed + TOOL_RISE * dt,
                np.sqrt(TOOL_RISE * time),
                time / ARRIVAL,
            )
        pace = self._speed / max(time, 1e-9)
        twists = {
            name: way * pace for name, way in zip(self._arena.tools, ways, strict=True)
        }
        return Asked(joints_for(self._arena, twists, jacobians), twists)

    def left(self, q: Floats) -> float:
        """See `Operator`."""
        return max(
            max(
                float(np.linalg.norm(way[:3])) / TOOL_THERE,
                float(np.linalg.norm(way[3:])) / TURN_THERE,
            )
            for way in self._ways(self._arena.tool_poses(q))
        )

    def goals(self, arena: Arena) -> Mapping[str, Floats]:
        """See `Operator`."""
        return dict(zip(arena.tools, self._goals, strict=True))

    def _ways(self, poses: Sequence[Floats]) -> list[Floats]:
        """What is left for each tool: a shift [m] and a turn [rad], shape (6,)."""
        return [
            np.concatenate(
                [
                    goal[:3, 3] - T[:3, 3],
                    Rotation.from_matrix(goal[:3, :3] @ T[:3, :3].T).as_rotvec(),
                ]
            )
            for goal, T in zip(self._goals, poses, strict=True)
        ]


class Push(Operator):
    """Pushes tools one way, without end: what a slide is made of.

    Args:
        arena: Where.
        tools: Tools that are pushed.
        twist: Desired velocity of each of them, shape (6,).
        duration: How long [s].
    """

    def __init__(
        self, arena: Arena, tools: Sequence[str], twist: Floats, duration: float
    ) -> None:
        self._arena = arena
        self._tools = tools
        self._twist = twist
        self.nominal = duration

    def ask(self, q: Floats, dt: float) -> Asked:
        """See `Operator`."""
        _, jacobians = self._arena.tool_state(q)
        self._speed = min(1.0, self._speed + 2.0 * dt)
        twists = dict.fromkeys(self._tools, self._twist * self._speed)
        return Asked(joints_for(self._arena, twists, jacobians), twists)


def time_of(way: Floats) -> float:
    """Time a tool's way takes at full share [s]."""
    shift, turn = np.linalg.norm(way[:3]), np.linalg.norm(way[3:])
    return float(max(shift / TOOL_SPEED, turn / TOOL_TURN))


def joints_for(
    arena: Arena, twists: Mapping[str, Floats], jacobians: Sequence[Floats]
) -> Floats:
    """Joint velocities for twists of tools, by damped least squares, shape (n,)."""
    v = np.zeros(len(arena.velocity))
    for robot, own in arena.own.items():
        wanted = [
            (J[:, own], twists[name])
            for name, J in zip(arena.tools, jacobians, strict=True)
            if name in twists and name.split("/", 1)[0] == robot
        ]
        if wanted:
            J = np.concatenate([J for J, _ in wanted])
            twist = np.concatenate([t for _, t in wanted])
            v[own] = J.T @ np.linalg.solve(J @ J.T + DAMPING * np.eye(len(J)), twist)
    return v
