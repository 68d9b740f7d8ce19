"""Evasion of clusters of sensed cells, which move with them meanwhile."""

import numpy as np
import pytest

from approach import FIGURES, PERIOD
from armguard.errors import CellMapError
from armguard.guard.clusters import CONFIRMED, FOLLOWED, MOST_CLUSTERS, Cluster
from armguard.guard.evaded_cells import has_enclosed
from armguard.guard.proofs import rests_among_cells
from armguard.guard.sensed import CellBox
from armguard.guard.watch import RECOVERING
from armguard.guard.workspace import Settings
from armguard.kernel import kernel
from armguard.record import records
from armguard.recording import open_recording
from armguard.recording.calls import UpdateCells, UpdateClusters
from armguard.recording.recorded import RecordedGuard
from armguard.recording.recorder import Recorder, RecorderSettings
from armguard.recording.replay import replay
from armguard.recording.ring import RingReader, RingWriter
from armguard.respond import Action, Blocked, Guard
from armguard.scene import Scene
from armguard.scene.settings import ResponseSettings
from arms import simple_arm
from records import record
from sensed import CELL, CENTRE, LOW, SIZE, changes, feed, grid

ARM, HALF, SPEED = 0.04, 0.1, 0.3

# Time between frames, and their age when they come [s].
FRAMES, LATE = 0.05, 0.1


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
    for error, evades in ((0.0, False), (0.1, False), (0.3, True)):
        _, blocked, _ = drive(
            Guard(scene_of(), self_test=False), 0.2,
            make=lambda time, e=error: coming(time, along, begin, e),
        )  # fmt: skip
        assert (Blocked.EVADING in blocked) == evades


def test_a_ball_within_a_box_passes_nearer():
    # Past the tip of the arm, a corner of the box first: 17 mm off it, the ball 58 mm.
    begin, diagonal = np.array((1.14, 0.14, 0.2)), np.array((1.0, -1.0, 0.0))
    velocity = SPEED * diagonal / np.sqrt(2.0)
    for radius, evades in ((0.0, True), (HALF, False)):

        def passing(time, radius=radius):
            found = coming(time, velocity, begin - 0.5 * velocity)
            found["radius"] = radius
            return found

        _, blocked, _ = drive(Guard(scene_of(), self_test=False), 0.3, make=passing)
        assert (Blocked.EVADING in blocked) == evades


def body(time, begin=(0.7, 0.6, 0.2), half=HALF):
    """Cells of the box that comes, and of nothing else."""
    found = grid()
    middle = np.array(begin) + time * np.array((0.0, -SPEED, 0.0))
    low = np.round((middle - half - LOW) / CELL).astype(int)
    high = np.round((middle + half - LOW) / CELL).astype(int)
    found[tuple(map(slice, low, high))] = True
    return found


def drive_among_cells(cells, clusters, seconds=1.6, speed=1.6):
    """Have moving cells and clusters come, seen twenty times a second, 0.1 s late.

    Args:
        cells: The cells, from the time.
        clusters: The clusters, likewise.
        seconds: How long [s].
        speed: Declared speed of an intruder [m/s].

    Returns:
        Positions of the arm, whether it was stopped, in each cycle, and whether it
        evaded.
    """
    guard = Guard(scene_of(speed=speed), self_test=False)
    q, v, rows, stopped, evaded = 0.0, 0.0, [], [], False
    before = grid()
    for k in range(int(seconds / PERIOD)):
        time, seen = k * PERIOD, k * PERIOD - LATE
        if k % round(FRAMES / PERIOD) == 0:
            now = cells(seen)
            touched = changes(now | before, grid(), seen)["bits"][:, 0] != 0
            guard.update_cells(changes(now, grid(), seen, motion=1)[touched], seen)
            before, found = now, clusters(seen)
            if found is not None:
                guard.update_clusters(found)
        command = guard.filter([q], [0.0], time, velocity=[v], now=time)
        v = command.velocity[0]
        q += v * PERIOD
        rows.append(q)
        stopped.append(command.actions["arm"] >= Action.STOP)
        evaded |= command.blocked["arm"] is Blocked.EVADING
    return np.array(rows), stopped, evaded


def test_cells_move_with_a_cluster_that_is_evaded():
    rows, stopped, evaded = drive_among_cells(body, coming)
    gaps = [
        gap(q, np.array([0.7, 0.6 - SPEED * k * PERIOD])) for k, q in enumerate(rows)
    ]
    assert evaded
    assert min(gaps) > 0.0
    assert rows[-1] < -0.2
    assert not any(stopped)


def test_an_evasion_begins_where_half_spaces_stand_for_many_cells():
    """Before it, the cells demand a stop in the same cycle."""
    begin, half, appears = np.array((0.7, 0.4, 0.2)), 0.15, 0.1
    every_other = np.indices((SIZE,) * 3).sum(axis=0) % 2 == 0

    def cells(seen):
        there = seen > appears - 1e-9
        return body(seen - appears, begin, half) & every_other if there else grid()

    def clusters(seen):
        found = coming(seen - appears, begin=begin)
        found["low"], found["high"] = found.low + HALF - half, found.high - HALF + half
        found["stamp"] = seen
        return found if seen > appears - 1e-9 else None

    rows, stopped, evaded = drive_among_cells(cells, clusters, 0.5)
    assert evaded
    assert rows[-1] < -0.1
    assert not any(stopped)
    # Without the cluster they do, at once.
    _, stopped, _ = drive_among_cells(cells, lambda seen: None, 0.5)
    assert stopped.index(True) <= (appears + LATE + FRAMES) / PERIOD


