"""How far the points of each link can still go when all joints of a robot stop."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.bounds import row_bounds
from armguard.geometry.shapes import ShapeKind, shape_row
from armguard.robot.kinematics import PRISMATIC, REVOLUTE, KinematicTable
from armguard.robot.kinematics import kinematic_table as table_of
from armguard.robot.limits import joint_limits
from armguard.robot.model import FittedLink, RobotModel
from armguard.robot.stopping.distance import stop_travel
from armguard.robot.stopping.figures import StoppingFigures

Floats = NDArray[np.float64]

# Speeds from which stops are listed: those of ISO 10218-1, annex B, and one below.
SHARES = (0.10, 0.33, 0.66, 1.0)

CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))


@dataclass(frozen=True, slots=True)
class LinkStop:
    """Worst case of a link when every joint of its chain stops from a share of its top.

    Attributes:
        link: The link.
        share: Speed of the joints, as a share of their top speed [-].
        reaction: Way of its farthest point until the drives obey [m].
        braking: Way from then to rest [m].
        settle: Swing beyond that [m].
        time: Time until the last joint is still [s].
    """

    link: str
    share: float
    reaction: float
    braking: float
    settle: float
    time: float

    @property
    def distance(self) -> float:
        """The whole way [m]."""
        return self.reaction + self.braking + self.settle


def stop_distances(
    model: RobotModel,
    fits: Mapping[str, FittedLink],
    figures: StoppingFigures,
    *,
    period: float,
    late: float = 0.0,
    shares: Sequence[float] = SHARES,
) -> list[LinkStop]:
    """Worst-case stops of every link, at any pose within the limits.

    No point of a link moves farther than the sum, over the joints of its chain, of the
    joint's travel times its lever. This adds up joints that stretch the arm and turn it
    the same way, so it errs towards "farther"; what a single motion needs is less.

    Args:
        model: The robot.
        fits: Primitives of its links.
        figures: How it stops.
        period: Time from one cycle to the next [s].
        late: How much later a cycle may come [s].
        shares: Speeds of the joints, as shares of their top speed [-].

    Returns:
        A stop of each link that has primitives, from each speed.
    """
    reach = levers(model, fits)
    stops = []
    for share in shares:
        joints = [
            stop_travel(figures, k, share * float(top), period, late)
            for k, top in enumerate(figures.velocity)
        ]
        parts = np.array([(s.reaction, s.braking, s.settle) for s in joints])
        for link, row in reach.items():
            reaction, braking, settle = (row @ parts).tolist()
            moving = [s.time for s, lever in zip(joints, row, strict=True) if lever]
            time = max(moving, default=0.0)
            stops.append(LinkStop(link, share, reaction, braking, settle, time))
    return stops


def levers(model: RobotModel, fits: Mapping[str, FittedLink]) -> dict[str, Floats]:
    """Greatest way of a link's points for each unit a joint moves, at any pose.

    Of a joint that turns, the largest distance from its axis that a point of the link
    can have; of one that slides, 1; 0 of a joint that does not carry the link. Offsets
    along the chain are added up, so a lever is never too short.

    Args:
        model: The robot.
        fits: Primitives of its links.

    Returns:
        By link, one for each place of q, shape (n,) [m or -].
    """
    table = table_of(model)
    strokes = greatest_strokes(table, *joint_limits(model))
    found = {}
    for link, fit in fits.items():
        points, radii = spheres_around(fit, table.T_body_link[link])
        row = np.zeros(table.q_count)
        body = table.body_of_link[link]
        # Reach of the link's points from this body's origin, and from its axis.
        reach = float((np.linalg.norm(points, axis=1) + radii).max())
        across = float((aside(points, table.axis[body]) + radii).max())
        while body >= 0:
            q, kind = table.q_index[body], table.joint_kind[body]
            factor = abs(float(table.gain[body, 0]))
            if kind == REVOLUTE:
                row[q] += factor * across
            elif kind == PRISMATIC:
                row[q] += factor
            up = int(table.parent[body])
            if up >= 0:
                offset = table.T_parent_joint[body, [3, 7, 11]]
                beyond = float(strokes[body]) + reach
                across = float(aside(offset[None], table.axis[up])[0]) + beyond
                reach = float(np.linalg.norm(offset)) + beyond
            body = up
        found[link] = row
    return found


def greatest_strokes(table: KinematicTable, lower: Floats, upper: Floats) -> Floats:
    """How far each body slides along its joint at most, shape (b,) [m]."""
    strokes = np.zeros(len(table.parent))
    for body in np.flatnonzero(table.joint_kind == PRISMATIC):
        multiplier, constant = table.gain[body]
        q = table.q_index[body]
        ends = multiplier * np.array([lower[q], upper[q]]) + constant
        strokes[body] = float(np.abs(ends).max())
    return strokes


def aside(points: Floats, axis: Floats) -> Floats:
    """Distances of points from a line through the origin, shape (k,) [m]."""
    return np.asarray(np.linalg.norm(points - np.outer(points @ axis, axis), axis=1))


def spheres_around(fit: FittedLink, T_body_link: Floats) -> tuple[Floats, Floats]:
    """Centres and radii of spheres whose convex hull holds a link's primitives.

    Args:
        fit: The primitives.
        T_body_link: The link's frame in its body's, shape (4, 4).

    Returns:
        Centres in the body's frame, shape (k, 3) [m], and radii, shape (k,) [m].
    """
    centres, radii = [], []
    for placed in fit.shapes:
        row = shape_row(placed.shape, T_body_link @ placed.pose.matrix())
        kind, radius = placed.shape.kind, float(row[0])
        if kind == ShapeKind.SPHERE:
            points = row[None, 1:4]
        elif kind == ShapeKind.CAPSULE:
            points = row[1:7].reshape(2, 3)
        elif kind == ShapeKind.BOX:
            turn = row[7:16].reshape(3, 3)
            points = row[1:4] + (CORNERS * row[4:7]) @ turn.T
        else:
            box, radius = np.zeros(6), 0.0
            row_bounds(int(kind), row, 0.0, box)
            points = (box[:3] + box[3:] + CORNERS * (box[3:] - box[:3])) / 2.0
        centres.append(points)
        radii.append(np.full(len(points), radius))
    return np.concatenate(centres), np.concatenate(radii)
