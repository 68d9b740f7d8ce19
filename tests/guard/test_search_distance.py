"""No pair that matters is left out: answers are those of a search of all pairs."""

import numpy as np
import pytest

from armguard.guard import Monitor
from armguard.respond import Guard
from armguard.scene import bay_scene, two_pandas_scene

PERIOD = 0.004


SCENES = {"bay": lambda: bay_scene("path"), "two Pandas": two_pandas_scene}


def scene_of(name, margin):
    """A scene that is judged with stops, and pairs reported up to a margin."""
    scene = SCENES[name]()
    scene.period = PERIOD
    scene.set_margin(margin)
    return scene


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("share", [0.3, 1.0])
def test_stops_are_those_of_a_search_of_all_pairs(name, share):
    driver = Guard(scene_of(name, 0.03), self_test=False)
    # A margin of 5 m leaves no pair out.
    guards = [
        Monitor(scene_of(name, margin), budget=100_000, self_test=False)
        for margin in (0.03, 5.0)
    ]
    tables, rng = driver.tables, np.random.default_rng(5)
    top = np.concatenate([part.stopping.velocity for part in tables.robots])
    q, velocity, desired = driver.home.copy(), 0.0 * top, 0.0 * top
    least, measured = np.inf, np.zeros(2)
    for k in range(1000):
        if k % 200 == 0:
            desired = share * top * rng.uniform(-1.0, 1.0, len(top))
        now = k * PERIOD
        few, every = (g.step(q, now, velocity=velocity, now=now) for g in guards)
        command = driver.filter(q, desired, now, velocity=velocity, now=now)
        velocity = command.velocity.copy()
        q = q + PERIOD * velocity
        measured += few.counts.pairs_tested, every.counts.pairs_tested
        assert few.causes == every.causes
        for robot, scale in few.speed_scale.items():
            # Search distances are finer than the bounds that judge a measured pair.
            assert scale >= every.speed_scale[robot]
        least = min(least, *few.speed_scale.values())
    # Robots were slowed for near pairs, and most pairs were not measured.
    assert least < 1.0 or share < 1.0
    assert measured[0] < 0.5 * measured[1]
