"""Nuisance: synthetic causes are classified as what they are."""

import numpy as np
import pytest

from approach import ball_guard, gap_of, moving
from armguard.geometry import Pose
from armguard.guard import Cause, Level, Reason
from armguard.guard.levels import ORDERED
from armguard.guard.nuisance import Delayed, Lack, by_length, classify
from armguard.report.incidents import Sense, sense_of
from armguard.respond import Guard
from armguard.scene import Scene
from arms import simple_arm

# A channel open to the arm: its hull closes it, so the hull reaches into it [m].
DEPTH = 0.2


@pytest.fixture(scope="module")
def guard():
    return ball_guard()


def test_no_cause_is_reported_where_nothing_slows(guard):
    assert moving(guard, 0.5, 0.1).nuisance is None
    assert classify(Level.CAUTION, Reason.NEAR, None) is None


def test_a_stop_that_needs_its_distance_is_a_true_need(guard):
    verdict = moving(guard, gap_of(guard, 1.0, 0.020), 1.0)
    nuisance = verdict.nuisance
    assert verdict.level is Level.STOP
    assert nuisance.cause is Cause.TRUE_NEED
    assert nuisance.deficit == pytest.approx(0.020, abs=1e-6)
    assert nuisance.sentence.startswith("true need, lacks 20.0 mm: keep 20.0 mm more")


def test_a_stop_that_a_faster_reaction_would_save_is_latency(guard):
    verdict = moving(guard, gap_of(guard, 1.0, 0.002), 1.0)
    assert verdict.level is Level.STOP
    assert verdict.nuisance.cause is Cause.LATENCY
    assert "react " in verdict.nuisance.remedy


def test_a_stop_that_fresh_data_would_save_is_stale(guard):
    gap = gap_of(guard, 1.0, 0.004, age=0.020)
    verdict = moving(guard, gap, 1.0, age=0.020)
    assert verdict.level is Level.STOP
    assert verdict.nuisance.cause is Cause.STALE
    # The remedy suffices.
    time = float(verdict.nuisance.remedy.split()[-3]) * 1e-3
    assert verdict.nuisance.remedy.startswith("deliver measurements of 'arm' ")
    assert 0.0 < time < 0.017
    assert moving(guard, gap, 1.0, age=0.020 - time).level < Level.STOP


def test_the_same_deficit_with_data_in_time_is_not_stale(guard):
    verdict = moving(guard, gap_of(guard, 1.0, 0.004, age=0.003), 1.0, age=0.003)
    assert verdict.nuisance.cause is Cause.LATENCY


def test_a_slow_is_reported_too(guard):
    verdict = moving(guard, 0.2, 1.0)
    assert verdict.level is Level.SLOW
    assert verdict.nuisance.cause is Cause.TRUE_NEED
    lacks = verdict.nuisance.deficit
    assert moving(guard, 0.2 + 1.05 * lacks, 1.0).level < Level.SLOW
    assert moving(guard, 0.2 + 0.9 * lacks, 1.0).level is Level.SLOW


def test_input_that_cannot_be_believed_is_data(guard):
    guard.reset()
    verdict = guard.step([np.nan], 0.0)
    assert verdict.nuisance.cause is Cause.DATA
    assert verdict.nuisance.deficit is None


@pytest.mark.parametrize("reason", ORDERED)
def test_a_stop_that_was_ordered_is_no_bad_input(reason):
    nuisance = classify(Level.STOP, reason, None)
    assert nuisance.cause is Cause.ORDERED
    assert nuisance.sentence.startswith("ordered")
    assert sense_of(nuisance.cause, nuisance.deficit) is Sense.ORDERED


def test_a_late_cycle_is_no_bad_measurement():
    nuisance = classify(Level.STOP, Reason.CYCLE_LATE, None)
    assert "declared period" in nuisance.remedy


def test_a_measurement_beyond_its_age_is_stale(guard):
    guard.reset()
    verdict = guard.step([0.0], 0.0, velocity=[0.0], now=0.1)
    assert verdict.reason is Reason.STATE_STALE
    assert verdict.nuisance.cause is Cause.STALE


def test_an_arm_that_does_not_stop_as_declared_is_figures(guard):
    guard.reset()
    q, causes = -1.0, set()
    guard.step([q], 0.0, velocity=[0.0])
    for k in range(1, 400):
        q += 1e-3 * 1.0
        verdict = guard.step([q], k * 1e-3 if k != 5 else 0.0, velocity=[1.0])
        if verdict.level >= Level.BRAKE:
            causes.add(verdict.nuisance.cause)
    assert causes == {Cause.FIGURES}


def test_a_budget_that_is_used_up_is_the_guards_own_limit():
    lack = Lack(0.001, 1.0, ())
    assert classify(Level.STOP, Reason.BUDGET_SPENT, lack).cause is Cause.LIMITS
    assert classify(Level.STOP, Reason.CAPACITY, None).cause is Cause.LIMITS


@pytest.mark.parametrize("mode", ["fixed", "path"])
def test_a_hull_that_closes_a_channel_is_envelope(mode):
    scene = Scene(mode=mode)
    scene.add_robot(
        simple_arm(joints=1, length=1.0),
        name="arm",
        stopping={"deceleration": 4.0, "velocity": 2.0},
        home={"joint1": -1.0},
    )
    scene.add_mesh(
        channel(), name="channel", form="hull", pose=Pose(xyz=(0.7, 0.143, 0.2))
    )
    guard = Guard(scene)
    verdict = guard.step([0.0], 0.0, velocity=[0.0])
    assert verdict.nearest.primitive_distance > 0.0
    assert verdict.nearest.model_error == pytest.approx(DEPTH / 2, rel=0.6)
    assert verdict.level >= Level.STOP
    assert verdict.nuisance.cause is Cause.ENVELOPE
    assert "their surfaces may be" in verdict.nuisance.remedy


def channel():
    """Vertices and faces of a U of three walls, open towards -y [m]."""
    import trimesh

    walls = (
        ((0.02, DEPTH, 0.4), (-0.15, 0.0, 0.0)),
        ((0.02, DEPTH, 0.4), (0.15, 0.0, 0.0)),
        ((0.32, 0.02, 0.4), (0.0, DEPTH / 2, 0.0)),
    )
    meshes = []
    for extents, at in walls:
        mesh = trimesh.creation.box(extents)
        mesh.apply_translation(at)
        meshes.append(mesh)
    whole = trimesh.util.concatenate(meshes)
    return np.array(whole.vertices), np.array(whole.faces)


def test_the_cause_with_the_smallest_remedy_is_reported_first():
    late = Delayed("left", way=0.010, time=0.010, excess=0.004)
    early = Delayed("right", way=0.010, time=0.010, excess=0.0)
    causes = [
        by_length(Lack(deficit, 0.006, (late, early)))
        for deficit in (0.003, 0.005, 0.012, 0.030)
    ]
    assert [t.cause for t in causes] == [
        Cause.STALE,
        Cause.ENVELOPE,
        Cause.LATENCY,
        Cause.TRUE_NEED,
    ]
    assert causes[0].remedy == "deliver measurements of 'left' 3.0 ms sooner"
    assert causes[2].remedy == "react 6.0 ms faster: period, late, or delays"


def test_a_stop_under_way_is_reported_once():
    assert classify(Level.STOP, Reason.STOPPING, None) is None
    assert classify(Level.RECOVER, Reason.RESTING, None) is None
