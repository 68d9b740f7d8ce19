"""Level and words of a verdict never disagree, in 1,000 random cycles of two scenes."""

import re

import numpy as np
import pytest

from approach import PERIOD, in_mode
from armguard.guard import Level, Monitor
from armguard.respond import Action, Guard
from armguard.scene import bay_scene
from armguard.scene.two_pandas import two_pandas_scene

SCENES = {"bay": bay_scene, "pandas": two_pandas_scene}

# Words of each level; a line of any other level has none of them.
WORDS = {
    Level.CLEAR: ("clear",),
    Level.CAUTION: ("caution",),
    Level.SLOW: ("slowing",),
    Level.STOP: ("stop,", "stop:", "still stopping"),
    Level.RECOVER: ("stopped", "leaving"),
    Level.BRAKE: ("brake,",),
    Level.HARDWARE_STOP: ("hardware stop",),
}

# Cycles of each scene and mode; 1,002 in all.
CYCLES = 167


def spoilt(rng, q, v):
    """Measurements and command of a cycle, in one of ten with a fault."""
    q, v, desired = q.copy(), v.copy(), rng.uniform(-1.0, 1.0, len(q))
    kind, joint = rng.integers(0, 30), rng.integers(0, len(q))
    if kind == 0:
        q[joint] = np.nan
    elif kind == 1:
        v[joint] = 99.0
    elif kind == 2:
        desired[joint] = np.inf
    return q, v, desired


def random_cycles(guard, rng):
    """Verdicts and commands of short random motions, some with a fault."""
    low, high = guard.tables.lower, guard.tables.upper
    count = 0
    while count < CYCLES:
        spread = rng.choice([0.0, 0.3, 0.8])
        q = np.clip(guard.home + rng.normal(0.0, spread, len(low)), low, high)
        v = rng.uniform(-0.8, 0.8, len(q)) * rng.choice([0.0, 1.0])
        guard.reset()
        filters = isinstance(guard, Guard) and rng.random() < 0.7
        for k in range(rng.integers(3, 30)):
            now = (k + 50 * (rng.random() < 0.02)) * PERIOD
            at = np.clip(q + k * v * PERIOD, low, high)
            seen, speed, desired = spoilt(rng, at, v if k else 0.0 * v)
            if filters:
                command = guard.filter(seen, desired, now, velocity=speed, now=now)
                yield command.verdict, command
            else:
                yield guard.step(seen, now, velocity=speed, now=now), None
            count += 1
            if now > k * PERIOD:
                break


def check(verdict):
    """Words against level, headroom and the need of one verdict."""
    why, level = verdict.why, verdict.level
    assert "\n" not in why
    assert "clearance" not in why
    assert not re.search(r"(keep|needs|headroom) -", why), why
    found = {n for n, words in WORDS.items() if any(word in why for word in words)}
    if "hardware stop" in why:
        found.discard(Level.STOP)
    assert found == {level}, (level.name, verdict.reason.name, why)
    if (
        keep := re.search(r"([\d.]+) mm from .* must keep ([\d.]+) mm$", why)
    ) is not None:
        assert float(keep[1]) < float(keep[2]), why
    text = verdict.explain()
    assert text.splitlines()[0] == why
    assert not re.search(r"(keep|needs|headroom) -", text), text
    nearest = verdict.nearest
    assert (nearest is None) == ("least headroom:" not in text)


def check_held(command):
    """Words of a command that holds robots; how many there are."""
    assert command.explain().endswith(command.verdict.explain())
    if command.held:
        assert command.why.startswith("HELD ")
        assert "since" in command.why and "To go on: " in command.why
        assert "clear" not in command.why
    return len(command.held)


@pytest.mark.parametrize("mode", ["path", "speed", "fixed"])
@pytest.mark.parametrize("name", SCENES)
def test_level_and_words_never_disagree(name, mode):
    rng = np.random.default_rng(23)
    kind = Monitor if mode == "fixed" else Guard
    guard = kind(in_mode(SCENES[name](), mode), self_test=False)
    levels = set()
    for verdict, command in random_cycles(guard, rng):
        check(verdict)
        levels.add(verdict.level)
        if command is not None:
            check_held(command)
    assert Level.STOP in levels and len(levels) >= 3


@pytest.mark.parametrize("mode", ["path", "speed"])
def test_a_held_robot_comes_first_in_the_words(mode):
    guard = Guard(in_mode(bay_scene(), mode), self_test=False)
    still, held = np.zeros(len(guard.home)), []
    for k in range(600):
        desired = still + (np.inf if k == 5 else 0.2)
        now = k * PERIOD
        command = guard.filter(guard.home, desired, now, velocity=still, now=now)
        check(command.verdict)
        held.append(check_held(command))
    assert held[-1] == len(guard.tables.robots)
    assert command.action is Action.HOLD
