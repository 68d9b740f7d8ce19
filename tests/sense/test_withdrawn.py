"""A sensor at fault, or silent: the space that it alone has freed is forgotten."""

import numpy as np
import pytest

import armguard as ag
from armguard.geometry.pairs import measure
from armguard.geometry.shapes.kind import ShapeKind
from armguard.guard import Level, Reason
from armguard.sense.health import Fault
from armguard.simulation.sensed import drive, sensed_bay
from armguard.simulation.sensors import Rig

SECONDS = 0.5


def two_cameras(unknown):
    """A bay with a camera above each arm; each sees half of the region."""
    reason = "a test" if unknown == "free" else None
    scene = sensed_bay(zones=False, camera=False, unknown=unknown, reason=reason)
    for name, y in (("near", -0.9), ("far", 0.9)):
        scene.add_sensor(
            name, kind="depth", size=(80, 60), focal=120, range=(0.3, 3.0),
            pose=ag.Pose(xyz=(-0.4, y, 2.3), rpy=(np.pi, 0, 0)),
        )  # fmt: skip
    return scene


def halves(free):
    """Known free cells on each side of the plane between the cameras."""
    size = free.shape[1] // 2
    return int(free[:, : size - 4].sum()), int(free[:, size + 4 :].sum())


@pytest.mark.parametrize("fault", ["silent", "repeated"])
def test_what_a_sensor_alone_has_freed_is_unknown_until_it_is_well(fault):
    scene = two_cameras("still")
    guard = ag.Guard(scene, self_test=False)
    sense, rig = ag.Sense(scene, guard), Rig(scene)
    fails, last = False, {}
    found = []

    def tamper(name, measured, distance, status, stamp):
        if name != "near" or not fails:
            last[name] = distance
            return distance, status, stamp
        return None if fault == "silent" else (last[name], status, stamp)

    def drive_to(start, end):
        drive(
            sense, rig, lambda t: scene.home, end - start, start=start,
            tamper=tamper,
        )  # fmt: skip
        while guard._sensed.view.known_free().sum() != sense.cells.known_free().sum():
            sense.joints(scene.home, sense._history.newest + 0.004)
        found.append(halves(guard._sensed.view.known_free()))
        return guard.step(scene.home, end, velocity=np.zeros(len(scene.home)))

    drive_to(0.0, SECONDS)
    fails = True
    verdict = drive_to(SECONDS, 3 * SECONDS)
    name = Fault.SILENT if fault == "silent" else Fault.REPEATED
    assert name in sense.health["near"].faults
    assert verdict.reason is not Reason.CELLS_STALE
    fails = False
    drive_to(3 * SECONDS, 3 * SECONDS + 1.4)
    (near, far), (near_lost, far_kept), (near_again, _) = found
    assert near > 10_000 < far
    assert near_lost < 0.02 * near
    assert far_kept > 0.98 * far
    assert near_again > 0.98 * near


def test_where_unknown_space_is_free_a_silent_sensor_makes_all_cells_old():
    scene = two_cameras("free")
    guard = ag.Guard(scene, self_test=False)
    sense, rig = ag.Sense(scene, guard), Rig(scene)
    still = np.zeros(len(scene.home))

    def verdict(start, end, lost=()):
        drive(
            sense, rig, lambda t: scene.home, end - start, start=start,
            tamper=lambda name, _, *frame: None if name in lost else frame,
        )  # fmt: skip
        return guard.step(scene.home, end, velocity=still)

    assert verdict(0.0, SECONDS).level < Level.STOP
    assert verdict(SECONDS, SECONDS + 1.2, lost=("near",)).reason is Reason.CELLS_STALE


def test_space_about_the_arms_may_be_known_free_at_the_start():
    clear = 0.15
    scene = sensed_bay(zones=False)
    region = {"centre": (-0.4, 0, 1.1), "size": 128}
    scene.set_sensing(
        region=region, cell=0.025, unknown="still",
        intruder={"speed": 1.6, "size": 0.05},
        start={"clear": clear, "reason": "a person looked"},
    )  # fmt: skip
    guard = ag.Guard(scene, self_test=False)
    sense = ag.Sense(scene, guard)
    sense.joints(scene.home, 0.0)
    guard.step(scene.home, 0.0, velocity=np.zeros(len(scene.home)))
    free = sense.cells.known_free()
    beside = np.zeros_like(free)
    beside[1:] = free[:-1] & ~free[1:]
    inner, outer = (ways_to_links(guard, sense.cells, grid) for grid in (free, beside))
    # All cells that are wholly within the distance, and no others.
    assert clear - 0.03 < inner.max() <= clear
    assert outer.min() > clear - 0.5 * np.sqrt(3) * 0.025 - 0.012


def ways_to_links(guard, cells, grid):
    """Distances of some cells to the nearest link."""
    middles = cells.middles(np.argwhere(grid))
    assert len(middles) > 1000
    world, ball, out = guard._workspace.world, np.zeros(16), np.zeros(10)
    found = []
    for point in np.random.default_rng(1).choice(middles, 1000, replace=False):
        ball[1:4] = point
        ways = []
        for i in range(guard.tables.moving_count):
            kind = int(world.kinds[i])
            measure(int(ShapeKind.SPHERE), ball, kind, world.rows[i], out)
            ways.append(out[0])
        found.append(min(ways))
    return np.array(found)
