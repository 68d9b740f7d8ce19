"""Getting out of the way of what comes, where there is a way."""

import numpy as np
import pytest

from approach import FIGURES, PERIOD
from armguard.errors import SceneError
from armguard.geometry import Pose, Sphere
from armguard.respond import Blocked, Guard
from armguard.scene import Scene
from armguard.scene.settings import ResponseSettings
from arms import simple_arm

SPEED = 0.3
ARM, CART = 0.04, 0.1


def cart_guard(evade=True, behind=None):
    """An arm of a metre along x, a cart that may come, and a ball behind the arm."""
    scene = Scene(mode="path")
    scene.add_robot(
        simple_arm(joints=1, length=1.0),
        name="arm",
        stopping=FIGURES,
        response=ResponseSettings(evade=evade),
        home={"joint1": 0.0},
    )
    scene.add(
        Sphere(radius=CART),
        name="cart",
        pose=Pose(xyz=(0.7, 0.6, 0.2)),
        top_speed=0.5,
    )
    if behind is not None:
        scene.add(
            Sphere(radius=0.1),
            name="behind",
            pose=Pose(xyz=(0.7 * np.cos(behind), 0.7 * np.sin(behind), 0.2)),
        )
    return Guard(scene, self_test=False)


def gap(q, centre, radius):
    """True distance of the arm and a ball, by hand [m]."""
    tip = np.array([np.cos(q), np.sin(q)])
    along = np.clip(centre @ tip, 0.1, 1.0)
    return float(np.linalg.norm(centre - along * tip)) - ARM - radius


def come(guard, seconds=1.9, told=True, wish=0.0):
    """Have the cart come at the arm.

    Returns:
        Least gap to the cart, joint positions, and why the arm did not follow.
    """
    q, v = 0.0, 0.0
    rows, gaps, blocked = [], [], []
    for k in range(int(seconds / PERIOD)):
        time = k * PERIOD
        centre = np.array([0.7, 0.6 - SPEED * time])
        guard.place(
            "cart",
            Pose(xyz=(*centre, 0.2)),
            time,
            velocity=(0.0, -SPEED, 0.0) if told else None,
        )
        command = guard.filter([q], [wish], time, velocity=[v], now=time)
        v = command.velocity[0]
        q += v * PERIOD
        rows.append(q)
        gaps.append(gap(q, centre, CART))
        blocked.append(command.blocked["arm"])
    return min(gaps), np.array(rows), blocked


def test_an_arm_at_rest_gets_out_of_the_way():
    least, rows, blocked = come(cart_guard())
    assert least > 0.0
    assert rows[-1] < -0.05
    assert Blocked.EVADING in blocked


@pytest.mark.parametrize(("evade", "told"), [(False, True), (True, False)])
def test_one_that_is_not_to_or_cannot_know_is_hit(evade, told):
    least, rows, blocked = come(cart_guard(evade), told=told)
    assert least < 0.0
    assert np.abs(rows).max() < 1e-6
    assert Blocked.EVADING not in blocked


def test_an_arm_at_work_does_so_too_whatever_its_operator_wants():
    least, _, blocked = come(cart_guard(), wish=0.05)
    assert least > 0.0
    assert Blocked.EVADING in blocked


def test_it_does_not_run_into_what_is_behind_it():
    guard = cart_guard(behind=-0.45)
    _, rows, _ = come(guard)
    behind = 0.7 * np.array([np.cos(0.45), -np.sin(0.45)])
    assert min(gap(q, behind, 0.1) for q in rows) >= 0.005


def test_what_goes_away_is_not_evaded():
    guard = cart_guard()
    for k in range(200):
        time = k * PERIOD
        at = Pose(xyz=(0.7, 0.2 + SPEED * time, 0.2))
        guard.place("cart", at, time, velocity=(0.0, SPEED, 0.0))
        command = guard.filter([0.0], [0.0], time, velocity=[0.0], now=time)
        assert command.blocked["arm"] is not Blocked.EVADING


@pytest.mark.parametrize(
    ("velocity", "words"),
    [
        ((0.0, 2.0, 0.0), "its top_speed is 0.5"),
        ((0.0, np.nan, 0.0), "3 finite numbers"),
        ((0.0, 1.0), "3 finite numbers"),
    ],
)
def test_a_velocity_that_cannot_be_is_an_error(velocity, words):
    guard = cart_guard()
    with pytest.raises(SceneError, match=words):
        guard.place("cart", Pose(xyz=(0.7, 0.6, 0.2)), 0.0, velocity=velocity)


def test_nor_can_an_object_that_stands_still_have_one():
    guard = cart_guard(behind=-1.5)
    with pytest.raises(SceneError, match="no top_speed"):
        guard.place("behind", Pose(xyz=(0.0, -0.7, 0.2)), 0.0, velocity=(0, 1, 0))
