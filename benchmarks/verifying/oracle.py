"""What Coal measures along a tube, at positions that SciPy computes."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
from scipy.interpolate import BPoly

from armguard.prove.tube import Tube
from armguard.scene import SceneTables
from arrays import Floats
from peers.pinocchio_coal import AllDistances, BroadPhase

# A pair is near its buffer if it has no more than this beyond it [m].
MARGIN = 0.001


class Oracle:
    """Distances of pairs of links by Coal on Pinocchio's kinematics.

    Attributes:
        tables: The scene; its links have no exact shapes.
        peer: Pinocchio and Coal.
        pairs: Names of all checked pairs of links.

    Args:
        tables: The scene.
    """

    def __init__(self, tables: SceneTables) -> None:
        self.tables = tables
        self.peer = AllDistances(tables)
        for request in self.peer.results.distanceRequests:
            request.gjk_tolerance = request.epa_tolerance = 1e-12
            request.gjk_max_iterations = request.epa_max_iterations = 1000
        self._names = list(tables.body_names)
        self._ends = [
            tuple(sorted((self._names[pair.first], self._names[pair.second])))
            for pair in self.peer.geometry.collisionPairs
        ]
        self.pairs = sorted(set(self._ends))
        self._column = np.array([self.pairs.index(ends) for ends in self._ends])
        margin = float(tables.buffers.max()) + MARGIN
        near = self._near = BroadPhase(replace(tables, margin=margin))
        # It stops at the first pair.
        near.callback = pin.CollisionCallBackDefault(near.geometry, near.results, True)

    def near_distances(self, rows: Floats) -> Floats:
        """As `distances`; infinite in rows where no pair is near its buffer."""
        near = [bool(self._near.step(q)) for q in self.peer.positions(rows)]
        found = np.full((len(rows), len(self.pairs)), np.inf)
        found[near] = self.distances(rows[near])
        return found

    def distances(self, rows: Floats) -> Floats:
        """Of each pair of links in each row, shape (k, pairs)."""
        found = np.full((len(rows), len(self.pairs)), np.inf)
        for k, q in enumerate(self.peer.positions(rows)):
            self.peer.step(q)
            every = [r.min_distance for r in self.peer.results.distanceResults]
            np.minimum.at(found[k], self._column, every)
        return found

    def distance(self, rows: Floats, a: str, b: str) -> Floats:
        """Of one pair of links in each row, shape (k,)."""
        peer, found = self.peer, np.full(len(rows), np.inf)
        chosen = [
            i for i, ends in enumerate(self._ends) if ends == tuple(sorted((a, b)))
        ]
        for k, q in enumerate(peer.positions(rows)):
            pin.forwardKinematics(peer.model, peer.data, q)
            pin.updateGeometryPlacements(
                peer.model, peer.data, peer.geometry, peer.results
            )
            found[k] = min(
                pin.computeDistance(peer.geometry, peer.results, i).min_distance
                for i in chosen
            )
        return found

    def buffer(self, a: str, b: str) -> float:
        """What a pair has to keep [m]."""
        group = self.tables.groups
        i, j = self._names.index(a), self._names.index(b)
        return float(self.tables.buffers[group[i], group[j]])


def positions(tube: Tube, times: Floats) -> Floats:
    """Joint positions on the curves, by SciPy."""
    # SciPy's control points are for shares of the segment too.
    curves = BPoly(np.moveaxis(tube.control, 0, 1), tube.times)
    return np.asarray(curves(times))
