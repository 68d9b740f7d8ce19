"""An arm that follows the commands of a filter, late and inexactly if wanted."""

from collections import deque

import numpy as np

from approach import FIGURES, PERIOD, ball_scene
from armguard.geometry import Box, Pose
from armguard.respond import Action, Guard
from armguard.scene import Scene
from armguard.scene.settings import ResponseSettings
from arms import simple_arm


class Driven:
    """A plant that follows commands, and the loop around it.

    Args:
        guard: The guard.
        q: Where it starts; at home if None.
        delay: Cycles until a command takes effect.
        miss: What its velocity misses the commanded one by [rad/s].
    """

    def __init__(self, guard, q=None, delay=0, miss=0.0):
        self.guard = guard
        self.q = guard.home if q is None else np.array(q, dtype=float)
        self.v = np.zeros_like(self.q)
        self.t = 0.0
        self.miss = miss
        self.queue = deque([np.zeros_like(self.q)] * delay)
        self.commands = []
        self.q_rows, self.v_rows = [self.q.copy()], [self.v.copy()]

    def cycle(self, desired, form="filter"):
        """One cycle; `desired` may be a function of the loop."""
        asked = desired(self) if callable(desired) else desired
        command = getattr(self.guard, form)(self.q, asked, self.t, velocity=self.v)
        self.queue.append(command.velocity)
        self.v = self.queue.popleft() + self.miss * (self.v != 0.0)
        self.q = self.q + self.v * PERIOD
        self.t += PERIOD
        self.commands.append(command)
        self.q_rows.append(self.q.copy())
        self.v_rows.append(self.v.copy())
        return command

    def run(self, desired, cycles, form="filter"):
        """Some cycles; the last command."""
        for _ in range(cycles):
            command = self.cycle(desired, form)
        return command

    @property
    def stops(self):
        """Commands that were more than to follow."""
        return [c for c in self.commands if c.action >= Action.STOP]


def ball_guard(response="deflect", **options):
    """One arm of a metre and a ball in its way."""
    return Guard(ball_scene(response=response, **options), self_test=False)


def wall_guard(response="deflect", joints=3, wall=0.6, **options):
    """A planar arm and a wall whose face is at y = `wall`."""
    scene = Scene(mode="path", margin=0.1)
    scene.add_robot(
        simple_arm(joints=joints),
        name="arm",
        stopping={**FIGURES, **options},
        response=response,
        home={f"joint{k + 1}": 0.0 for k in range(joints)},
    )
    scene.add(
        Box(size=(4.0, 0.2, 2.0)),
        name="wall",
        pose=Pose(xyz=(0.0, wall + 0.1, 0.5)),
    )
    return Guard(scene, self_test=False)


def two_arms(sharing="contribution", priorities=(0.0, 0.0), parked=1.4):
    """Two arms of one joint each, 1.2 m apart, that turn towards each other.

    The left one comes nearer with a negative velocity, the right one with a positive
    one; `parked` is how far the right one has turned away at home.
    """
    scene = Scene(mode="path", margin=0.6)
    for name, x, turn, home, priority in zip(
        ("left", "right"),
        (0.0, 1.2),
        (0.0, np.pi),
        (1.4, -parked),
        priorities,
        strict=True,
    ):
        scene.add_robot(
            simple_arm(joints=1, length=0.9),
            name=name,
            base=Pose(xyz=(x, 0.0, 0.0), rpy=(0.0, 0.0, turn)),
            stopping=FIGURES,
            response=ResponseSettings(sharing=sharing, priority=priority),
            home={"joint1": home},
        )
    return Guard(scene, self_test=False)
