"""Mistakes in Python: the answer has the value, the place and the remedy."""

import logging

import numpy as np
import pytest

from armguard import ArmguardError, Guard, Pose, Scene, Sphere
from arms import TURN_AND_LIFT
from mistakes.calls import CALLS
from mistakes.cycles import CYCLES, driven


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the arm's file."""
    path = tmp_path_factory.mktemp("calls")
    (path / "r.urdf").write_text(TURN_AND_LIFT)
    return path


def answer(call, caplog):
    """What a call returns, raises and logs, as one text."""
    with caplog.at_level(logging.WARNING, logger="armguard"):
        try:
            said = call()
        except ArmguardError as error:
            said = error
    return f"{said} {caplog.text}"


@pytest.mark.parametrize("kind", CALLS)
def test_a_call_of_python_is_refused(folder, caplog, kind):
    mistake = CALLS[kind]
    said = answer(lambda: mistake.given(Scene(), folder / "r.urdf"), caplog)
    assert not mistake.missing(said), said
    assert bool(caplog.records) is mistake.logged


@pytest.fixture
def guard(folder):
    """A guard of two arms that turn and lift, and a ball."""
    scene = Scene(period=0.02)
    home = {"turn": 0.5, "lift": 0.1}
    for name, x in (("a", 0), ("b", 3)):
        base, stopping = Pose(xyz=(x, 0, 0)), {"deceleration": 1.0}
        scene.add_robot(
            folder / "r.urdf", name, base=base, stopping=stopping, home=home
        )
    scene.add(Sphere(radius=0.1), "ball", pose=Pose(xyz=(9, 0, 0)))
    return Guard(scene, self_test=False)


@pytest.mark.parametrize("kind", CYCLES)
def test_a_cycle_names_the_mistake_once(guard, caplog, kind):
    mistake = CYCLES[kind]
    said = answer(lambda: mistake.given(guard), caplog)
    assert not mistake.missing(said), said
    assert len(caplog.records) == mistake.logged


def test_measured_millimetres_that_fit_no_joint_get_no_hint(guard):
    said = guard.step([0.5, 1e5, 0.5, 0.1], 0.0, velocity=np.zeros(4)).why
    assert said.endswith("check units and order")


@pytest.mark.parametrize(
    ("motion", "form"),
    [
        ([2.1, 0.1, 0.5, 0.1], "filter_positions"),  # a little outside its limits
        ([15.0, 4.0, -15.0, 4.0], "filter"),  # fifteen times too fast: held to the end
        ([150.0, 0, 0, 0], "filter"),  # too fast in degrees as well
        ({"a": [5.0, 0, 0, 0, 0, 15.0]}, "filter_twists"),
    ],
)
def test_motion_that_is_only_fast_gets_no_warning(guard, caplog, motion, form):
    assert "look" not in answer(lambda: driven(motion, form)(guard), caplog)


def test_a_controller_that_corrects_a_large_error_gets_no_warning(guard, caplog):
    q, v = guard.home, np.zeros(4)
    for k in range(120):
        wanted = 50.0 * (np.array([0.9, 0.1, 0.9, 0.1]) - q)
        v = guard.filter(q, wanted, 0.02 * k, velocity=v).velocity
        q = q + 0.02 * v
    assert not caplog.records


def test_an_obstacle_far_away_is_named_once(guard, caplog):
    for k in range(3):
        guard.place("ball", Pose(xyz=(800 + k, 0, 0)))
    assert len(caplog.records) == 1
