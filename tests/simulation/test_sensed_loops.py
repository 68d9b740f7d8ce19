"""Operators who try to hit what sensors alone know."""

from dataclasses import replace

import numpy as np
import pytest

import armguard as ag
from armguard.scene.compile import compile_scene
from closed_loop.judge import Judge
from evading.episode import Plant
from freedom.worlds import modelled
from sensed_loops.episode import Operator, Sensing, gaps, run_episode
from sensed_loops.scenes import (
    LARGE,
    LASTS,
    MOVER,
    SMALLEST,
    SPEEDS,
    Setting,
    sensing_scene,
    world_of,
)
from sensed_loops_campaign import EVERY, UNKNOWN, derived, is_broken, summed_up

MOVING = Setting(moves=True)


def test_arms_stop_before_bodies_that_sensors_see():
    found = run_episode(Setting(), 0)
    assert found["contact"] is None
    assert found["cycles"] == 500
    assert found["stopped"] < 0.5 * found["cycles"]
    assert found["way"] > 1.0


def test_arms_touch_a_body_whose_speed_the_guard_does_not_know():
    seeds = (5, 6, 0)
    blind = (run_episode(Setting(moves=True, left_out="speed"), s) for s in seeds)
    found = next(one for one in blind if one["contact"])
    link, body, time = found["contact"]
    assert link.split("/")[0] in ("left", "right")
    assert body == MOVER
    assert 0.4 < time < 2.0
    assert run_episode(MOVING, found["seed"])["contact"] is None


def bay_with_bodies():
    """A world, the judge of its scene, and arms at home."""
    world = world_of(Setting(), 0)
    scene = modelled(world)
    judge, guard = Judge(scene, compile_scene(scene)), ag.Guard(scene, self_test=False)
    judge.place(scene.home)
    return world, judge, Plant(guard, scene.home, np.random.default_rng(0))


def test_an_operator_leads_an_arm_to_a_body():
    _, judge, plant = bay_with_bodies()
    operator = Operator(plant, judge, np.random.default_rng(0))
    assert not operator.desired().any()
    plant.cycles = 120
    desired = operator.desired()
    speeds = np.abs(desired) / plant.joined("velocity")
    for own in plant.own.values():
        assert speeds[own].max() == pytest.approx(1.0)
    aims = [operator._aims[name] for name in plant.robots]
    before = [judge.gap(aim) for aim in aims]
    judge.place(plant.q + 0.01 * desired)
    assert all(judge.gap(a) < b - 1e-3 for a, b in zip(aims, before, strict=True))


def test_a_body_that_moves_keeps_off_all_that_is_fixed():
    for seed in range(4):
        world = world_of(MOVING, seed)
        assert world.edges.min() >= SMALLEST
        speeds = np.linalg.norm(world.velocities, axis=1)
        assert not speeds[1:].any()
        assert speeds[0] == 0.0 or SPEEDS[0] <= speeds[0] <= SPEEDS[1]
        scene = modelled(world)
        judge = Judge(scene, compile_scene(scene))
        judge.place(scene.home)
        own = judge.owners.index(MOVER)
        fixed = [g for g in np.flatnonzero(judge.arm_of < 0) if g != own]
        fixed = [g for g in fixed if not judge.owners[g].startswith("foreign")]
        for time in np.linspace(0.0, LASTS, 7):
            judge.stand_at(MOVER, time * world.velocities[0])
            judge.place(scene.home)
            assert all(judge.gap((min(g, own), max(g, own))) > 0.0 for g in fixed)


def test_sensors_are_as_far_off_as_they_are_declared_to_be():
    setting = Setting(large="error")
    scene = sensing_scene(setting, true=False)
    sensing = Sensing(setting, world_of(setting, 3), 3)
    for name, sensor in scene.sensors.items():
        off = sensing._rig.truth[name] - sensor.pose.matrix()
        assert np.linalg.norm(off) == pytest.approx(LARGE["error"]["error"])


def test_what_is_left_out_is_true_all_the_same():
    setting = Setting(large="noise", left_out="noise")
    told, true = (sensing_scene(setting, true=one) for one in (False, True))
    for name, sensor in true.sensors.items():
        assert sensor.noise == LARGE["noise"]["noise"]
        assert told.sensors[name].noise[0] < 0.2 * sensor.noise[0]


@pytest.mark.parametrize(("left_out", "lost"), [("error", 0.0), ("cell", -0.0125)])
def test_the_guard_does_not_get_what_is_left_out(left_out, lost):
    setting = Setting(large="error", left_out=left_out)
    world = world_of(setting, 0)
    sensing = Sensing(setting, world, 0)
    rng = np.random.default_rng(0)
    plant = Plant(sensing, modelled(world).home, rng)
    for _ in range(40):
        sensing.look(plant)
        plant.drive(np.zeros_like(plant.q))
    claims = sensing._guard._sensed.table.claims
    assert claims.occupied.words.any()
    np.testing.assert_array_equal(claims.error, np.float32(lost))


def test_only_bodies_are_looked_at_and_whether_their_arm_moves():
    world, judge, plant = bay_with_bodies()
    plant.cycles = 1
    hand = judge.owners.index("left/link7")
    to_hand = judge.data.geom_xpos[hand] - np.array(world.poses[0].xyz)
    moved = world.velocities.copy()
    moved[0] = to_hand / plant.time
    world = replace(world, velocities=moved)
    found = list(gaps(judge, plant, world))
    assert found
    assert all(b == MOVER and not moves for _, (_, b), moves in found)
    assert min(distance for distance, *_ in found) < 0.0
    plant.v[plant.own["left"].start] = 1e-9
    moving = {a.split("/")[0]: moves for _, (a, _), moves in gaps(judge, plant, world)}
    assert moving["left"] and not moving.get("right", False)


def test_contacts_break_the_promise_unless_something_is_left_out():
    episode = {
        "seed": 1, "contact": ["left/link7", MOVER, 1.0], "met_at_rest": False,
        "least": -0.001, "cycles": 250, "stopped": 3, "way": 1.0, "stops": [],
        "worked_s": 1.0,
    }  # fmt: skip
    for kind in EVERY:
        figures = summed_up(kind, [episode])
        figures |= derived(kind, figures)
        assert is_broken(figures) is (kind not in UNKNOWN)
        clear = summed_up(kind, [episode | {"contact": None}])
        assert not is_broken(clear | derived(kind, clear))
