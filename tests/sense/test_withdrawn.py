"""A sensor at fault, or silent: the space that it alone has freed is forgotten."""

import numpy as np
import pytest

import armguard as ag
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
            sense, rig, scene, lambda t: scene.home, end - start, start=start,
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
            sense, rig, scene, lambda t: scene.home, end - start, start=start,
            tamper=lambda name, _, *frame: None if name in lost else frame,
        )  # fmt: skip
        return guard.step(scene.home, end, velocity=still)

    assert verdict(0.0, SECONDS).level < Level.STOP
    assert verdict(SECONDS, SECONDS + 1.2, lost=("near",)).reason is Reason.CELLS_STALE
