"""A Panda picks a cup beside another one; Coal judges every 25th cycle."""

import numpy as np
import pytest

from armguard.geometry import Box, Cylinder, Pose
from armguard.scene import Gripper, Scene
from grippers import PERIOD, guard_of
from peers.shapes import coal_pair

HAND = "arm/panda_hand"
FINGERS = ("arm/panda_leftfinger", "arm/panda_rightfinger")
HALF, RADIUS = 0.06, 0.025
FLOOR = 0.005

# Where the hand's frame is when the fingers are round the cup, and above it [m].
DOWN, UP = 0.215, 0.32


def cup_scene():
    """A Panda, a table and two cups 20 mm apart."""
    scene = Scene(mode="path")
    scene.add_robot(
        "panda",
        name="arm",
        gripper=Gripper(
            link="panda_hand", fingers=("panda_leftfinger", "panda_rightfinger")
        ),
        home={"panda_finger_joint1": 0.038},
    )
    scene.add(
        Box(size=(1.2, 2.0, 0.05)),
        name="table",
        pose=Pose(xyz=(0.7, 0, -0.025)),
    )
    for name, x in (("cup", 0.45), ("other", 0.45 + 2.0 * RADIUS + 0.02)):
        scene.add(
            Cylinder(radius=RADIUS, height=2.0 * HALF),
            name=name,
            pose=Pose(xyz=(x, 0.0, HALF)),
            graspable=True,
        )
    return scene


class Arm:
    """The loop, led by the hand; and Coal beside it."""

    def __init__(self, guard):
        self.guard, self.q, self.t = guard, guard.home, 0.0
        self.v = np.zeros_like(self.q)
        self.commands, self.gaps = [], {}
        self.frame = guard.tables.links[HAND]
        self.cycle()

    @property
    def hand(self):
        """Frame of the hand in the world."""
        return self.pose(self.frame.body) @ self.frame.T_body_link

    def pose(self, body):
        """Pose of a body in the world."""
        T = np.eye(4)
        T[:3] = self.guard._workspace.T_world[body].reshape(3, 4)
        return T

    def cycle(self, twist=None, fingers=0.0):
        """One cycle, led by a twist or with the fingers."""
        if fingers:
            desired = {"arm/panda_finger_joint1": fingers}
            command = self.guard.filter(self.q, desired, self.t, velocity=self.v)
        else:
            desired = {HAND: np.zeros(6) if twist is None else twist}
            command = self.guard.filter_twists(self.q, desired, self.t, velocity=self.v)
        self.v = command.velocity
        self.q = self.q + self.v * PERIOD
        self.t += PERIOD
        self.commands.append(command)
        if len(self.commands) % 25 == 0:
            self.judge()

    def go(self, x, y, z, speed, longest=6000):
        """Lead the hand to a place, looking down; whether it got there."""
        for _ in range(longest):
            T = self.hand
            way = np.array([x, y, z]) - T[:3, 3]
            if np.linalg.norm(way) < 1.5e-3 and np.abs(self.v).max() < 2e-3:
                return True
            desired = 6.0 * way
            desired *= min(1.0, speed / np.linalg.norm(desired))
            turn = 2.0 * np.cross(T[:3, 2], [0.0, 0.0, -1.0])
            turn[2] = -2.0 * T[0, 1]
            self.cycle(np.concatenate([desired, turn]))
        return False

    def judge(self):
        """Note Coal's distances of hand and fingers from both cups."""
        tables = self.guard.tables
        for name in ("cup", "other"):
            body = tables.holds.objects[name].body
            cup = (Cylinder(radius=RADIUS, height=2.0 * HALF), self.pose(body))
            for link in (HAND, *FINGERS):
                frame = tables.links[link]
                T = self.pose(frame.body) @ frame.T_body_link
                least = min(
                    distance(s.shape, T @ s.pose.matrix(), *cup) for s in SHAPES[link]
                )
                self.gaps.setdefault((link, name), []).append(least)


