"""Frames into a map of cells, beside OctoMap with the same points; processor time."""

from collections.abc import Callable
from importlib import import_module
from time import thread_time
from typing import Any

import numpy as np

import armguard as ag
from arrays import Floats
from sensing.images import CENTRE, FOCAL, DepthImage

# Edges of the cells [m]. The cube has 256 of them along an edge.
CELLS = (0.02, 0.01)

# Depth up to which space is freed, and points are given to OctoMap [m].
REACH = 2.0

FRAMES, PEER_FRAMES, ZONE_FRAMES = 40, 4, 400

# Settings of `insertPointCloud`; the fastest one leaves the inner nodes for later.
PEER_SETTINGS: dict[str, dict[str, bool]] = {
    "as it comes": {},
    "discretized": {"discretize": True},
    "discretized, lazy": {"discretize": True, "lazy_eval": True},
}

PEER_MISSING = "octomap-python is not installed; pip install 'armguard[bench]'"

# An 8 × 8 sensor as the VL53L8CX: angle of view [rad], and distances [m].
VIEW, ZONE_RANGE = np.deg2rad(45.0), (0.3, 0.4)


def camera_pose(cell: float) -> Floats:
    """Pose of a camera at the middle of a face of the cube about the origin."""
    T = np.eye(4)
    T[2, 3] = -128.0 * cell + 0.01
    return T


def milliseconds(call: Callable[[int], object], count: int) -> float:
    """Median processor time of a call [ms]; the first calls are left out."""
    call(0)
    call(1)
    times = []
    for k in range(count):
        begin = thread_time()
        call(k + 2)
        times.append(1e3 * (thread_time() - begin))
    return float(np.median(times))


def own_frame(image: DepthImage, cell: float) -> dict[str, float]:
    """Time of a depth image with all its pixels, and counts of cells."""
    cells = ag.CellMap((0.0, 0.0, 0.0), cell)
    T = camera_pose(cell)

    def call(k: int) -> None:
        cells.depth(image.depth, T, FOCAL, CENTRE, 0.1 * k, reach=REACH)

    time = milliseconds(call, FRAMES)
    return {
        "ms": time,
        "megapixels_per_s": image.depth.size / time / 1e3,
        "occupied": int(cells.occupied().sum()),
        "free": int(cells.known_free().sum()),
    }


def peer_frame(image: DepthImage, cell: float, setting: str) -> float | None:
    """Time of OctoMap with the points of an image [ms]; None if it is missing."""
    try:
        octomap: Any = import_module("octomap")
    except ImportError:
        return None
    T = camera_pose(cell)
    points = image.points(REACH) + T[:3, 3]
    tree = octomap.OcTree(cell)
    options = PEER_SETTINGS[setting]

    def call(_k: int) -> None:
        tree.insertPointCloud(points, T[:3, 3].copy(), **options)
        if "lazy_eval" in options:
            tree.updateInnerOccupancy()

    return milliseconds(call, PEER_FRAMES)


def zone_rate(farthest: float) -> dict[str, float]:
    """Zones of 8 × 8 frames at random poses that a second of processor time takes.

    Args:
        farthest: Greatest distance of the zones [m]; the least is 3/4 of it.
    """
    rng = np.random.default_rng(1)
    cells = ag.CellMap((0.0, 0.0, 0.0), 0.01)
    frames = rng.uniform(0.75 * farthest, farthest, (ZONE_FRAMES, 8, 8))
    poses = [
        ag.Pose(xyz=rng.uniform(-0.6, 0.6, 3), rpy=rng.uniform(-3.1, 3.1, 3)).matrix()
        for _ in frames
    ]

    def call(k: int) -> None:
        cells.zones(frames[k % ZONE_FRAMES], poses[k % ZONE_FRAMES], VIEW, 0.1 * k)

    time = milliseconds(call, ZONE_FRAMES)
    return {"ms": time, "zones_per_s": 64e3 / time}


def measure(images: list[DepthImage]) -> dict[str, Any]:
    """Times of all images and cells, and of zones."""
    rows = []
    for image in images:
        for cell in CELLS:
            row: dict[str, Any] = {"image": image.name, "recorded": image.recorded}
            row |= {"cell": cell, "points": len(image.points(REACH))}
            row |= own_frame(image, cell)
            row["octomap_ms"] = {s: peer_frame(image, cell, s) for s in PEER_SETTINGS}
            rows.append(row)
    zones = {str(reach): zone_rate(reach) for reach in (0.4, 1.0)}
    return {"images": rows, "zones": zones}
