"""Leaving what is too near: surely, whatever the joints make of their commands."""

import numpy as np
import pytest

from approach import ball_scene
from armguard.geometry import Pose, Sphere
from armguard.respond import Action, Blocked, Guard
from driven import Driven

# What a joint may miss its command by, as declared [rad/s].
TRACKING = 0.02


class Drifting(Driven):
    """An arm that misses every command towards what is near, unless it is held."""

    def cycle(self, desired, form="filter"):
        command = super().cycle(desired, form)
        if command.action < Action.STOP:
            drift = TRACKING * 1e-3
            self.q = self.q + drift
            self.v = self.v + TRACKING
        return command


def pressed(loop_of=Driven):
    """A loop whose arm rests with a ball put too near to it, ahead of it."""
    scene = ball_scene()
    scene.add(Sphere(radius=0.1), name="cart", present=False)
    guard = Guard(scene, self_test=False)
    loop = loop_of(guard)
    loop.run([0.0], 20)
    angle = loop.q[0] + 0.18
    guard.place("cart", Pose(xyz=(0.7 * np.cos(angle), 0.7 * np.sin(angle), 0.2)))
    loop.run([0.0], 400)
    assert loop.commands[-1].blocked == {"arm": Blocked.TOO_NEAR}
    assert loop.commands[-1].action is Action.STOP
    return loop


def test_the_tests_know_what_is_declared():
    assert pressed().guard.tables.robots[0].stopping.tracking_error[0] == TRACKING


@pytest.mark.parametrize("desired", [-1e-5, -0.01, -0.1, -1.5])
def test_however_little_is_desired_it_surely_leads_away(desired):
    loop = pressed()
    begin = len(loop.commands)
    loop.run([desired], 5)
    commanded = [c.velocity[0] for c in loop.commands[begin:]]
    moving = [u for u in commanded if u != 0.0]
    assert moving
    assert max(moving) < -TRACKING
    # At first no faster than that takes.
    assert moving[0] > -2.0 * TRACKING


def test_an_arm_that_drifts_as_far_as_it_may_never_comes_nearer():
    loop = pressed(Drifting)
    begin = loop.q[0]
    rng = np.random.default_rng(1)
    farthest = begin
    for _ in range(60):
        desired = float(rng.uniform(-0.08, 0.02))
        loop.run([desired], int(rng.integers(1, 40)))
        farthest = max(farthest, loop.q[0])
        if loop.commands[-1].blocked != {"arm": Blocked.TOO_NEAR}:
            break
    assert farthest <= begin + 1e-9
    assert loop.q[0] < begin - 0.02


def test_an_arm_whose_operator_lets_go_on_the_way_out_is_stopped_and_held():
    loop = pressed()
    loop.run([-0.1], 20)
    assert loop.commands[-1].blocked == {"arm": Blocked.TOO_NEAR}
    assert loop.commands[-1].velocity[0] < -TRACKING
    let_go = loop.cycle([0.0])
    assert let_go.velocity[0] > -0.1
    loop.run([0.0], 200)
    rest = loop.q.copy()
    command = loop.run([0.0], 200)
    assert command.action is Action.STOP
    assert (loop.q == rest).all()


def test_a_little_desired_motion_of_the_wrong_way_does_not_count():
    loop = pressed()
    command = loop.run([1e-5], 20)
    assert command.velocity[0] == 0.0
    assert command.action is Action.STOP
