"""Clusters: sensed bodies that move, for the evasion of approaching obstacles."""

from typing import Any

import numpy as np

from armguard.cells.state import Triple
from armguard.errors import CellMapError
from armguard.record import Records, dtype_of, record
from armguard.table import LongVector

# Clusters that a guard takes at most.
MOST_CLUSTERS = 8

# Time after its newest measurement up to which a cluster counts, and time for which its
# velocity is known to hold before that [s].
CONFIRMED, FOLLOWED = 0.25, 0.4


@record
class Cluster:
    """Cells that belong to one moving body, as a box that keeps its velocity.

    Attributes:
        low: Lower corner of the box at `stamp`, world [m].
        high: Upper corner [m].
        velocity: Velocity, world [m/s].
        radius: Radius of a ball around the middle of the box that holds the body too, 0
            for none [m].
        error: How far off the velocity may be [m/s].
        stamp: Time of the newest measurement [s].
        number: Number of the body, the same in all frames.
    """

    low: Triple
    high: Triple
    velocity: Triple
    radius: float
    error: float
    stamp: float
    number: int


class ClusterTable:
    """The clusters of a guard.

    Args:
        rows: The clusters for kernels; a row without velocity is none. No row if the
            scene has no sensed space.
        evaded: Bit set of the robots that evade each of them.
    """

    def __init__(self, rows: Records[Cluster], evaded: LongVector) -> None:
        self._rows, self._evaded = rows, evaded

    def update_clusters(self, clusters: Records[Cluster]) -> None:
        """Replace the clusters of moving cells that robots evade.

        A robot with `response: {evade: true}` evades a cluster as it evades an object
        with a measured velocity. While it does, cells that were where the cluster was
        count as moving with it. To other robots, and once no frame has confirmed the
        cluster for 0.25 s, they are obstacles as all other cells.

        Args:
            clusters: Result of `Sense.clusters`, at most 8; none to end all.

        Raises:
            CellMapError: The scene has no `sensing`, or these are no clusters, or too
                many. Nothing has changed.

        Example:
            >>> import armguard as ag
            >>> from armguard.guard.clusters import Cluster
            >>> from armguard.record import records
            >>> scene = ag.bay_scene("path")
            >>> scene.set_sensing(
            ...     region={"centre": (1.4, 0, 1.0)}, cell=0.04, unknown="free",
            ...     reason="a closed cell", intruder={"speed": 1.6, "size": 0.05},
            ... )
            >>> guard, found = ag.Guard(scene), records(1, Cluster)
            >>> found["low"], found["high"] = (0.5, 0.0, 1.0), (0.6, 0.1, 1.1)
            >>> found["velocity"] = (-0.3, 0.0, 0.0)
            >>> guard.update_clusters(found)
        """
        if len(self._rows) == 0:
            raise CellMapError("the scene has no `sensing`; declare its region first")
        check_clusters(clusters)
        numbers: Any = self._rows["number"]
        evaded = dict(zip(numbers.tolist(), self._evaded.tolist(), strict=True))
        self._rows.fill(0.0)
        self._rows[: len(clusters)] = clusters
        self._evaded[:] = 0
        for k, number in enumerate(clusters["number"].tolist()):
            self._evaded[k] = evaded.get(number, 0)


def check_clusters(clusters: Records[Cluster]) -> None:
    """Refuse clusters that cannot be.

    Args:
        clusters: The clusters.

    Raises:
        CellMapError: They are none, or too many, or a number is impossible.
    """
    found: Any = clusters
    if getattr(found, "dtype", None) != dtype_of(Cluster) or found.ndim != 1:
        raise CellMapError("these are no clusters; give the result of `Sense.clusters`")
    if len(found) > MOST_CLUSTERS:
        raise CellMapError(
            f"there are {len(found)} clusters; give at most {MOST_CLUSTERS}"
        )
    for k, one in enumerate(found):
        numbers = np.concatenate([*(one[name].ravel() for name in one.dtype.names)])
        if not (
            np.isfinite(numbers).all()
            and (one["low"] <= one["high"]).all()
            and min(one["error"], one["radius"]) >= 0.0
        ):
            raise CellMapError(
                f"cluster {k} is {one}; its numbers must be finite, its lower corner "
                "below its upper one, its error and radius at least 0"
            )
