"""Distances of capsules to occupied cells, beside FCL's octree; processor time."""

from time import thread_time
from typing import Any

import fcl
import numpy as np
from scipy.spatial.transform import Rotation

import armguard as ag
from arrays import Floats
from sensing.images import CENTRE, FOCAL, DepthImage
from sensing.octomap_files import body_of
from sensing.rates import camera_pose

CELL, LIMITS = 0.01, (0.1, 0.15, 0.3)

# A forearm.
CAPSULE = ag.Capsule(start=(0, 0, -0.15), end=(0, 0, 0.15), radius=0.06)

PATHS, STEPS, CHECKED, PEER_QUERIES = 200, 100, 1000, 200

# A capsule moves by this between two queries of a path [m, rad].
STEP, TURN = 0.002, 0.01

# How far the middle of a path is from an occupied cell, at most [m].
SPREAD = 0.25


def filled(images: list[DepthImage]) -> ag.CellMap:
    """A map with images from six sides, of which nothing is freed again."""
    cells = ag.CellMap((0.0, 0.0, 0.0), CELL)
    for k in range(6):
        T = np.eye(4)
        angle = 2.0 * np.pi * k / 6
        T[:3, :3] = Rotation.from_euler("y", angle).as_matrix()
        T[:3, 3] = T[:3, :3] @ camera_pose(CELL)[:3, 3]
        image = images[k % len(images)]
        cells.depth(image.depth, T, FOCAL, CENTRE, float(k), reach=1e-3)
    return cells


def paths(cells: ag.CellMap) -> Floats:
    """Poses along smooth motions near occupied cells, shape (PATHS · STEPS, 4, 4)."""
    rng = np.random.default_rng(2)
    occupied = np.argwhere(cells.occupied())
    poses = np.tile(np.eye(4), (PATHS, STEPS, 1, 1))
    for path in poses:
        near = cells.middles(occupied[[rng.integers(len(occupied))]])[0]
        begin = near + rng.uniform(-SPREAD, SPREAD, 3)
        way, axis = rng.normal(size=(2, 3))
        way, axis = way / np.linalg.norm(way), axis / np.linalg.norm(axis)
        first = Rotation.random(random_state=rng)
        for k, T in enumerate(path):
            T[:3, :3] = (Rotation.from_rotvec(TURN * k * axis) * first).as_matrix()
            T[:3, 3] = begin + STEP * k * way
    return poses.reshape(-1, 4, 4)


def rate(cells: ag.CellMap, poses: Floats, limit: float) -> dict[str, float]:
    """Queries in a second of processor time, and cells measured for one."""
    cells.distances(CAPSULE, poses[:100], limit)
    times, found = [], None
    for _ in range(5):
        begin = thread_time()
        found = cells.distances(CAPSULE, poses, limit)
        times.append(thread_time() - begin)
    assert found is not None
    return {
        "per_s": len(poses) / float(np.median(times)),
        "microseconds": 1e6 * float(np.median(times)) / len(poses),
        "within_limit": float(np.isfinite(found.distance).mean()),
        "most_measured": int(found.measured.max()),
        "mean_measured": float(found.measured.mean()),
    }


def segment_gaps(start: Floats, way: Floats, lows: Floats) -> Floats:
    """Distance of a segment to each of some cells [m], by bisection of its slope."""
    t0, t1 = np.zeros(len(lows)), np.ones(len(lows))

    def apart(t: Floats) -> Floats:
        point = start + t[:, None] * way
        return point - np.clip(point, lows, lows + CELL)

    for _ in range(60):
        t = 0.5 * (t0 + t1)
        rises = apart(t) @ way > 0.0
        t0, t1 = np.where(rises, t0, t), np.where(rises, t, t1)
    ends = [apart(t) for t in (0.0 * t0, 0.0 * t0 + 1.0, t0, t1)]
    return np.min([np.linalg.norm(a, axis=1) for a in ends], axis=0)


def against_all(cells: ag.CellMap, poses: Floats) -> dict[str, float]:
    """Greatest difference from the least distance of all cells, each by itself [m]."""
    lows = cells.middles(np.argwhere(cells.occupied())) - 0.5 * CELL
    found = cells.distances(CAPSULE, poses, 1.0).distance + CAPSULE.radius
    worst = 0.0
    for T, mine in zip(poses, found, strict=True):
        start, end = np.array([CAPSULE.start, CAPSULE.end]) @ T[:3, :3].T + T[:3, 3]
        way = end - start
        apart = lows + 0.5 * CELL - start
        along = np.clip(apart @ way / (way @ way), 0.0, 1.0)
        middles = np.linalg.norm(apart - along[:, None] * way, axis=1)
        # A cell is nearer than its middle by half its diagonal at most.
        near = lows[middles - CELL < middles.min() + CELL]
        worst = max(worst, abs(segment_gaps(start, way, near).min() - mine))
    return {"queries": len(poses), "greatest_difference": worst}


def beside_fcl(cells: ag.CellMap, poses: Floats) -> dict[str, float]:
    """Time of a query of FCL's octree, and how far its distances are from ours."""
    still = fcl.CollisionObject(fcl.OcTree(CELL, body_of(cells.occupied())))
    length = 2.0 * CAPSULE.end[2]
    times, differences = [], []
    own = cells.distances(CAPSULE, poses, 1.0).distance
    for T, mine in zip(poses, own, strict=True):
        if mine <= 0.0:
            continue
        moved = fcl.CollisionObject(
            fcl.Capsule(CAPSULE.radius, length),
            fcl.Transform(T[:3, :3].copy(), T[:3, 3].copy()),
        )
        begin = thread_time()
        theirs = fcl.distance(moved, still, fcl.DistanceRequest(), fcl.DistanceResult())
        times.append(thread_time() - begin)
        differences.append(abs(theirs - mine))
    return {
        "queries": len(times),
        "microseconds": 1e6 * float(np.median(times)),
        "greatest_difference": max(differences),
    }


def measure(images: list[DepthImage]) -> dict[str, Any]:
    """Rates at all limits, along paths and in random order, and of FCL."""
    cells = filled(images)
    along = paths(cells)
    mixed = np.random.default_rng(3).permutation(along)
    return {
        "occupied": int(cells.occupied().sum()),
        "words": int((cells.claims.occupied.words != 0).sum()),
        "queries": len(along),
        "along": {str(limit): rate(cells, along, limit) for limit in LIMITS},
        "mixed": {str(limit): rate(cells, mixed, limit) for limit in LIMITS},
        "brute_force": against_all(cells, mixed[:CHECKED]),
        "fcl": beside_fcl(cells, mixed[:PEER_QUERIES]),
    }
