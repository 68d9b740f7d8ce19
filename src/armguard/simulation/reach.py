"""Where the tools of a scene can get to, and the objects there."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.bounds import row_bounds
from armguard.respond.tool import tool_of
from armguard.scene.poses import body_poses
from armguard.scene.tables import RobotPart, SceneTables

Floats = NDArray[np.float64]

# Configurations an arm knows.
KNOWN = 400

# They lie within this share of each joint's range about home, and this far from its
# limits [rad or m].
SPAN = 0.35
ROOM = 0.1

# A place is within reach if a known configuration brings the tool this near to it [m];
# a tool is about as long.
NEAR = 0.25


class Reach:
    """Configurations of one arm, and where each brings its tool.

    Attributes:
        q: Configurations, shape (k, j) [rad or m].
        points: Where the tool's origin is then, shape (k, 3) [m].

    Args:
        tables: The scene.
        part: The robot.
        rng: Draws the configurations.
    """

    def __init__(
        self, tables: SceneTables, part: RobotPart, rng: np.random.Generator
    ) -> None:
        own = slice(part.first_joint, part.first_joint + part.joint_count)
        lower, upper = tables.lower[own], tables.upper[own]
        room = np.minimum(ROOM, 0.1 * (upper - lower))
        away = SPAN * (upper - lower) * rng.uniform(-1.0, 1.0, (KNOWN, len(lower)))
        self.q = np.clip(tables.home[own] + away, lower + room, upper - room)
        tool = tool_of(tables, part.name)
        configuration = tables.home.copy()
        self.points = np.zeros((KNOWN, 3))
        for row, point in zip(self.q, self.points, strict=True):
            configuration[own] = row
            point[:] = tool.point(body_poses(tables, configuration))

    def distances(self, point: Floats) -> Floats:
        """How far each known configuration's tool is from a point, shape (k,) [m]."""
        away: Floats = np.linalg.norm(self.points - point, axis=1)
        return away

    def nearest(self, point: Floats) -> Floats:
        """The known configuration that brings the tool nearest to a point, (j,)."""
        found: Floats = self.q[int(self.distances(point).argmin())]
        return found


def places_in_reach(tables: SceneTables, reach: Reach) -> Sequence[Floats]:
    """Points on stationary objects of a scene that a tool may run into, each (3,) [m].

    Of each primitive the point of its box that is nearest to the middle of where the
    tool gets to.
    """
    middle = reach.points.mean(axis=0)
    box = np.zeros(6)
    found = []
    for i in range(tables.moving_count, len(tables.kinds)):
        row_bounds(int(tables.kinds[i]), tables.local_rows[i], 0.0, box)
        point = np.clip(middle, box[:3], box[3:])
        if reach.distances(point).min() < NEAR:
            found.append(point)
    return found


def meeting_points(reaches: Sequence[Reach]) -> Floats:
    """Points that the tools of several arms can get to, shape (k, 3) [m]."""
    one = reaches[0]
    apart = [
        min(reach.distances(point).min() for reach in reaches[1:])
        if len(reaches) > 1
        else np.inf
        for point in one.points
    ]
    points: Floats = one.points[np.array(apart) < NEAR]
    return points
