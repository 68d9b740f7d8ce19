"""The search for futures finds what can happen, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from closed_loop.plan import work
from closed_loop.scenes import build_scene, declared, movers_of
from closed_loop.search import STEP, SWEEPS, THOROUGH, Future, Reference
from closed_loop.settings import Plan, setting_of

NOW = 0.002
STAMP = {"left": 0.0, "right": 0.0}


def reference(scene="bay", **changes):
    setting = replace(setting_of(scene, "path", 0), **changes)
    built = build_scene(setting)
    figures = declared(setting, built)
    ordered = [figures[name] for name in built.robots]
    return Reference(built, ordered, setting, tuple(movers_of(built))), built


@pytest.fixture(scope="module")
def bay():
    return reference()


def towards_the_bench(scene, headroom, guard):
    """A configuration whose left arm leans over, so far from what it would hit."""
    q = scene.home
    for lean in np.linspace(0.0, 2.0, 2001):
        q[1] = scene.home[1] + lean
        least = guard._world.distances(q).min()
        if least < headroom:
            return q
    raise AssertionError("the arm reaches nothing")


def test_at_rest_far_from_everything_there_is_no_breach(bay):
    guard, scene = bay
    assert guard.breach(scene.home, STAMP, np.zeros(14), NOW, THOROUGH) is None


def test_at_full_speed_close_by_there_is_one_and_it_is_true(bay):
    guard, scene = bay
    q = towards_the_bench(scene, 0.05, guard)
    v = np.zeros(14)
    v[1] = 1.25
    found = guard.breach(q, STAMP, v, NOW, SWEEPS)
    assert found is not None and found.distance < 0.0
    assert any(side.startswith("left/") for side in found.pair)
    rows = guard._search.rows(found.future, q, v, np.full(2, NOW))
    guard._world.place(rows[round(found.time / STEP)])
    k = guard._world.owners.index(found.pair)
    assert guard._world.distance(k) == pytest.approx(found.distance, abs=1e-9)
    levels = guard.step(q, STAMP, velocity=v, now=NOW).levels
    assert levels["left"] > 0 and levels["right"] == 0


def test_a_higher_floor_and_a_longer_wait_never_end_a_breach():
    q, v = None, np.zeros(14)
    v[1] = 0.8
    for headroom in (0.02, 0.08, 0.15):
        found = []
        for changes in ({}, {"floor": 0.05}, {"period": 0.05}):
            guard, scene = reference(**changes)
            q = towards_the_bench(scene, headroom, guard)
            found.append(guard.breach(q, STAMP, v, NOW, SWEEPS) is not None)
        assert not found[0] or (found[1] and found[2])
        if headroom == 0.02:
            assert found[0]


def test_bounds_and_gradients_of_the_exact_world(bay):
    guard, scene = bay
    world, rng = guard._world, np.random.default_rng(0)
    for _ in range(20):
        q = scene.home + rng.uniform(-0.5, 0.5, 14)
        distances = world.distances(q)
        assert (world.bounds(q) <= distances + 1e-9).all()
        change = rng.uniform(-0.05, 0.05, 14)
        moved = world.distances(q + change) - distances
        assert (np.abs(moved) <= world.reach @ np.abs(change) + 1e-9).all()
        assert (world.levers(q) >= 0.0).all()
        k = int(np.argmin(distances))
        slopes = world.gradient(k, q)
        assert (np.abs(slopes) <= world.levers(q)[k] + 1e-3).all()


def put(guard, scene, name, xyz):
    T = scene.objects[name].pose.matrix()
    T[:3, 3] = xyz
    guard.place(name, T, 0.0)


def test_objects_that_move_eat_up_the_distance():
    slow, scene = reference("movers", top_speed=0.0)
    fast, _ = reference("movers", top_speed=4.0)
    q, v = scene.home, np.zeros(14)
    world = slow._world
    for guard in (slow, fast):
        put(guard, scene, "crate", [5.0, 5.0, 5.0])
    balls = [k for k, pair in enumerate(world.owners) if "ball" in pair]
    for x in np.linspace(1.0, -0.6, 400):
        put(slow, scene, "ball", [x, 0.42, 1.0])
        if world.distances(q)[balls].min() < 0.06:
            break
    put(fast, scene, "ball", [x, 0.42, 1.0])
    assert slow.breach(q, STAMP, v, NOW, SWEEPS) is None
    found = fast.breach(q, STAMP, v, NOW, SWEEPS)
    assert found is not None and "ball" in found.pair


def test_the_reference_lets_no_contact_happen():
    plan = Plan(guard="reference", duration=0.25)
    found = [work((plan, seed)) for seed in (0, 2, 14, 16)]
    assert not [e for e in found if e["contact"]]


def test_a_stop_of_a_guard_that_always_stops_is_needless():
    found = work((Plan(guard="stopper", needless=True), 5))
    assert [s["needless"] for s in found["stops"]] == [True, True]


def test_a_future_begins_as_its_operator_desires_and_ends_at_rest(bay):
    guard, scene = bay
    q, v = scene.home, np.full(14, 0.1)
    closing = np.tile([1.0, -1.0], 7)
    future = Future(closing, np.zeros(14), np.zeros(14))
    rows = guard._search.rows(future, q, v, np.zeros(2))
    assert (rows[0] == q).all() and (rows[-1] == rows[-2]).all()
    first = (rows[1] - rows[0]) / STEP
    assert np.allclose(first, 0.1 + closing * 8.0 * STEP / 2)
