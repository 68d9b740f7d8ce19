"""Following of surfaces by any arm: tangent to what is near, at a standoff.

The velocity is the nearest one to the pull of the goal that keeps the standoff: its
projection onto the tangent of the surfaces. It never leads away from the goal but to
open a pair, so it is not complete: before a wall it ends in a local minimum.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.errors import GoalError, SceneError, UnknownNameError, known_names
from armguard.guard.near_pair import NearPair
from armguard.guard.verdict import Verdict
from armguard.respond.following.state import State
from armguard.respond.guard import Guard
from armguard.respond.solver import nearest_velocity
from armguard.robot.kinematics import FIXED, PRISMATIC, forward_kinematics

Floats = NDArray[np.float64]

# Rate at which the distance of a pair goes to the standoff [1/s].
RATE = 4.0

# The pull is slowed down within this time of the goal [s]. A robot is at it within so
# much of each joint [rad or m].
SLOWING, AT_GOAL = 0.3, 2e-3

# Share of its distance by which a goal has to come nearer within the patience [-].
NEARER = 0.01


class SurfaceFollower:
    """Leads a robot to joint positions, along the surfaces that are in its way.

    Call `velocity` in each cycle and give its result to `Guard.filter`, which proves
    it. Pairs of the robot with others that are nearer than the standoff are opened, or
    where not all of them can be, not closed.

    Attributes:
        state: `TO_GOAL`, `FOLLOWING`, `ARRIVED` or `LOCAL_MINIMUM`.

    Args:
        guard: The guard. Its scene's `margin` has to be more than the standoff.
        robot: Name of the robot.
        goal: Joint positions, in the robot's order, shape (k,) [rad or m].
        standoff: Distance at which surfaces are followed [m].
        speed: Greatest joint velocity [rad/s or m/s].
        patience: Time after which a goal that did not come nearer is a local minimum
            [s].

    Raises:
        UnknownNameError: There is no such robot.
        GoalError: The goal is not of the robot's joints, or outside their limits.
        SceneError: The margin is not more than the standoff.
    """

    def __init__(
        self, guard: Guard, robot: str, goal: ArrayLike, *, standoff: float = 0.125,
        speed: float = 0.5, patience: float = 1.5,
    ) -> None:  # fmt: skip
        t = self._tables = guard.tables
        names = [part.name for part in t.robots]
        if robot not in names:
            raise UnknownNameError(f"no robot is named '{robot}'; {known_names(names)}")
        part = t.robots[names.index(robot)]
        self._own = slice(part.first_joint, part.first_joint + part.joint_count)
        self._goal = np.array(goal, dtype=np.float64)
        if self._goal.shape != (part.joint_count,):
            raise GoalError(
                f"robot '{robot}' has {part.joint_count} joints; its goal has the "
                f"shape {self._goal.shape}"
            )
        inside = (t.lower[self._own] <= self._goal) & (self._goal <= t.upper[self._own])
        if not inside.all():
            raise GoalError(f"the goal of robot '{robot}' is outside its joint limits")
        if not t.margin > standoff:
            raise SceneError(
                f"pairs are reported up to {t.margin} m and followed at "
                f"{standoff} m; set a `margin` of {2.0 * standoff:g}"
            )
        self._robot, self.standoff = robot + "/", standoff
        self._speed, self._patience = speed, patience
        self.state = State.TO_GOAL
        self._least, self._since = np.inf, -np.inf

    def velocity(self, q: ArrayLike, verdict: Verdict) -> Floats:
        """The desired joint velocities of all robots, zero but for this one.

        Args:
            q: Measured joint positions of all robots, shape (n,) [rad or m].
            verdict: Verdict of the last cycle.
        """
        q = np.asarray(q, dtype=np.float64)
        found = np.zeros(len(q))
        if self.state not in (State.TO_GOAL, State.FOLLOWING):
            return found
        way = self._goal - q[self._own]
        most, left = float(np.abs(way).max()), float(np.linalg.norm(way))
        if most <= AT_GOAL:
            self.state = State.ARRIVED
            return found
        now = verdict.stamp or 0.0
        if left < (1.0 - NEARER) * self._least:
            self._least, self._since = left, now
        elif now - self._since > self._patience:
            self.state = State.LOCAL_MINIMUM
            return found
        pull = way * min(self._speed / most, 1.0 / SLOWING)
        rows, limits = self._rows(q, verdict)
        blocked = bool((rows @ pull > limits).any())
        self.state = State.FOLLOWING if blocked else State.TO_GOAL
        bound = np.full(len(way), self._speed)
        velocity = nearest_velocity(pull, -bound, bound, rows, limits)
        if velocity is None:
            # Not all pairs that are too near can be opened: none is closed.
            still = np.maximum(limits, 0.0)
            velocity = nearest_velocity(pull, -bound, bound, rows, still)
        if velocity is not None:
            found[self._own] = velocity
        return found

    def _rows(self, q: Floats, verdict: Verdict) -> tuple[Floats, Floats]:
        """Closing rates of near pairs by joint, as unit rows, and their limits."""
        t = self._tables
        T = np.zeros((len(t.parent), 12))
        forward_kinematics(
            q, t.parent, t.joint_kind, t.q_index, t.gain, t.T_parent_joint, t.axis, T
        )
        poses = T.reshape(-1, 3, 4)
        rows, limits = [np.zeros((0, len(self._goal)))], list[float]()
        for pair in verdict.near:
            row = self._closing(pair, poses)
            size = 0.0 if row is None else float(np.linalg.norm(row))
            if row is not None and size > 1e-6:
                rows.append(row[None] / size)
                limits.append(RATE * (pair.distance - self.standoff) / size)
        return np.concatenate(rows), np.array(limits)

    def _closing(self, pair: NearPair, poses: Floats) -> Floats | None:
        """Rate at which each joint closes a pair [m/rad]; None for pairs of others."""
        owns = [body.startswith(self._robot) for body in (pair.a, pair.b)]
        if owns[0] == owns[1]:
            return None
        link, point = (pair.a, pair.point_a) if owns[0] else (pair.b, pair.point_b)
        normal = pair.normal if owns[0] else -pair.normal
        t, row = self._tables, np.zeros(len(self._tables.lower))
        body = t.links[link].body
        while body >= 0:
            if t.joint_kind[body] != FIXED:
                way = poses[body, :, :3] @ t.axis[body]
                if t.joint_kind[body] != PRISMATIC:
                    way = np.cross(way, point - poses[body, :, 3])
                row[t.q_index[body]] += t.gain[body, 0] * (way @ normal)
            body = int(t.parent[body])
        return row[self._own]
