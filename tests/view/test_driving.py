"""Inputs of hands become desired motion, and end when the hands are gone."""

import numpy as np
import pytest

from armguard.scene import bay_scene, compile_scene
from armguard.view.driver import (
    AHEAD,
    ANGULAR,
    LINEAR,
    ramped,
    twist_towards,
)
from armguard.view.jog import HELD, LEFT_BUMPER, RIGHT_BUMPER, B, Jog
from armguard.view.world import tool_pose


class Hand:
    """A person at keys and a gamepad, with a separate clock."""

    def __init__(self):
        self.now, self.stops, self.chosen = 0.0, 0, []
        self.jog = Jog(self.stop, self.chosen.append, clock=lambda: self.now)

    def stop(self):
        self.stops += 1

    def keys(self, *held):
        self.jog.receive({"type": "keys", "held": list(held)})

    def pad(self, axes=(0.0,) * 4, **pressed):
        buttons = [0.0] * 17
        for name, value in pressed.items():
            buttons[int(name[1:])] = value
        self.jog.receive({"type": "pad", "axes": list(axes), "buttons": buttons})


def test_keys_count_while_they_are_held_and_no_longer():
    hand = Hand()
    hand.keys("KeyW", "KeyL", "KeyZ")
    assert hand.jog.direction.tolist() == [1, 0, 0, 0, 0, -1]
    hand.keys("KeyW", "KeyS")
    assert not hand.jog.direction.any()
    hand.keys("KeyR")
    hand.now += HELD + 0.01
    assert not hand.jog.direction.any()
    hand.keys("KeyR")
    assert hand.jog.direction[2] == 1.0
    hand.keys()
    assert not hand.jog.direction.any()
    hand.keys("Digit2", "KeyW")
    hand.keys("Digit2", "KeyW")
    assert hand.chosen == [1]


def test_a_gamepad_leads_only_while_its_bumper_is_held():
    hand = Hand()
    hand.pad(axes=(0.0, -1.0, 0.0, 0.0))
    assert not hand.jog.direction.any()
    hand.pad(axes=(0.05, -1.0, 0.5, 0.0), **{f"b{LEFT_BUMPER}": 1.0, "b7": 0.4})
    assert hand.jog.direction == pytest.approx([1.0, 0, 0, 0.4, 0, -0.5])
    hand.pad(**{f"b{B}": 1.0})
    hand.pad(**{f"b{B}": 1.0})
    hand.pad(**{f"b{RIGHT_BUMPER}": 1.0})
    assert hand.stops == 1
    assert hand.chosen == [None]
    assert not hand.jog.direction.any()


@pytest.mark.parametrize(
    "said",
    [
        {"type": "keys"},
        {"type": "keys", "held": [1, None, ["KeyW"]]},
        {"type": "pad", "axes": "abcd", "buttons": [1.0] * 17},
        {"type": "pad", "axes": [float("nan")] * 4, "buttons": [1.0] * 17},
        {"type": "pad", "axes": [1.0], "buttons": []},
    ],
)
def test_nonsense_requests_no_motion(said):
    hand = Hand()
    hand.jog.receive(said)
    assert not hand.jog.direction.any()


def test_joints_are_led_to_their_targets_in_steps_and_the_others_stay():
    q = np.zeros(3)
    step = np.full(3, 0.01)
    target = np.array([0.025, np.nan, -1.0])
    asked = q
    for k in range(1, 4):
        asked = ramped(asked, target, q, step)
        assert asked == pytest.approx([min(0.01 * k, 0.025), 0.0, -0.01 * k])
    # An arm that does not follow is not run away from.
    for _ in range(100):
        asked = ramped(asked, target, q, step)
    assert asked == pytest.approx([0.025, 0.0, -0.01 * AHEAD])


def test_a_twist_leads_a_tool_where_its_handle_is():
    tables = compile_scene(bay_scene("path"))
    poses = np.zeros((len(tables.parent), 12))
    poses[:] = np.eye(4)[:3].reshape(12)
    T = tool_pose(tables, tables.robots[0], poses)
    wanted = T.copy()
    wanted[:3, 3] += [0.01, 0.0, 0.0]
    asked = twist_towards(T, wanted, 1.0)
    assert asked[:3] == pytest.approx([0.04, 0.0, 0.0])
    assert asked[3:] == pytest.approx(np.zeros(3))
    c, s = np.cos(0.1), np.sin(0.1)
    wanted = T.copy()
    wanted[:3, :3] = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ T[:3, :3]
    assert twist_towards(T, wanted, 1.0)[3:] == pytest.approx([0, 0, 0.4])
    wanted[:3, 3] += 10.0
    fast = twist_towards(T, wanted, 0.5)
    assert np.linalg.norm(fast[:3]) == pytest.approx(0.5 * LINEAR)
    assert np.linalg.norm(fast[3:]) <= 0.5 * ANGULAR
