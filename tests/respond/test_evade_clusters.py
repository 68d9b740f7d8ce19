"""Getting out of the way of clusters of sensed cells, which remain obstacles."""

import numpy as np
import pytest

from approach import FIGURES, PERIOD
from armguard.errors import CellMapError
from armguard.guard.clusters import MOST_CLUSTERS, Cluster
from armguard.record import records
from armguard.recording import open_recording
from armguard.recording.calls import UpdateCells, UpdateClusters
from armguard.recording.recorded import RecordedGuard
from armguard.recording.recorder import Recorder, RecorderSettings
from armguard.recording.replay import replay
from armguard.recording.ring import RingReader, RingWriter
from armguard.respond import Blocked, Guard
from armguard.scene import Scene
from armguard.scene.settings import ResponseSettings
from arms import simple_arm
from sensed import CELL, CENTRE, LOW, SIZE, changes, feed, grid

ARM, HALF, SPEED = 0.04, 0.1, 0.3


def scene_of(evade=True, speed=0.4):
    """An arm of a metre along x, 0.2 m up, in space that sensors see."""
    scene = Scene(mode="path")
    scene.set_sensing(
        region={"centre": CENTRE, "size": SIZE}, cell=CELL, unknown="free",
        reason="a test", intruder={"speed": speed, "size": 0.05},
    )  # fmt: skip
    scene.add_robot(
        simple_arm(joints=1, length=1.0),
        name="arm",
        stopping=FIGURES,
        response=ResponseSettings(evade=evade),
        home={"joint1": 0.0},
    )
    return scene


def coming(time, velocity=(0.0, -SPEED, 0.0), begin=(0.7, 0.6, 0.2), error=0.0):
    """A box that comes at the arm, as a cluster."""
    found = records(1, Cluster)
    middle = np.array(begin) + time * np.array(velocity)
    found["low"], found["high"] = middle - HALF, middle + HALF
    found["velocity"], found["stamp"], found["error"] = velocity, time, error
    return found


def gap(q, centre):
    """True distance of the arm and a ball in the box, by hand [m]."""
    tip = np.array([np.cos(q), np.sin(q)])
    along = np.clip(centre @ tip, 0.1, 1.0)
    return float(np.linalg.norm(centre - along * tip)) - ARM - HALF


def drive(guard, seconds=2.0, make=coming, clusters=None, cells=None):
    """Have a cluster come; positions, reasons, and least gap to the box's ball."""
    q, v = 0.0, 0.0
    rows, blocked, gaps = [], [], []
    for k in range(int(seconds / PERIOD)):
        time = k * PERIOD
        found = changes(grid(), grid(), time)[:0] if cells is None else cells(time)
        feed(guard, found, time)
        guard.update_cells(found[:0], time)
        guard.update_clusters(make(time) if clusters is None else clusters)
        command = guard.filter([q], [0.0], time, velocity=[v], now=time)
        v = command.velocity[0]
        q += v * PERIOD
        rows.append(q)
        blocked.append(command.blocked["arm"])
        gaps.append(gap(q, np.array([0.7, 0.6 - SPEED * time])))
    return np.array(rows), blocked, min(gaps)


def test_an_arm_gets_out_of_the_way_of_a_cluster():
    rows, blocked, least = drive(Guard(scene_of(), self_test=False))
    assert Blocked.EVADING in blocked
    assert rows[-1] < -0.05
    assert least > 0.0


@pytest.mark.parametrize(
    ("evade", "velocity"),
    [(False, (0.0, -SPEED, 0.0)), (True, (0.0, SPEED, 0.0)), (True, (0.0, 0.0, 0.0))],
)
def test_no_evasion_of_what_does_not_come_or_where_it_is_off(evade, velocity):
    guard = Guard(scene_of(evade), self_test=False)
    rows, blocked, _ = drive(guard, make=lambda time: coming(time, velocity))
    assert Blocked.EVADING not in blocked
    assert np.abs(rows).max() < 1e-6


def test_it_begins_before_the_time_at_which_objects_are_evaded():
    # It comes 1.9 s from now; an object is evaded 1 s before.
    slow = scene_of()
    _, blocked, _ = drive(
        Guard(slow, self_test=False), 0.3,
        make=lambda time: coming(time, begin=(0.7, 0.7, 0.2)),
    )  # fmt: skip
    assert Blocked.EVADING in blocked


