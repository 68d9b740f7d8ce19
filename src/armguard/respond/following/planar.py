"""Following of sensed surfaces by planar arms, complete on the torus of their joints.

The arm goes straight towards the goal in joint space until its distance to what is
sensed falls to the standoff. From that hit point it follows the set of joint positions
at the standoff, the boundary of the obstacle in joint space, on one side, until it is
nearer to the goal than the hit point and the way straight ahead is free (Lumelsky,
Cheung and Sun). Each leave is two steps nearer, so there are finitely many. A boundary
that does not divide the arm from the goal has such a place: the last one at which it
meets the straight way from the hit point to the goal.

If the arm follows a part of the boundary again, that is known wholly. That part need
not be at the hit point: what is sensed later moves the boundary. In the plane that
covers the torus the goal is a lattice of points, and the boundary divides these. Those
that are not on the arm's side are given up; without any the goal is unreachable.

A prismatic last joint is retracted as far as the standoff demands. The more it is
retracted the more is free, so the boundary is that of the retracted arm.
"""

from math import hypot

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.respond.following.arm import PlanarArm, unit_vectors
from armguard.respond.following.curve import TURN, Curve
from armguard.respond.following.state import State

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# Directions that are tried at a boundary, and bisections between the last one that is
# blocked and the first that is free.
DIRECTIONS, BISECTIONS = 48, 6

# Angle towards the obstacle at which that begins [rad].
TOWARDS = 2.1

# Distance that a step regains where the arm is nearer than the standoff [m].
REGAIN = 0.002

# Edge of the squares of which one sensed point each is kept [m].
SQUARE = 0.01

# Parts of a step towards the goal, and places of a prismatic joint, that are tried.
PARTS, PLACES = 8, 25

# A step is like an earlier one if it is within this distance of it, in steps, and their
# directions have at least this cosine. After this many such steps a boundary is closed.
ALIKE, SAME_WAY, REPEATED = 1.5, 0.3, 10

# Steps around a boundary after which the follower gives up without a proof.
MOST_STEPS = 20_000

# Goals of the lattice on each side that are looked at.
LATTICE = np.stack(np.meshgrid(*[np.arange(-3, 4)] * 2), axis=-1).reshape(-1, 2)

# A joint is at its goal [rad or m].
AT_GOAL = 1e-9


