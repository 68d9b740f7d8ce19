"""Zones of sensors that no posture of the arm trips, proven over all joint positions.

The space in which a zone trips is a frustum: from the least distance that the sensor
measures to the threshold, grown by the declared error. It rides on a link as any other
shape does, so the search for pairs of links decides whether another link can be in it.
Zones are proven together first, and apart where that fails.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from math import cos, tan
from time import monotonic
from typing import Literal, NamedTuple

from armguard.geometry.shapes import Hull, PlacedShape
from armguard.prove.pair_proof import Budget
from armguard.prove.pair_tables import SideShapes, pair_tables
from armguard.prove.search import PairSearch
from armguard.robot.kinematics import kinematic_table
from armguard.scene.robots import SceneRobot
from armguard.scene.sensors import SceneSensor

# Share of the time that is left for one search of several zones, and of one zone [-].
OF_MANY, OF_ONE = 0.02, 0.05

# Shortest time for a search [s].
SHORTEST = 0.05

# Why a zone is masked: a posture is known that trips it, or the time was over.
Why = Literal["trips", "open"]


class Masked(NamedTuple):
    """Why a zone is masked.

    Attributes:
        link: The link that may be in it.
        why: Whether a posture is known, or it is not decided.
        posture: Joint positions in which the link is in it; empty if none is known
            [rad or m].
    """

    link: str
    why: Why
    posture: Mapping[str, float]


class Block(NamedTuple):
    """Zones of some rows and columns, the ends left out."""

    row: int
    rows: int
    column: int
    columns: int

    def halves(self) -> "tuple[Block, Block]":
        """Two halves of it, divided along its longer side."""
        if self.rows - self.row > self.columns - self.column:
            middle = (self.row + self.rows) // 2
            return self._replace(rows=middle), self._replace(row=middle)
        middle = (self.column + self.columns) // 2
        return self._replace(columns=middle), self._replace(column=middle)

    @property
    def size(self) -> int:
        """How many zones it has."""
        return (self.rows - self.row) * (self.columns - self.column)


@dataclass(frozen=True, slots=True, kw_only=True)
class ZoneProofs:
    """What is proven of the zones of a sensor.

    Attributes:
        sensor: Name of the sensor.
        count: How many zones it has.
        masked: By zone, row after row, why it is masked; no posture of the arm within
            its joint limits trips any other one.
        searches: Pairs of zones and links that were searched.
        seconds: Time it took [s].
    """

    sensor: str
    count: int
    masked: Mapping[int, Masked]
    searches: int
    seconds: float


def prove_zones(
    robot: SceneRobot,
    sensor: SceneSensor,
    distance: float,
    *,
    budget: Budget | None = None,
    decided: Callable[[int], None] = lambda _: None,
) -> ZoneProofs:
    """Prove which zones of a sensor its own robot never trips.

    Args:
        robot: The robot that carries it.
        sensor: The sensor.
        distance: Threshold of its zones [m].
        budget: What it may cost.
        decided: Called with the count of zones that were decided since the last call.
    """
    search = ZoneSearch(robot, sensor, distance, budget or Budget())
    columns, rows = sensor.zones
    start, count = monotonic(), columns * rows
    links = [link for link in robot.fits if robot.fits[link].shapes]
    waiting = [(Block(0, rows, 0, columns), links)]
    masked: dict[int, Masked] = {}
    while waiting:
        block, links = waiting.pop()
        left = {link: why for link in links if (why := search.trips(block, link))}
        if left and block.size > 1:
            waiting += [(half, list(left)) for half in block.halves()]
            continue
        decided(block.size)
        if left:
            # A posture says more than an open search.
            first = min(left.values(), key=lambda one: one.why == "open")
            masked[block.row * columns + block.column] = first
    return ZoneProofs(
        sensor=sensor.name,
        count=count,
        masked=dict(sorted(masked.items())),
        searches=search.count,
        seconds=monotonic() - start,
    )


class ZoneSearch:
    """Searches whether a link can be in zones, within one budget.

    Attributes:
        count: Searches so far.

    Args:
        robot: The robot that carries the sensor.
        sensor: The sensor.
        distance: Threshold of its zones [m].
        budget: What all searches may cost together.
    """

    def __init__(
        self, robot: SceneRobot, sensor: SceneSensor, distance: float, budget: Budget
    ) -> None:
        self._robot, self._sensor, self._distance = robot, sensor, distance
        self._budget, self._table = budget, kinematic_table(robot.model)
        self._end, self.count = monotonic() + budget.seconds, 0
        assert sensor.on is not None
        self._carrier = sensor.on.split("/", 1)[1]

    def trips(self, block: Block, link: str) -> Masked | None:
        """Why a link may be in one of some zones; None if it never is."""
        left = self._end - monotonic()
        if left <= 0.0:
            return Masked(link, "open", {})
        zones = zone_hull(self._sensor, self._distance, block)
        sides = (
            SideShapes(self._carrier, ((zones,),)),
            SideShapes.of(self._robot.fits[link]),
        )
        search = PairSearch(pair_tables(self._robot.model, self._table, *sides))
        if not self.count:
            # The first one may have had to compile what all of them use.
            self._end, left = monotonic() + self._budget.seconds, self._budget.seconds
        self.count += 1
        share = OF_ONE if block.size == 1 else OF_MANY
        if search.verdict == "open":
            search.run(max(share * left, SHORTEST), self._budget.boxes)
        if search.verdict == "never":
            return None
        proof = search.proof(self._carrier, link)
        touching = proof.touching
        return Masked(link, "trips" if touching is not None else "open", touching or {})


def zone_hull(sensor: SceneSensor, distance: float, block: Block) -> PlacedShape:
    """Space in which an object may trip one of some zones, in the link's frame.

    A sensor may measure along its axis or along the ray: the frustum holds both, since
    a point is no nearer along the ray than along the axis.

    Args:
        sensor: The sensor.
        distance: Threshold of the zones [m].
        block: The zones.
    """
    (columns, rows), (across, along) = sensor.zones, sensor.view
    least = sensor.range[0] * cos(across / 2.0) * cos(along / 2.0)
    points = [
        (depth * x, depth * y, depth)
        for depth in (max(least - sensor.error, 0.0), distance + sensor.error)
        for x in ends(block.column, block.columns, columns, across)
        for y in ends(block.row, block.rows, rows, along)
    ]
    return PlacedShape(Hull(points=points, rounding=sensor.error), sensor.pose)


def ends(first: int, last: int, count: int, view: float) -> Iterator[float]:
    """Slopes of both sides of some zones of a view."""
    for k in (first, last):
        yield tan(view * (k / count - 0.5))
