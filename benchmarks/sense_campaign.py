"""Sensors in a simulated bay: what gets into the map, and how soon it goes.

make sense-campaign                               as published, some minutes
make sense-campaign ARGS="--minutes 1 --boxes 10"

Links and modelled objects: minutes of motion without foreign bodies, with and without
errors of mounting and of stamps. Boxes: one at a random place and attitude before a
sensor, and then none. Blindfolds: one of two cameras fails for three seconds. Writes
docs/sense.json and the tables of docs/sense.md.
"""

import argparse
import json
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

import armguard as ag
import blindfold
from armguard.sense.history import JointHistory
from armguard.sense.prediction import mount_of
from armguard.sense.ranging import nearest
from armguard.sense.world import Placed, World
from armguard.simulation.sensed import drive, off_mounts, sensed_bay, swing
from armguard.simulation.sensors import Rig
from pages import DOCS

Floats = NDArray[np.float64]

BEGIN, END = "<!-- campaign -->\n", "<!-- end of campaign -->"

# Edge of a foreign box [m], share of invalid distances [-], and time for a box to be
# seen and to be cleared [s].
EDGE, INVALID, SEEN, CLEARED = 0.05, 0.1, 0.4, 1.2


def motion(minutes: float, way: float, late: float) -> dict[str, Any]:
    """Minutes of motion of both arms without a foreign body.

    Args:
        minutes: How many.
        way: Error of all mountings [m].
        late: Error of all stamps [s].
    """
    scene = sensed_bay(error=0.01, jitter=0.005)
    sense, rig = ag.Sense(scene), Rig(scene)
    rig.invalid = 0.25
    off_mounts(scene, rig, way)
    counts = {"frames": 0, "frames_with_cells": 0, "frames_with_faults": 0}

    def each(t: float, name: str) -> None:
        counts["frames"] += 1
        counts["frames_with_cells"] += bool(sense.cells.claims.occupied.words.any())
        counts["frames_with_faults"] += any(one.faults for one in sense.health.values())

    drive(sense, rig, swing(scene, 1.0), 60.0 * minutes, each=each, late=late)
    return {"minutes": minutes, "way": way, "late": late, **counts}


def at_home(scene: ag.Scene) -> tuple[World, Placed]:
    """The scene with its robots at rest at home."""
    world = World(scene)
    history = JointHistory(*world.joint_figures())
    for stamp in (0.0, 0.1):
        history.add(scene.home, stamp)
    placed = world.at(history, 0.05, 0.0)
    assert placed is not None
    return world, placed


def place_before(scene: ag.Scene, name: str, rng: np.random.Generator) -> Floats:
    """A place in the inner half of the view of a sensor at home, within its reach."""
    world, placed = at_home(scene)
    sensor = scene.sensors[name]
    mount = mount_of(sensor, world, placed)
    low, high = (0.8, 1.2) if sensor.image else (0.18, 0.32)
    slopes = rng.uniform(-0.5, 0.5, 2) * np.tan(np.array(sensor.view) / 2.0)
    ray = np.array([*slopes, 1.0])
    found: Floats = mount.origin + mount.R @ (rng.uniform(low, high) * ray)
    return found


def box(name: str, seed: int) -> dict[str, Any] | None:
    """A box that comes before a sensor and goes; None if it would touch the scene."""
    camera, rng = name == "top", np.random.default_rng(seed)
    scene = sensed_bay(zones=not camera, camera=camera)
    where = place_before(scene, name, rng)
    if touches(scene, where):
        return None
    sense, rig = ag.Sense(scene), Rig(scene, boxes=[(EDGE,) * 3], seed=seed)
    rig.invalid = INVALID
    counts: list[tuple[float, str, int]] = []

    def each(t: float, sender: str) -> None:
        counts.append((t, sender, int(sense.cells.occupied().sum())))

    def steps(start: float, seconds: float) -> None:
        counts.clear()
        sway: Callable[[float], Floats] = lambda t: (  # noqa: E731
            scene.home + 0.03 * np.sin(t + np.arange(len(scene.home)))
        )
        drive(sense, rig, sway, seconds, start=start, each=each)

    steps(0.0, 0.6)
    before = max(count for _, _, count in counts)
    rig.place(0, ag.Pose(xyz=where.tolist(), rpy=rng.uniform(-1.5, 1.5, 3).tolist()))
    steps(0.6, SEEN)
    own = [count for _, sender, count in counts if sender == name]
    # The first of these may have been measured before the box was there.
    frames = next((k for k, count in enumerate(own[1:], 1) if count), None)
    rig.place(0, None)
    steps(0.6 + SEEN, CLEARED)
    gone = [t for t, _, count in counts if not count]
    return {
        "sensor": name,
        "before": before,
        "frames": frames,
        "cleared": gone[0] - 0.6 - SEEN if gone else None,
    }


