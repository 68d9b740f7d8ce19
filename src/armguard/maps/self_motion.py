"""Self-motion of a redundant robot: other plans along which its tool moves the same.

A robot with more joints than its tool needs can move its elbow while the tool stays
where it is. From each row of a plan the joints move within the null space of the tool's
Jacobian, by a length that rises from zero, stays, and returns to zero. At each time the
tool has the same pose as on the plan.
"""

from collections.abc import Iterator
from math import ceil

import numpy as np
from numpy.typing import NDArray

from armguard.maps.cell_plan import CoordinationError
from armguard.prove.tube import Tube
from armguard.respond.tool import Tool, tool_of
from armguard.robot.kinematics import FIXED, PRISMATIC
from armguard.scene.poses import body_poses
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]

# Lengths of the way in joint space that are tried, in this order [rad or m].
LENGTHS = (0.5, 0.8, 0.3)

# Longest step within the null space [rad or m].
STEP = 0.1

# Time in which the length rises, and in which it returns to zero, and the share of the
# plan that either takes at most [s, -].
RISE, MOST = 1.5, 0.3

# Time between two rows of a displaced plan [s].
EVERY = 0.05

# How far the tool of a displaced plan may be from that of the plan [m, rad].
POSITION, ROTATION = 1e-4, 1e-3

# Velocities that differ by less where segments meet are the same [rad/s or m/s].
SMOOTH = 1e-6

# Newton's method: error of a pose that ends it [m, rad], and count of steps.
EXACT, STEPS = 1e-9, 10

# Numbers of a twist.
TWIST = 6