def distance(a, T_a, b, T_b):
    """Coal's signed distance of two shapes [m]."""
    pair = coal_pair(a, T_a, b, T_b)
    return pair.functor(pair.T_a, pair.T_b, pair.request, pair.result)


# Real shapes of hand and fingers, of the scene that is loaded.
SHAPES: dict[str, tuple] = {}


@pytest.fixture(scope="module")
def arm():
    scene = cup_scene()
    fits = scene.robots["arm"].fits
    for link in (HAND, *FINGERS):
        fit = fits[link.split("/")[1]]
        SHAPES[link] = fit.exact or fit.shapes
    return Arm(guard_of(scene))


def test_a_panda_picks_a_cup_and_puts_it_down_elsewhere(arm):
    guard = arm.guard
    assert arm.go(0.45, 0.0, UP, 0.2)
    assert arm.go(0.45, 0.0, DOWN, 0.08)
    for _ in range(1500):
        arm.cycle(fingers=-0.03)
    assert {c.b for c in guard.contracts} == {"cup"}
    guard.grasp("arm", "cup")
    for key, gaps in arm.gaps.items():
        least = min(gaps)
        if key[1] == "cup" and key[0] in FINGERS:
            assert -0.002 <= least <= 0.0
        else:
            assert least >= FLOOR
    assert arm.go(0.45, 0.0, UP, 0.1)
    assert arm.go(0.45, 0.25, UP, 0.3)
    assert arm.go(0.45, 0.25, DOWN, 0.08)
    guard.release("arm", "cup")
    for _ in range(600):
        arm.cycle(fingers=0.03)
    assert arm.go(0.45, 0.25, UP, 0.2)
    assert all(c.action == 0 for c in arm.commands)
    body = guard.tables.holds.objects["cup"].body
    assert arm.pose(body)[:3, 3] == pytest.approx([0.45, 0.25, HALF], abs=5e-3)
    assert min(arm.gaps[HAND, "other"]) >= FLOOR


def test_what_fitted_primitives_reach_too_far_does_not_count_as_depth(arm):
    # The hand's box reaches 16 mm beyond the hand; under a contract its hull counts.
    guard = arm.guard
    body = guard.tables.holds.objects["cup"].body
    x, y, _ = arm.pose(body)[:3, 3]
    assert arm.go(x, y, UP, 0.2)
    guard.allow(HAND, "cup", until=1e9)
    for finger in FINGERS:
        guard.allow(finger, "cup", until=1e9)
    arm.gaps.clear()
    arm.go(x, y, DOWN - 0.045, 0.08, longest=4000)
    least = min(arm.gaps[HAND, "cup"])
    assert -0.002 <= least <= 0.0
    assert all(c.action == 0 for c in arm.commands)


def test_what_is_put_down_goes_down_straight():
    # Ever slower than it is asked to, and neither aside nor tilted.
    arm = Arm(guard_of(cup_scene()))
    assert arm.go(0.45, 0.0, UP, 0.2)
    assert arm.go(0.45, 0.0, DOWN, 0.08)
    for _ in range(1500):
        arm.cycle(fingers=-0.03)
    arm.guard.grasp("arm", "cup")
    assert arm.go(0.45, 0.0, DOWN + 0.06, 0.1)
    begin = arm.hand
    for _ in range(2500):
        arm.cycle(np.array([0.0, 0.0, -0.08, 0.0, 0.0, 0.0]))
    assert arm.hand[2, 3] == pytest.approx(DOWN, abs=3e-3)
    assert np.abs(arm.hand[:2, 3] - begin[:2, 3]).max() < 1e-3
    assert np.abs(arm.hand[:3, :3] - begin[:3, :3]).max() < 4e-3
    # An arm that slides it along the table is not held back by that.
    for _ in range(500):
        arm.cycle(np.array([0.0, -0.05, -0.02, 0.0, 0.0, 0.0]))
    assert arm.hand[1, 3] - begin[1, 3] < -0.015
    assert all(c.action == 0 for c in arm.commands)