def test_an_uncertain_velocity_keeps_a_robot_farther_away():
    # It misses by 90 mm if its velocity is right.
    begin = (0.7, 0.23, 0.2)
    along = (-SPEED, 0.0, 0.0)
    for error, evades in ((0.0, False), (0.1, True)):
        _, blocked, _ = drive(
            Guard(scene_of(), self_test=False), 0.2,
            make=lambda time, e=error: coming(time, along, begin, e),
        )  # fmt: skip
        assert (Blocked.EVADING in blocked) == evades


def test_cells_of_a_cluster_remain_obstacles():
    """A cluster that says nothing is behind the arm does not let it go there."""
    wall = grid()
    # From 0.1 m below the arm on, where the arm would go.
    wall[:, : round((-0.1 - LOW[1]) / CELL)] = True

    def cells(time):
        return changes(wall, grid(), time, motion=1)

    guard = Guard(scene_of(speed=0.0), self_test=False)
    seen = []
    for k in range(int(1.9 / PERIOD)):
        time = k * PERIOD
        if k % 20 == 0:
            feed(guard, cells(time), time)
        guard.update_cells(cells(time)[:0], time)
        both = np.concatenate([coming(time), coming(time, begin=(0.7, 0.0, 0.2))])
        both[1]["low"], both[1]["high"] = (-2, -2, -2), (2, -0.1, 2)
        guard.update_clusters(both.view(np.recarray))
        q = seen[-1] if seen else 0.0
        command = guard.filter([q], [0.0], time, velocity=[0.0], now=time)
        seen.append(q + command.velocity[0] * PERIOD)
        assert not guard._watch.evaded.any()
    # The tip of the arm is 0.04 m thick and keeps 5 mm.
    assert np.sin(min(seen)) - ARM > -0.1 + 0.005


def test_clusters_are_checked():
    guard = Guard(scene_of(), self_test=False)
    bad = coming(0.0)
    bad["velocity"] = np.nan
    turned = coming(0.0)
    turned["low"] += 1.0
    unsure = coming(0.0)
    unsure["error"] = -1.0
    for wrong, says in (
        (bad, "finite"), (turned, "corner"), (unsure, "error"),
        (records(MOST_CLUSTERS + 1, Cluster), "at most 8"),
        (np.zeros(3), "no clusters"), (None, "no clusters"),
    ):  # fmt: skip
        with pytest.raises(CellMapError, match=says):
            guard.update_clusters(wrong)
    assert not guard._watch.clusters["velocity"].any()
    scene = Scene(mode="path")
    scene.add_robot(simple_arm(joints=1), name="arm", stopping=FIGURES)
    with pytest.raises(CellMapError, match="no `sensing`"):
        Guard(scene, self_test=False).update_clusters(coming(0.0))


def test_no_clusters_end_the_last_ones():
    guard = Guard(scene_of(), self_test=False)
    drive(guard, 0.3)
    assert guard._watch.clusters["velocity"].any()
    guard.update_clusters(records(0, Cluster))
    assert not guard._watch.clusters["velocity"].any()


def test_clusters_are_recorded_and_judged_again_to_the_bit(tmp_path):
    scene = scene_of()
    guard = Guard(scene, self_test=False)
    ring, at = RingWriter(tmp_path / "ring", 32 << 20), [0.0]
    tape = RecordedGuard(guard, ring, monotonic=lambda: at[0], wall=lambda: at[0])
    tape.describe(scene, {})
    tape.checkpoint()
    q = v = np.zeros(1)
    evaded, cycles = False, 300
    for k in range(cycles):
        at[0] = time = k * PERIOD
        tape.do(UpdateCells(deltas=changes(grid(), grid(), time)[:0], stamp=time))
        if k % 8 == 0:
            tape.do(UpdateClusters(clusters=coming(time)))
        if k % 100 == 99:
            tape.checkpoint()
        command = tape.filter(q, [0.0], time, velocity=v)
        evaded |= command.blocked["arm"] is Blocked.EVADING
        v = command.velocity
        q = q + PERIOD * v
    recorder = Recorder(tmp_path / "tapes", RecorderSettings())
    for row in RingReader(tmp_path / "ring").unread():
        recorder.take(row)
    recorder.end()
    assert evaded
    found = replay(open_recording(tmp_path / "tapes"))
    assert found.sentence == f"{cycles} cycles, bit-identical"
    # From a checkpoint in the middle, which holds the clusters.
    part = replay(open_recording(tmp_path / "tapes"), start=150 * PERIOD)
    assert part.identical
    assert part.cycles >= 150
