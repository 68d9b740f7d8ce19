"""`bench sense`: whole frames in `Sense`, in processor time of its thread."""

from collections import defaultdict
from collections.abc import Iterator
from math import pi
from pathlib import Path
from tempfile import TemporaryDirectory
from time import thread_time
from typing import Any

import numpy as np

import armguard as ag
from armguard.sense.frames_file import JOINTS, Event, read_events
from armguard.simulation.sensed import drive, swing
from armguard.simulation.sensors import Rig
from timing import Progress, quiet

# Frames of the camera.
CYCLES = 30

# Edge of the cells of each run [m]. The cube has 256 of them along an edge.
CELLS = (0.02, 0.01)

# Time from frame to frame of all sensors [s].
PERIOD = 1.0 / 15.0

# Links with a ring of eight zone sensors each, and boxes that no scene knows.
RINGED, BOXES = ("panda_link3", "panda_link5", "panda_link6"), 12

# The first frames load kernels, and every space is new to them.
LEFT_OUT = 10


def bench(cycles: int, progress: Progress) -> dict[str, Any]:
    """Times of frames of a camera and of 24 zone sensors, and their share of a core."""
    found: dict[str, Any] = {"frames": cycles}
    for cell in CELLS:
        progress(f"measuring frames at cells of {1e3 * cell:g} mm")
        scene = ringed_arm(cell)
        with TemporaryDirectory() as folder:
            path = Path(folder) / "frames.bin"
            simulate(scene, (cycles + LEFT_OUT) * PERIOD, path)
            found[f"{1e3 * cell:g} mm"] = timed(scene, read_events(path))
    return found


def ringed_arm(cell: float) -> ag.Scene:
    """A Panda at a table with 24 zone sensors, below a depth camera of VGA size.

    Args:
        cell: Edge of the cells [m].
    """
    scene = ag.Scene(mode="path")
    scene.add_robot("panda", "arm")
    scene.add(
        ag.Box(size=(2.5, 2.5, 0.04)), "table", pose=ag.Pose(xyz=(0.0, 0.0, -0.02))
    )
    scene.set_sensing(
        region={"centre": (0, 0, 0.5), "size": 256}, cell=cell, unknown="moving",
        intruder={"speed": 0.5, "size": 0.05},
    )  # fmt: skip
    for link in RINGED:
        scene.add_sensor(
            link, kind="vl53l8cx", on=f"arm/{link}", period=PERIOD,
            ring={"count": 8, "radius": 0.12, "height": -0.1},
        )  # fmt: skip
    scene.add_sensor(
        "camera", kind="depth", size=(640, 480), focal=525, period=PERIOD,
        pose=ag.Pose(xyz=(0.3, 0.0, 1.75), rpy=(pi, 0.0, 0.0)),
    )  # fmt: skip
    return scene


def simulate(scene: ag.Scene, seconds: float, path: Path) -> None:
    """Write the frames of a motion among boxes to a file.

    Args:
        scene: The scene.
        seconds: Length of the motion [s].
        path: The file.
    """
    rng = np.random.default_rng(0)
    rig = Rig(scene, boxes=rng.uniform(0.04, 0.15, (BOXES, 3)).tolist())
    rig.invalid = 0.1
    for k in range(BOXES):
        place = (*rng.uniform((-0.3, -0.7), (0.9, 0.7)), rng.uniform(0.03, 0.4))
        rig.place(k, ag.Pose(xyz=place, rpy=rng.uniform(-1.0, 1.0, 3).tolist()))
    with path.open("wb") as file:
        drive(ag.Sense(scene, record=file), rig, swing(scene), seconds)


def timed(scene: ag.Scene, events: Iterator[Event]) -> dict[str, Any]:
    """Times of the calls of `Sense` that take events.

    Args:
        scene: The scene.
        events: Joint positions and frames.
    """
    sense, start = ag.Sense(scene), LEFT_OUT * PERIOD
    taken: dict[str, list[float]] = defaultdict(list)
    last = start
    with quiet():
        for event in events:
            begin = thread_time()
            sense.play([event])
            spent = thread_time() - begin
            if event.stamp < start:
                continue
            last = max(last, event.stamp)
            camera = "camera" if event.name == "camera" else "zones"
            taken["joints" if event.event == JOINTS else camera].append(spent)
    return {
        **{name: milliseconds(times) for name, times in taken.items()},
        "occupied_cells": int(sense.cells.occupied().sum()),
        "share_of_a_core": sum(map(sum, taken.values())) / (last - start),
    }


def milliseconds(times: list[float]) -> dict[str, float]:
    """Median, mean and longest of some times, and how many there are [ms]."""
    found = 1e3 * np.array(times)
    middle, mean, most = np.median(found), found.mean(), found.max()
    return {
        "count": len(found),
        "median_ms": float(middle),
        "mean_ms": float(mean),
        "max_ms": float(most),
    }
