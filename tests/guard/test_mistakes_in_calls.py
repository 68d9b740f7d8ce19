"""Mistakes in Python: the answer has the value, the place and the remedy."""

import logging
from math import nan

import numpy as np
import pytest

from armguard import ArmguardError, Box, Guard, Pose, Scene, Sphere
from arms import TURN_AND_LIFT


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the arm's file."""
    path = tmp_path_factory.mktemp("calls")
    (path / "r.urdf").write_text(TURN_AND_LIFT)
    return path


def with_arm(**given):
    """Adds the arm to a scene."""
    return lambda scene, urdf: scene.add_robot(urdf, "a", **given)


def with_object(*given, **named):
    """Adds an object to a scene."""
    return lambda scene, _: scene.add(*given, **named)


def alone(**given):
    """Makes a scene."""
    return lambda scene, _: Scene(**given)


CUBE = Box(size=(1, 1, 1))

CALLS = {
    "milliseconds": (alone(period=20), "period is 20 s, which looks like milliseconds"),
    "milliseconds late": (alone(late=5), "late is 5 s, which looks like milliseconds"),
    "millimetres of buffer": (alone(buffer=30), "buffer is 30 m, which looks like mil"),
    "millimetres of margin": (alone(margin=500), "millimetres; give metres: 0.5"),
    "text for a number": (alone(period="20ms"), "period is '20ms'; it must be a num"),
    "a flag for a number": (alone(buffer=True), "buffer is True; it must be a number"),
    "NaN": (alone(period=nan), "period is nan s; it must be finite and >= 0"),
    "millimetres of a fit": (
        with_arm(fit_target=30),
        "robot 'a': fit_target is 30 m, which looks like millimetres; give metres: 0.0",
    ),
    "millimetres of a joint": (
        with_arm(home={"lift": 100}),
        "home puts joint 'lift' at 100, which looks like millimetres; give metres",
    ),
    "degrees of a joint": (
        with_arm(home={"turn": 45}),
        "home puts joint 'turn' at 45, which looks like degrees; give radians",
    ),
    "text for a position": (
        with_arm(home={"turn": "0.5"}),
        "home puts joint 'turn' at '0.5'; it must be a number [rad or m]",
    ),
    "positions as a list": (
        with_arm(home=[0.5, 0.1]),
        "robot 'a': home is [0.5, 0.1]; give a mapping by name, such as {'turn': 0.1}",
    ),
    "a base as a list": (
        with_arm(base=[0, 0, 0]),
        "robot 'a': base is [0, 0, 0]; give a Pose, such as Pose(xyz=(0, 0, 0)",
    ),
    "stopping as a number": (
        with_arm(stopping=5.0),
        "robot 'a': stopping is 5.0; give a mapping by name, such as {'deceleration'",
    ),
    "numbers without joints": (
        with_arm(stopping={"deceleration": [5, 5, 5]}),
        "deceleration is [5, 5, 5]; it must be a number, or numbers by joint name",
    ),
    "text for a figure": (
        with_arm(stopping={"deceleration": "5"}),
        "deceleration is '5'; it must be a number, or numbers by joint name",
    ),
    "degrees of a figure": (
        with_arm(stopping={"deceleration": 500}),
        "deceleration of joint 'turn' is 500, which looks like degrees; give radians",
    ),
    "a pose as a tuple": (
        with_object(CUBE, "t", pose=(0, 0, 1)),
        "object 't': pose is (0, 0, 1); give a Pose",
    ),
    "name and shape exchanged": (
        with_object("t", CUBE),
        "it must be text, as in add(Box(size=(1, 1, 1)), 'table')",
    ),
    "no shape": (with_object([1.0], "t"), "object 't': 1.0 is no shape; give shapes"),
    "millimetres a second": (
        with_object(Sphere(radius=0.1), "t", top_speed=1600),
        "object 't': top_speed is 1600 m/s, which looks like millimetres; give metres",
    ),
}


@pytest.mark.parametrize("kind", CALLS)
def test_a_call_of_python_is_refused(folder, kind):
    call, says = CALLS[kind]
    with pytest.raises(ArmguardError) as caught:
        call(Scene(), folder / "r.urdf")
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (with_arm(base=Pose(xyz=(800, 0, 0))), "robot 'a': base: 800 m look like mil"),
        (with_object(Box(size=(1200, 2000, 50)), "t"), "object 't': 2000 m look like"),
        (with_object(CUBE, "t", pose=Pose(xyz=(0, -800, 0))), "metres: 0.8"),
    ],
)
def test_lengths_of_python_that_are_seldom_true_are_a_warning(
    folder, caplog, call, says
):
    with caplog.at_level(logging.WARNING, logger="armguard"):
        call(Scene(), folder / "r.urdf")
    assert says in caplog.text


def two_arms(folder):
    """A guard of the two arms."""
    scene = Scene(period=0.02)
    home = {"turn": 0.5, "lift": 0.1}
    for name, x in (("a", 0), ("b", 3)):
        base, stopping = Pose(xyz=(x, 0, 0)), {"deceleration": 1.0}
        scene.add_robot(
            folder / "r.urdf", name, base=base, stopping=stopping, home=home
        )
    return Guard(scene, self_test=False)


@pytest.fixture(scope="module")
def guard(folder):
    """One guard for all tests that may share it."""
    return two_arms(folder)


@pytest.mark.parametrize(
    ("q", "says"),
    [
        (
            [0.5, 100, 0.5, 100],
            "joint 'a/lift' is at 100.0000: stop, its limits are [0.0000, 0.4000]; the "
            "sliding joints look like millimetres; give metres",
        ),
        ([0.5, 1e5, 0.5, 0.1], "check units and order"),
    ],
)
def test_measured_millimetres_are_named(guard, q, says):
    guard.reset()
    assert guard.step(q, 0.0, velocity=np.zeros(4)).why.endswith(says)


@pytest.mark.parametrize(
    ("goal", "says"),
    [
        (
            [45, 0.1, 45, 0.1],
            "q_desired of joint 'a/turn' is 45, its limits are [0.1, 2]; the positions "
            "look like degrees; give radians",
        ),
        (
            {"a": [0.5, 0.1], "b": [0.5, 100]},
            "q_desired of joint 'b/lift' is 100, its limits are [0, 0.4]; the sliding "
            "joints look like millimetres; give metres",
        ),
        ([2.1, 0.1, 0.5, 0.1], None),
    ],
)
def test_desired_degrees_and_millimetres_are_one_warning(folder, caplog, goal, says):
    guard = two_arms(folder)
    with caplog.at_level(logging.WARNING, logger="armguard"):
        for k in range(3):
            guard.filter_positions(guard.home, goal, 0.02 * k, velocity=np.zeros(4))
    found = [record.getMessage() for record in caplog.records]
    assert found == ([] if says is None else [says])