def touches(scene: ag.Scene, where: Floats) -> bool:
    """Whether a box at a place would be nearer than 80 mm to a link or an object."""
    scene.add(ag.Sphere(radius=EDGE), "ball", pose=ag.Pose(xyz=where.tolist()))
    world, placed = at_home(scene)
    others = world.object_names != "ball"
    out = np.zeros((1, 4))
    nearest(
        where[None], world.kinds[others], placed.rows[others], placed.balls[others],
        1.0, out,
    )  # fmt: skip
    scene.remove("ball")
    return bool(out[0, 0] < EDGE + 0.08)


def table(found: dict[str, Any]) -> str:
    """The table of the page."""
    rows = ["| motion without foreign bodies | frames | with cells | with faults |"]
    rows += ["| --- | --- | --- | --- |"]
    rows += [
        f"| {one['minutes']:g} min, mountings {one['way'] * 1e3:g} mm and stamps "
        f"{one['late'] * 1e3:g} ms off | {one['frames']} "
        f"| {one['frames_with_cells']} | {one['frames_with_faults']} |"
        for one in found["motions"]
    ]
    rows += [
        "",
        "| boxes of 50 mm before | boxes | in the first frame | in the second ",
    ]
    rows[-1] += "| later or never | cleared in 1 s | longest [s] |"
    rows += ["| --- | --- | --- | --- | --- | --- | --- |"]
    for kind, camera in (("zones", False), ("camera", True)):
        some = [one for one in found["boxes"] if (one["sensor"] == "top") == camera]
        seen = [one["frames"] for one in some]
        gone = [one["cleared"] for one in some]
        known = [one for one in gone if one is not None]
        rows.append(
            f"| {kind} | {len(some)} | {seen.count(1)} | {seen.count(2)} | "
            f"{sum(k is None or k > 2 for k in seen)} | {sum(t <= 1 for t in known)} | "
            f"{max(known, default=np.nan):.2f}{' or more' * (None in gone)} |"
        )
    return "\n".join((*rows, "", blindfold.table(found["blindfolds"])))


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=3.0)
    parser.add_argument("--boxes", type=int, default=100)
    parser.add_argument("--blindfolds", type=int, default=10)
    given = parser.parse_args()
    motions = [motion(given.minutes, *errors) for errors in ((0, 0), (0.01, 0.005))]
    names = list(sensed_bay().sensors)
    boxes: list[dict[str, Any]] = []
    seed = 0
    while len(boxes) < given.boxes:
        # Every second one is before the camera.
        name = "top" if seed % 2 else names[seed // 2 % (len(names) - 1)]
        one = box(name, seed)
        boxes += [one] if one is not None else []
        seed += 1
    blindfolds = blindfold.measure(given.blindfolds)
    found = {"motions": motions, "boxes": boxes, "blindfolds": blindfolds}
    (DOCS / "sense.json").write_text(json.dumps(found, indent=1) + "\n", "utf-8")
    page = DOCS / "sense.md"
    text = page.read_text("utf-8")
    head, rest = text.split(BEGIN)
    page.write_text(head + BEGIN + table(found) + END + rest.split(END)[1], "utf-8")
    print(table(found))


if __name__ == "__main__":
    main()