class SelfMotion:
    """The self-motion of a robot along a plan.

    Args:
        tables: The scene.
        robot: Name of the robot.
        tube: Curves of its plan.

    Raises:
        CoordinationError: The robot is not redundant.
    """

    def __init__(self, tables: SceneTables, robot: str, tube: Tube) -> None:
        self._tool, self._tube, self._tables = tool_of(tables, robot), tube, tables
        self._stopping = tables.robots[self._tool.robot].stopping
        self._chain = joints_to(self._tool)
        if len(self._chain) <= TWIST:
            raise CoordinationError(
                f"{len(self._chain)} joints move the tool of '{robot}', so its plans "
                f"have no alternatives; leave out `alternatives`, or use a robot whose "
                f"tool is moved by {TWIST + 1} joints"
            )
        self._segment, share = sampled(tube)
        self._times = tube.time(self._segment, share)
        self._rows, self._rates = curves_at(tube, self._segment, share)
        self._poses = self._tools(self._rows)
        J = self._jacobians(self._rows)
        self._twists = np.einsum("kij,kj->ki", J, self._rates[:, self._chain])
        # In the first row either direction, then that which is nearest to the last.
        within = null_spaces(J)
        self._ways = within[:, 0].copy()
        for k in range(1, len(J)):
            self._ways[k] = unit(within[k].T @ (within[k] @ self._ways[k - 1]))

    def tubes(self) -> Iterator[Tube]:
        """Displaced plans that the robot can execute, to both sides in turn."""
        for length in LENGTHS:
            for side in (1.0, -1.0):
                found = self.displaced(side * length)
                if found is not None:
                    yield found

    def displaced(self, length: float) -> Tube | None:
        """The plan with its joints displaced; None if the robot cannot execute it.

        Args:
            length: Greatest length of the way within the null space; its sign is that
                of the direction [rad or m].
        """
        share = plateau(self._times, *self._tube.times[[0, -1]].tolist())
        count, chain = ceil(abs(length) / STEP), self._chain
        found, ways = self._rows.copy(), self._ways
        for _ in range(count):
            within = null_spaces(self._jacobians(found))
            ways = unit(np.einsum("kij,kil,kl->kj", within, within, ways))
            found[:, chain] += length / count * share[:, None] * ways
            if not self._returned(found):
                return None
        J, speeds = self._jacobians(found), self._rates.copy()
        within, slopes = null_spaces(J), self._slopes(found)
        # The tool moves as on the plan; the rest is the change of the displacement.
        speeds[:, chain] = np.einsum("kij,kj->ki", np.linalg.pinv(J), self._twists)
        speeds[:, chain] += np.einsum("kij,kil,kl->kj", within, within, slopes)
        tube = cubics(self._segment, self._times, found, speeds)
        return tube if self._within_limits(tube) and self._keeps_tool(tube) else None

    def deviation(self, tube: Tube, times: Floats) -> tuple[float, float]:
        """Greatest distance [m] and rotation [rad] between the tools of both plans.

        Args:
            tube: Another plan of the robot.
            times: When they are compared, shape (k,) [s].
        """
        off = twists_between(
            *(self._tools(one.at(times)) for one in (tube, self._tube))
        )
        far, turned = (np.linalg.norm(off[:, k : k + 3], axis=1).max() for k in (0, 3))
        return float(far), float(turned)

    def _returned(self, rows: Floats) -> bool:
        """Let the tools of rows return to those of the plan, by Newton's method.

        Args:
            rows: Overwritten, shape (k, n).

        Returns:
            Whether they are there.
        """
        for _ in range(STEPS):
            off = twists_between(self._tools(rows), self._poses)
            if np.abs(off).max() < EXACT:
                return True
            inverse = np.linalg.pinv(self._jacobians(rows))
            rows[:, self._chain] += np.einsum("kij,kj->ki", inverse, off)
        return False

    def _slopes(self, rows: Floats) -> Floats:
        """Rates of the joints that move the tool, by differences of rows, (k, m).

        Both sides of a place where segments meet have the same rates, unless those of
        the plan differ there.
        """
        meets = np.diff(self._segment, prepend=self._segment[0]) > 0
        jumps = np.abs(np.diff(self._rates, axis=0, prepend=self._rates[:1]))
        again = meets & (jumps.max(axis=1) <= SMOOTH)
        kept = np.flatnonzero(~again)
        parts = np.split(kept, np.flatnonzero((meets & ~again)[kept]))
        found = [
            np.gradient(rows[own][:, self._chain], self._times[own], axis=0)
            for own in parts
        ]
        return np.asarray(np.concatenate(found)[np.cumsum(~again) - 1])

    def _tools(self, rows: Floats) -> Floats:
        """Poses of the tool, [R | p], shape (k, 3, 4)."""
        tool, tables = self._tool, self._tables
        T = np.array([body_poses(tables, q)[tool.body] for q in rows]).reshape(-1, 3, 4)
        at = T[:, :, :3] @ tool.p_body + T[:, :, 3]
        return np.concatenate((T[:, :, :3], at[:, :, None]), axis=2)

    def _jacobians(self, rows: Floats) -> Floats:
        """Jacobians of the tool by the joints that move it, shape (k, 6, m)."""
        tables, body = self._tables, self._tool.body
        poses = np.array([body_poses(tables, q) for q in rows])
        T = poses[:, body].reshape(-1, 3, 4)
        point = T[:, :, :3] @ self._tool.p_body + T[:, :, 3]
        found = np.zeros((len(rows), TWIST, len(tables.q_names)))
        while body >= 0:
            if tables.joint_kind[body] != FIXED:
                T = poses[:, body].reshape(-1, 3, 4)
                axis, column = T[:, :, :3] @ tables.axis[body], tables.q_index[body]
                gain = tables.gain[body, 0]
                if tables.joint_kind[body] == PRISMATIC:
                    found[:, :3, column] += gain * axis
                else:
                    found[:, :3, column] += gain * np.cross(axis, point - T[:, :, 3])
                    found[:, 3:, column] += gain * axis
            body = int(tables.parent[body])
        return found[:, :, self._chain]

    def _within_limits(self, tube: Tube) -> bool:
        """Whether the joints can execute it."""
        tables, own = self._tables, self._tool.own
        control = tube.control[:, :, own]
        inside = (control >= tables.lower[own]) & (control <= tables.upper[own])
        figures = self._stopping
        if figures is None:
            # No limits are declared: no joint is quicker than the quickest of the plan.
            speed = np.abs(self._rates[:, own]).max()
            return bool(inside.all() and tube.top_speeds()[:, own].max() <= speed)
        quick = tube.top_speeds()[:, own] > figures.velocity
        sharp = top_accelerations(tube)[:, own] > figures.acceleration
        return bool(inside.all() and not quick.any() and not sharp.any())

    def _keeps_tool(self, tube: Tube) -> bool:
        """Whether the tool keeps its path also between two rows."""
        shares = np.array([0.25, 0.5, 0.75])
        steps = np.diff(tube.times)[:, None]
        times = (tube.times[:-1, None] + shares * steps).ravel()
        far, turned = self.deviation(tube, times)
        return far <= POSITION and turned <= ROTATION


