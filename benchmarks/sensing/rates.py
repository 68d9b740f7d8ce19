"""Frames into a map of cells, beside OctoMap with the same points; processor time."""

from collections.abc import Callable
from importlib import import_module
from time import thread_time
from typing import Any

import numpy as np

import armguard as ag
from armguard.cells.arrival import FULL, raise_arrivals
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


def wrongly_free(image: DepthImage, cell: float) -> dict[str, int]:
    """Cells called free that hold a measured point, or a pixel that is not behind.

    The pixels of a cell are those of its corners and middles of edges and faces.
    """
    cells = ag.CellMap((0.0, 0.0, 0.0), cell)
    T = camera_pose(cell)
    cells.depth(image.depth, T, FOCAL, CENTRE, 0.0)
    free = cells.known_free()
    points = image.points(np.inf) + T[:3, 3]
    places = np.floor(points / cell + 128.0).astype(int)
    places = places[((places >= 0) & (places < 256)).all(axis=1)]
    measured = int(free[tuple(places.T)].sum())
    steps = np.stack(np.meshgrid(*((0.0, 0.5, 1.0),) * 3), axis=-1).reshape(-1, 3)
    corners, wrong = np.argwhere(free), 0
    for part in np.array_split(corners, max(len(corners) // 50_000, 1)):
        x, y, z = np.moveaxis(cell * (part[:, None] + steps - 128.0) - T[:3, 3], -1, 0)
        u = np.floor(FOCAL * x / z + CENTRE[0] + 0.5).astype(int)
        v = np.floor(FOCAL * y / z + CENTRE[1] + 0.5).astype(int)
        behind = image.depth[v, u] > z.max(axis=1)[:, None]
        wrong += int((~behind.all(axis=1)).sum())
    return {"free": len(corners), "measured": measured, "not_behind": wrong}


def own_links() -> dict[str, float]:
    """Time of the masks of 14 links of 60 mm with a shell of 20 mm."""
    rng = np.random.default_rng(4)
    cells = ag.CellMap((0.0, 0.0, 0.0), 0.01)
    link = ag.Capsule(start=(0, 0, -0.15), end=(0, 0, 0.15), radius=0.06)
    placed = [
        (link, ag.Pose(xyz=rng.uniform(-0.7, 0.7, 3), rpy=rng.uniform(-3, 3, 3)))
        for _ in range(14)
    ]
    time = milliseconds(lambda _: cells.own(placed, error=0.002, shell=0.02), 40)
    words = sum((a | b != 0).sum() for a, b in [cells.own_cells()])
    return {"ms": time, "words": int(words)}


def arrivals() -> float:
    """Time of the arrival times of a frame that sees all of 32³ blocks free [ms]."""
    cells = ag.CellMap((0.0, 0.0, 0.0), 0.01, intruder_speed=1.6)

    def call(k: int) -> None:
        cells._look.seen[:] = FULL
        raise_arrivals(0.1 * k, 0.05, cells._frame.lines, cells._evidence.lines)

    return milliseconds(call, FRAMES)


def measure(images: list[DepthImage]) -> dict[str, Any]:
    """Times of all images and cells, of zones, of masks and of arrival times."""
    rows = []
    for image in images:
        for cell in CELLS:
            row: dict[str, Any] = {"image": image.name, "recorded": image.recorded}
            row |= {"cell": cell, "points": len(image.points(REACH))}
            row |= own_frame(image, cell)
            row["wrong"] = wrongly_free(image, cell)
            row["octomap_ms"] = {s: peer_frame(image, cell, s) for s in PEER_SETTINGS}
            rows.append(row)
    return {"images": rows, **own_figures()}


def own_figures() -> dict[str, Any]:
    """Times of zones, of masks and of arrival times."""
    return {
        "zones": {str(reach): zone_rate(reach) for reach in (0.4, 1.0)},
        "own_links": own_links(),
        "arrivals_ms": arrivals(),
    }
