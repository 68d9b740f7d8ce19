"""Tubes for tests, and what Coal on Pinocchio's kinematics measures along them."""

import numpy as np
import pinocchio as pin
from scipy.interpolate import BPoly

import armguard as ag
from armguard.prove.tube import Tube
from arms import simple_arm
from peers.pinocchio_coal import AllDistances


class Oracle:
    """Distances of pairs of links by Coal, at positions that SciPy computes."""

    def __init__(self, checker):
        self.tables = checker.tables
        self.peer = AllDistances(checker.tables)
        for request in self.peer.results.distanceRequests:
            request.gjk_tolerance = request.epa_tolerance = 1e-12
            request.gjk_max_iterations = request.epa_max_iterations = 1000
        self.names = self.tables.body_names
        self.ends = [
            tuple(sorted((self.names[pair.first], self.names[pair.second])))
            for pair in self.peer.geometry.collisionPairs
        ]
        self.pairs = sorted(set(self.ends))
        self.column = np.array([self.pairs.index(ends) for ends in self.ends])

    def distances(self, rows):
        """Of each pair of links in each row, shape (k, pairs)."""
        found = np.full((len(rows), len(self.pairs)), np.inf)
        for k, q in enumerate(self.peer.positions(rows)):
            self.peer.step(q)
            every = [r.min_distance for r in self.peer.results.distanceResults]
            np.minimum.at(found[k], self.column, every)
        return found

    def distance(self, rows, a, b):
        """Of one pair of links in each row, shape (k,)."""
        peer, found = self.peer, np.full(len(rows), np.inf)
        chosen = [
            i for i, ends in enumerate(self.ends) if ends == tuple(sorted((a, b)))
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

    def buffer(self, a, b):
        """What a pair has to keep [m]."""
        group = self.tables.groups
        return self.tables.buffers[
            group[self.names.index(a)], group[self.names.index(b)]
        ]


def positions(tube, times):
    """Joint positions on the curves, by SciPy."""
    # SciPy's control points are for shares of the segment too.
    return BPoly(np.moveaxis(tube.control, 0, 1), tube.times)(times)


def arm_among_objects(buffer=0.01):
    """Two arms of capsules beside each other, with a wall, a ball and a wire."""
    scene = ag.Scene(mode="fixed", buffer=buffer)
    scene.add_robot(simple_arm(), name="left")
    scene.add_robot(simple_arm(), name="right", base=ag.Pose(xyz=(0.9, 0, 0.02)))
    rod = ag.Capsule(start=(0, 0, -1), end=(0, 0, 1), radius=0.001)
    for name, shape, place in (
        ("wall", ag.Box(size=(4.0, 0.2, 2.0)), (0, 0.75, 0.5)),
        ("ball", ag.Sphere(radius=0.1), (0.4, -0.5, 0.4)),
        ("wire", rod, (0.5, 0.4, 0)),
    ):
        scene.add(shape, name=name, pose=ag.Pose(xyz=place))
    return scene


def random_tube(joints, degree, segments, seed, size=0.8):
    """Continuous curves of some degree through random control points."""
    rng = np.random.default_rng(seed)
    knots = rng.uniform(-size, size, (segments + 1, 1, joints))
    share = np.linspace(0.0, 1.0, degree + 1)[None, :, None]
    control = knots[:-1] + share * (knots[1:] - knots[:-1])
    control[:, 1:-1] += rng.uniform(-0.3, 0.3, control[:, 1:-1].shape)
    times = np.concatenate(([0.0], np.cumsum(rng.uniform(0.2, 0.6, segments))))
    return Tube(times, np.ascontiguousarray(control), np.zeros((segments, joints)))