class PlanarFollower:
    """Leads a planar arm to a goal by what its sensors see.

    Attributes:
        state: What it does. `UNREACHABLE` is proven up to the length of a step.
        held: Whether the standoff decided the last step.
        curves: Boundaries that were followed wholly, the latest last.

    Args:
        arm: The arm. Its revolute joints have no limits.
        q: Joint positions at the start, shape (2,) or (3,) [rad or m].
        goal: Joint positions of the goal, of that shape.
        standoff: Distance at which surfaces are followed [m]. Sensors have to see
            everything within it and a step.
        length: Length of a step in joint space [rad].
    """

    def __init__(
        self, arm: PlanarArm, q: ArrayLike, goal: ArrayLike, *, standoff: float = 0.125,
        length: float = 0.02,
    ) -> None:  # fmt: skip
        self.arm, self.standoff, self.length = arm, standoff, length
        start, end = np.array(q, np.float64), np.array(goal, np.float64)
        self._x, self._out = start[:2], float(start[2:].sum())
        self._end, self._outs = end[:2], (self._out, float(end[2:].sum()))
        self._points, self._squares = np.zeros((0, 2)), set[tuple[int, int]]()
        self._near, self.curves = self._points, list[Curve]()
        self._trail, self._heading, self._repeated = start[None, :2], 0.0, 0
        # Distance to the goal at the hit point, and the side of the obstacle: 1 left.
        self._hit_left, self._side = np.inf, 1
        self.state, self.held = State.TO_GOAL, False
        self._aim(self._goals()[0])

    def step(self, q: ArrayLike, points: ArrayLike) -> Floats:
        """The next joint positions.

        Args:
            q: Measured joint positions, revolute ones with any number of turns,
                shape (2,) or (3,) [rad or m].
            points: Points that the sensors see now, shape (m, 2) [m].

        Returns:
            Joint positions at most a step away; `q` where the state is final.
        """
        q = np.asarray(q, np.float64)
        self._x = q[:2] + TURN * np.round((self._x - q[:2]) / TURN)
        self._out = float(q[2:].sum())
        self._learn(np.asarray(points, np.float64))
        if self.state == State.FOLLOWING:
            self._trace()
        wanted = self._x
        if self.state == State.TO_GOAL:
            wanted = self._straight()
        if self.state == State.FOLLOWING:
            wanted = self._along()
        if self.state in (State.TO_GOAL, State.FOLLOWING):
            return self._extended(wanted)
        return self._with_last(self._x, self._out)

    def _with_last(self, x: Floats, out: float) -> Floats:
        """All joint positions, shape (2,) or (3,)."""
        return np.append(x, out) if self.arm.travel > 0.0 else x.copy()

    def _learn(self, points: Floats) -> None:
        """Keep new points, and those that a step may come near to."""
        fresh = []
        squares = np.floor(points / SQUARE).astype(np.int64).tolist()
        for point, (i, j) in zip(points, squares, strict=True):
            if (i, j) not in self._squares:
                self._squares.add((i, j))
                fresh.append(point)
        self._points = np.concatenate([self._points, np.reshape(fresh, (-1, 2))])
        here = self._with_last(self._x, self._out)[None]
        margin = self.standoff + 2.0 * self.length * self.arm.reach + self.arm.travel
        self._near = self._points[self.arm.distance(here, self._points)[0] < margin]

    def _clearance(self, x: Floats, out: Floats | float = 0.0) -> Floats:
        """Distance to what is sensed, at joint positions (k, 2), shape (k,) [m]."""
        if self.arm.travel > 0.0:
            x = np.column_stack([x, np.broadcast_to(out, len(x))])
        return np.asarray(self.arm.distance(x, self._near).min(axis=1, initial=np.inf))

    def _free(self, x: Floats, shares: Floats | float = 1.0) -> Bools:
        """Whether the retracted arm keeps the standoff, or regains it.

        Args:
            x: Joint positions, shape (k, 2) [rad].
            shares: Parts of a step that lead there, shape (k,) or a number.
        """
        here = self._clearance(self._x[None])[0]
        least = np.minimum(self.standoff, here + REGAIN * np.asarray(shares))
        return np.asarray(self._clearance(x) >= least)

    def _ahead(self, goal: Floats) -> Floats:
        """Free places of the next step straight to a goal, shape (k, 2) [rad]."""
        way = goal - self._x
        shares = np.arange(1, PARTS + 1) / PARTS
        step = self.length / max(hypot(*way), self.length) * way
        places = self._x + shares[:, None] * step
        free = self._free(places, shares)
        return places[: PARTS if free.all() else int(np.argmin(free))]

    def _goals(self, within: float = np.inf) -> Floats:
        """Goals that no curve divides from the arm, the nearest first, shape (k, 2).

        Args:
            within: Greatest distance [rad].
        """
        around = np.round((self._x - self._end) / TURN)
        goals = self._end + TURN * (around + LATTICE)
        far = np.linalg.norm(goals - self._x, axis=1)
        goals = goals[np.argsort(far)][: int((far <= within).sum())]
        for curve in self.curves:
            goals = goals[curve.free_side(goals)] if len(goals) else goals
        return goals

    def _aim(self, goal: Floats) -> None:
        """Begin a straight way to a goal."""
        self._goal, self._from = goal, self._x.copy()
        self.state = State.TO_GOAL

    def _straight(self) -> Floats:
        """The next step straight to the goal; a hit point where it is blocked."""
        way = self._goal - self._x
        left = hypot(*way)
        ahead = self._ahead(self._goal)
        if left <= AT_GOAL or len(ahead):
            return self._x if left <= AT_GOAL else ahead[-1]
        angle = float(np.arctan2(way[1], way[0]))
        # The side on which the boundary leads more towards the goal.
        turns = {side: self._turn(angle, side) for side in (1, -1)}
        side = min(turns, key=lambda one: abs(turns[one] - angle))
        self._hit_left, self._side = left, side
        self._trail, self._repeated = self._x[None], 0
        self._heading, self.state = turns[side], State.FOLLOWING
        return self._x

    def _turn(self, start: float, side: int) -> float:
        """The first direction that is free, else the most open one [rad].

        Args:
            start: The first direction that is tried [rad].
            side: 1 to turn clockwise, -1 to turn the other way.
        """
        angles = start - side * np.arange(DIRECTIONS) * TURN / DIRECTIONS
        places = self._x + self.length * unit_vectors(angles)
        free = self._free(places)
        if not free.any():
            return float(angles[self._clearance(places).argmax()])
        k = int(np.argmax(free))
        found, blocked = float(angles[k]), float(angles[max(k - 1, 0)])
        for _ in range(BISECTIONS if k else 0):
            middle = 0.5 * (blocked + found)
            if self._free(self._x + self.length * unit_vectors(np.array([middle])))[0]:
                found = middle
            else:
                blocked = middle
        return found

    def _along(self) -> Floats:
        """The next step along the boundary."""
        if len(self._trail) > 1:
            towards = self._heading + self._side * TOWARDS
            self._heading = self._turn(towards, self._side)
        way = unit_vectors(np.array([self._heading]))[0]
        return np.asarray(self._x + self.length * way)

    def _trace(self) -> None:
        """Leave the boundary nearer to a goal, or decide where it is closed."""
        before = self._trail[-1]
        if hypot(*(self._x - before)) < AT_GOAL:
            return
        self._trail = np.vstack([self._trail, self._x])
        if len(self._trail) > MOST_STEPS:
            self.state = State.UNDECIDED
            return
        for goal in self._goals(self._hit_left - 2.0 * self.length):
            if len(self._ahead(goal)) == PARTS:
                self._aim(goal)
                return
        curve = self._closed()
        if curve is not None:
            self._decide(curve)

    def _closed(self) -> Curve | None:
        """The boundary, once the last steps have repeated earlier ones."""
        trail = self._trail
        gaps = self._x - trail
        periods = TURN * np.round(gaps / TURN)
        far = np.flatnonzero(np.hypot(*gaps.T) > 4.0 * self.length)
        steps = np.diff(trail, axis=0)
        sizes = np.maximum(np.hypot(*steps.T), AT_GOAL)
        same = steps @ steps[-1] > SAME_WAY * sizes * sizes[-1]
        same &= np.hypot(*(gaps - periods)[1:].T) < ALIKE * self.length
        earlier = np.flatnonzero(same[: far.max(initial=0)]) + 1
        self._repeated = self._repeated + 1 if len(earlier) else 0
        if self._repeated < REPEATED:
            return None
        first = earlier[-1]
        return Curve(trail[first:-1], periods[first], self._side)

    def _decide(self, curve: Curve) -> None:
        """Take another goal, or none, where a whole boundary is known."""
        if curve.free_side(self._goal[None])[0]:
            # It has a point from which the way is free, and that was missed.
            self.state = State.UNDECIDED
            return
        self.curves.append(curve)
        # A curve about an obstacle with one goal inside is about each goal alike.
        around_goal = curve.closed and not curve.around_arm
        goals = self._goals()
        if around_goal or not len(goals):
            self.state = State.UNREACHABLE
            return
        self._aim(goals[0])

    def _extended(self, x: Floats) -> Floats:
        """A step to joint positions, with the last joint out as far as it may be."""
        left = hypot(*(self._goal - x))
        share = min(left / max(hypot(*(self._goal - self._from)), self.length), 1.0)
        wanted = share * self._outs[0] + (1.0 - share) * self._outs[1]
        outs = np.linspace(0.0, wanted, PLACES)
        here = float(self._clearance(self._x[None], self._out)[0])
        least = min(self.standoff, here + REGAIN)
        free = self._clearance(np.tile(x, (PLACES, 1)), outs) >= least
        # It may be out as far as all places up to there are free.
        count = PLACES if free.all() else max(int(np.argmin(free)), 1)
        allowed, most = float(outs[count - 1]), self.length * sum(self.arm.lengths)
        self.held = self.state == State.FOLLOWING or (wanted > allowed + AT_GOAL)
        if self._out > allowed + AT_GOAL:
            return self._with_last(self._x, max(allowed, self._out - most))
        out = min(allowed, self._out + most)
        if hypot(*(self._goal - self._x)) <= AT_GOAL and out - self._out <= AT_GOAL:
            short = abs(out - self._outs[1]) > AT_GOAL
            self.state = State.UNREACHABLE if short else State.ARRIVED
        return self._with_last(x, out)