def test_cells_beside_an_evaded_cluster_remain_obstacles():
    """The arm does not evade into cells of another body."""
    wall = grid()
    # From 0.15 m below the arm on, where it would go.
    wall[:, : round((-0.15 - LOW[1]) / CELL)] = True
    for speed in (0.0, 0.3):
        rows, _, evaded = drive_among_cells(
            lambda seen: body(seen) | wall, coming, 1.2, speed
        )
        assert evaded
        # The tip of the arm is 0.04 m thick and keeps 5 mm.
        assert np.sin(min(rows)) - ARM > -0.15 + 0.005


def test_cells_of_a_cluster_that_no_frame_confirms_grow_again():
    _, stopped, evaded = drive_among_cells(
        body, lambda seen: coming(seen) if 0.59 < seen < 0.61 else None
    )
    assert evaded
    # The body would be where the arm was at 1.5 s.
    assert 0.6 + CONFIRMED < PERIOD * stopped.index(True) < 1.2


def test_cells_grow_for_a_robot_that_does_not_evade_their_cluster():
    # It goes past the tip, 0.15 m away.
    def beside(time):
        return coming(time, begin=(1.35, 0.3, 0.2))

    _, stopped, evaded = drive_among_cells(
        lambda seen: body(seen, (1.35, 0.3, 0.2)), beside, 0.6
    )
    assert not evaded
    assert any(stopped)


def enclosed(cluster, box, now, room):
    """Whether a box was in that of a cluster, by places every millisecond."""
    later = now - cluster["stamp"]
    grown = room + box["error"] + cluster["error"] * later
    times = np.arange(cluster["stamp"] - FOLLOWED, now + 1e-9, 1e-3)
    way = (times[:, None] - cluster["stamp"]) * cluster["velocity"]
    low, high = cluster["low"] + way - grown, cluster["high"] + way + grown
    return bool(((box["low"] >= low) & (box["high"] <= high)).all(axis=1).any())


@kernel(entry=True)
def has_enclosed_in(cluster, ahead, room, box):
    return has_enclosed(cluster, ahead, room, box)


def test_a_box_is_of_a_cluster_that_has_enclosed_it():
    rng = np.random.default_rng(3)
    both = [0, 0]
    for _ in range(4000):
        cluster, box = records(1, Cluster)[0], records(1, CellBox)[0]
        now, room = 1.0, 0.025
        cluster["stamp"], box["stamp"] = rng.uniform(0.8, 1.0), rng.uniform(0.2, 1.0)
        cluster["velocity"] = rng.uniform(-1.0, 1.0, 3) * rng.integers(0, 2, 3)
        cluster["error"], box["error"] = rng.uniform(0.0, 0.1), rng.uniform(0.0, 0.01)
        cluster["low"], cluster["high"] = -0.1, 0.1
        when = rng.uniform(0.3, 1.05) - cluster["stamp"]
        middle = when * cluster["velocity"] + rng.uniform(-0.13, 0.13, 3)
        box["low"], box["high"] = middle - 0.0125, middle + 0.0125
        found = has_enclosed_in(cluster, now - cluster["stamp"], room, box)
        # A sample may miss by what a body moves in a millisecond.
        known = enclosed(cluster, box, now, room)
        near = enclosed(cluster, box, now, room + 1e-3)
        assert known <= found <= near
        both[found] += 1
    assert min(both) > 500


@kernel(entry=True)
def rests_among(w):
    return rests_among_cells(0, 2, 0, w)


@pytest.mark.parametrize(
    ("change", "rests"),
    [
        ({}, True), ({"phase": 1}, False), ({"evaded": 2}, False),
        ({"reach": 1e-3}, False), ({"speed": 0.0}, False), ({"modelled": 3}, False),
    ],
)  # fmt: skip
def test_a_link_that_rests_among_cells_does_not_end_an_evasion(change, rests):
    numbers = {
        "phase": RECOVERING, "evaded": 1, "reach": 0.0, "speed": 1.0, "modelled": 1,
    } | change  # fmt: skip
    settings = records(1, Settings)[0]
    settings.modelled = numbers["modelled"]
    w = record(
        settings=settings,
        motion=record(reach=np.full((2, 1), numbers["reach"])),
        watch=record(
            robot_of=np.zeros(1, dtype=np.int32),
            phase=np.array([numbers["phase"]]),
            cluster_evaded=np.array([0, numbers["evaded"]]),
            top_speed=np.full(3, numbers["speed"]),
        ),
    )
    assert rests_among(w) == rests


def test_the_mark_of_an_evaded_cluster_follows_its_number():
    guard = Guard(scene_of(), self_test=False)
    both = np.concatenate([coming(0.0), coming(0.0, begin=(0.7, 0.9, 0.2))])
    both["number"] = 7, 9
    guard.update_clusters(both.view(np.recarray))
    guard._watch.cluster_evaded[:2] = 1, 0
    guard.update_clusters(both[::-1].copy().view(np.recarray))
    assert guard._watch.cluster_evaded.tolist() == [0, 1] + [0] * 6
    both["number"] = 8, 9
    guard.update_clusters(both.view(np.recarray))
    assert not guard._watch.cluster_evaded.any()


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
