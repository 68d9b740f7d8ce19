"""Simulated arms whose process has to wait for its turn."""

from collections import deque
from types import SimpleNamespace

import numpy as np
import pytest

from armguard.respond.command import Action
from armguard.scene import bay_scene
from armguard.service.wire import Cause
from armguard.simulation.controller import SimulatedArms
from armguard.simulation.plant import PERFECT

PERIOD, SPEED, PAUSE = 0.01, 0.5, 0.6


class PausedClient:
    """A client in a process that is paused once, just after it has sent a state."""

    connected = True

    def __init__(self, actions):
        self.welcome = SimpleNamespace(period=PERIOD)
        self.latest = SimpleNamespace(cycle=0, cause=Cause.NONE)
        self.now, self.cycles, self.paused_at = 0.0, 0, None
        self.moving = np.zeros(14)
        self.moving[0] = SPEED
        self._ordered, self._waiting = actions, deque()

    def clock(self):
        return self.now

    def receive(self, timeout=0.0):
        if self._waiting:
            return self._waiting.popleft()
        self.now += timeout
        return None

    def send_state(self, _q, _v, stamp):
        self.cycles += 1
        self._answer(stamp, {})
        if self.cycles == 30:
            self.paused_at = self.now
            self._answer(self.now + PERIOD, self._ordered)
            self.now += PAUSE

    def _answer(self, sent, actions):
        speed = self.moving if not actions else np.zeros(14)
        self._waiting.append(
            SimpleNamespace(velocity=speed, actions=actions, sent=sent)
        )


@pytest.mark.parametrize("action", [Action.STOP, Action.BRAKE])
def test_an_order_that_came_while_they_waited_is_obeyed_as_of_when_it_came(action):
    scene = bay_scene("path")
    client = PausedClient(dict.fromkeys(scene.robots, action))
    arms = SimulatedArms(client, scene, imperfection=PERFECT)
    arms.run(lambda: client.cycles == 30)
    before, way = arms.plant.q[0], SPEED * (client.paused_at - arms.plant.time)
    arms.run(lambda: client.cycles == 31)
    figures = next(iter(scene.robots.values())).stopping
    delay = PERIOD + figures.command + figures.ramp
    stopped = SPEED * delay + SPEED**2 / (2.0 * figures.deceleration[0])
    moved = arms.plant.q[0] - before - way
    assert 0.5 * SPEED * PERIOD < moved < stopped + 1e-9 < 0.5 * SPEED * PAUSE