def null_spaces(J: Floats) -> Floats:
    """Orthonormal rows that span the null space of each Jacobian, (k, m - 6, m)."""
    return np.asarray(np.linalg.svd(J)[2][:, TWIST:])


def twists_between(T: Floats, goal: Floats) -> Floats:
    """Translation and small rotation from poses to others, shape (k, 6) [m, rad]."""
    M = goal[:, :, :3] @ T[:, :, :3].transpose(0, 2, 1)
    M = 0.5 * (M - M.transpose(0, 2, 1))
    turn = np.stack((M[:, 2, 1], M[:, 0, 2], M[:, 1, 0]), axis=1)
    return np.concatenate((goal[:, :, 3] - T[:, :, 3], turn), axis=1)


def unit(vectors: Floats) -> Floats:
    """Vectors of length one."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def joints_to(tool: Tool) -> NDArray[np.intp]:
    """Places in q of the joints that move a tool, rising, shape (m,)."""
    tables, found, body = tool.tables, set[int](), tool.body
    while body >= 0:
        if tables.joint_kind[body] != FIXED:
            found.add(int(tables.q_index[body]))
        body = int(tables.parent[body])
    return np.array(sorted(found), dtype=np.intp)


def sampled(tube: Tube) -> tuple[NDArray[np.intp], Floats]:
    """Rows of a tube: segments and shares of them; both sides where segments meet."""
    parts = np.ceil(np.diff(tube.times) / EVERY).astype(np.intp)
    shares = [np.linspace(0.0, 1.0, count + 1) for count in parts]
    return np.repeat(np.arange(len(parts)), parts + 1), np.concatenate(shares)


def curves_at(
    tube: Tube, segment: NDArray[np.intp], share: Floats
) -> tuple[Floats, Floats]:
    """Positions [rad or m] and velocities of curves, each shape (k, n).

    Args:
        tube: The curves.
        segment: Segment of each row, shape (k,).
        share: Share of it that has passed, shape (k,) [-].
    """
    points, u = tube.control[segment], share[:, None]
    # De Casteljau's scheme; the last two points are on the tangent.
    while points.shape[1] > 2:
        points = points[:, :-1] + u[:, :, None] * np.diff(points, axis=1)
    way = points[:, 1] - points[:, 0]
    time = np.diff(tube.times)[segment, None]
    return points[:, 0] + u * way, tube.degree * way / time


def plateau(times: Floats, start: float, end: float) -> Floats:
    """A smooth rise from 0 at the start to 1, and the way back until the end [-]."""
    rise = min(RISE, MOST * (end - start))
    up, down = (np.clip(one / rise, 0.0, 1.0) for one in (times - start, end - times))
    share = np.minimum(up, down)
    return np.asarray(share**3 * (10.0 - 15.0 * share + 6.0 * share**2))


def cubics(segment: NDArray[np.intp], times: Floats, q: Floats, v: Floats) -> Tube:
    """Cubics between rows of the same segment.

    Args:
        segment: Segment of each row, shape (k,).
        times: Time of each row, shape (k,) [s].
        q: Joint positions, shape (k, n) [rad or m].
        v: Joint velocities, shape (k, n) [rad/s or m/s].
    """
    first = np.flatnonzero(np.diff(segment) == 0)
    third = (times[first + 1] - times[first])[:, None] / 3.0
    start, end = q[first], q[first + 1]
    control = np.stack(
        (start, start + third * v[first], end - third * v[first + 1], end), axis=1
    )
    wide = np.zeros_like(start)
    return Tube(np.append(times[first], times[-1]), control, wide)


def top_accelerations(tube: Tube) -> Floats:
    """Bound of each joint's acceleration in each segment, (s, n) [rad/s² or m/s²]."""
    bends = np.abs(np.diff(tube.control, 2, axis=1)).max(axis=1)
    scale = tube.degree * (tube.degree - 1) / np.diff(tube.times) ** 2
    return np.asarray(scale[:, None] * bends)
