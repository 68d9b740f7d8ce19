"""The judge sees contacts, and knows which arm is at fault."""

from dataclasses import replace

import numpy as np
import pytest

from armguard.scene.compile import compile_scene
from closed_loop.exact_world import ExactWorld
from closed_loop.judge import Judge
from closed_loop.judge_model import SIGHT
from closed_loop.scenes import build_scene
from closed_loop.settings import SUBSTEP, setting_of
from closed_loop.watch import AS_WELL, Watch, places
from peers.pinocchio_coal import AllDistances

FIRST = np.array([0, 7, 14])
AWAY = np.array([0.0, 0.0, 50.0])


@pytest.fixture(scope="module")
def arena():
    """The bay with moving objects, which are far away: judge and tables."""
    scene = build_scene(replace(setting_of("movers", "path", 0), floor=0.0))
    tables = compile_scene(scene)
    judge = Judge(scene, tables)
    for name in ("ball", "crate"):
        judge.stand_at(name, AWAY)
    return judge, tables


def watch(judge, q, **movers):
    return Watch(judge, FIRST, q, np.zeros(len(judge.owners)), movers)


def look(watching, q_rows, p_rows=None, begin=0):
    """Look at rows, and at those of one object if there is one, shape (k, 3)."""
    rows = np.zeros((len(q_rows), 0, 3)) if p_rows is None else p_rows[:, None, :]
    watching.look(begin, np.ascontiguousarray(q_rows), np.ascontiguousarray(rows))


def test_distances_are_those_of_pinocchio_and_coal(arena):
    judge, tables = arena
    for name in ("ball", "crate"):
        judge.stand_at(name, np.zeros(3))
    rng, peer = np.random.default_rng(0), AllDistances(tables)
    met = 0
    for _ in range(300):
        q = rng.uniform(tables.lower, tables.upper)
        peer.step(q)
        there = min(r.min_distance for r in peer.results.distanceResults)
        ours = judge.distance(q)
        assert (ours < 0.0) == (there < 0.0)
        if there >= 0.0:
            assert ours == pytest.approx(min(there, SIGHT), abs=2e-6)
        met += there < SIGHT
    for name in ("ball", "crate"):
        judge.stand_at(name, AWAY)
    assert met > 100


def test_an_arm_driven_into_something_is_a_contact(arena):
    judge, tables = arena
    q = tables.home.copy()
    watching = watch(judge, q)
    rows = q + np.linspace(0.0, 2.0, 4000)[:, None] * (np.arange(14) == 1)
    for begin in range(0, 4000, 4):
        look(watching, rows[begin : begin + 4], begin=begin)
    assert watching.contact is not None
    assert "left" in {watching.contact.a[:4], watching.contact.b[:4]}
    k = round(watching.contact.time / SUBSTEP) - 1
    assert judge.distance(rows[k]) < 0.0 <= judge.distance(rows[k - 1]) + 1e-9
    assert watching.contact.depth == pytest.approx(-watching.least)
    # Not every state was measured; none that could have been nearer was left out.
    assert watching.judged < 4000


def test_few_states_are_judged_and_the_least_distance_is_found(arena):
    judge, tables = arena
    rng = np.random.default_rng(3)
    for _ in range(5):
        a, b = rng.uniform(-0.4, 0.4, (2, 14))
        t = np.linspace(0.0, 1.0, 1000)[:, None]
        rows = tables.home + a * np.sin(3 * t) + b * np.sin(5 * t)
        watching = watch(judge, rows[0])
        look(watching, rows)
        least = min(judge.distance(q) for q in rows)
        if least > 0.0:
            assert least - 1e-12 <= watching.least <= least * 1.12 + 1e-9
        else:
            assert watching.contact is not None


def into_the_arm(judge, tables, steps=400):
    """Displacements that bring the ball from afar to the left arm's last link."""
    judge.place(tables.home)
    ball = tables.standing["ball"]
    centre = tables.local_rows[ball.first, 1:4]
    to = judge.tips()[0] - centre
    return np.linspace(to + np.array([0.0, 0.0, 0.6]), to, steps)


def test_no_arm_is_at_fault_when_an_object_hits_it_at_rest(arena):
    judge, tables = arena
    p_rows = into_the_arm(judge, tables)
    watching = watch(judge, tables.home, ball=p_rows[0])
    look(watching, np.tile(tables.home, (400, 1)), p_rows)
    assert judge.distance(tables.home) < 0.0
    assert watching.contact is None and watching.least == SIGHT
    # The other arm may move; it is not in the pair.
    rows = tables.home + 1e-5 * np.arange(400)[:, None] * (np.arange(14) == 13)
    look(watching, rows, np.tile(p_rows[-1], (400, 1)))
    assert watching.contact is None


def test_an_object_that_hits_a_moving_arm_counts(arena):
    judge, tables = arena
    p_rows = into_the_arm(judge, tables)
    watching = watch(judge, tables.home, ball=p_rows[0])
    rows = tables.home + 1e-5 * np.arange(400)[:, None] * (np.arange(14) == 6)
    look(watching, rows, p_rows)
    assert watching.contact is not None
    assert {watching.contact.a, watching.contact.b} & {"ball"}


def met_on_its_way(judge, q, rows, p_rows):
    """Watch an arm that rests for four states and then leaves, judged at the end."""
    watching = watch(judge, q, ball=p_rows[0])
    look(watching, np.tile(q, (4, 1)), p_rows[:4])
    watching.leaving[0] = True
    look(watching, rows[4:], p_rows[4:], begin=4)
    assert watching.contact is None and watching.met_at_rest == 0
    watching.judge_meetings(p_rows[:, None, :])
    return watching


def test_an_object_that_meets_the_resting_arm_as_well_is_no_contact(arena):
    judge, tables = arena
    p_rows = into_the_arm(judge, tables)
    rows = tables.home + 1e-5 * np.arange(400)[:, None] * (np.arange(14) == 6)
    watching = met_on_its_way(judge, tables.home, rows, p_rows)
    assert watching.contact is None and watching.met_at_rest == 1


def in_the_way(judge, tables):
    """States of an arm that runs into a ball on its way out, and where the ball is."""
    rows = tables.home + 1e-3 * np.arange(400)[:, None] * (np.arange(14) == 2)
    judge.place(rows[-1])
    ball = tables.standing["ball"]
    p = judge.tips()[0] - tables.local_rows[ball.first, 1:4]
    judge.stand_at("ball", p)
    assert judge.distance(tables.home) > 0.0 > judge.distance(rows[-1])
    return rows, np.tile(p, (400, 1))


def test_an_arm_that_runs_into_something_on_its_way_out_is_a_contact(arena):
    judge, tables = arena
    rows, p_rows = in_the_way(judge, tables)
    watching = met_on_its_way(judge, tables.home, rows, p_rows)
    assert watching.met_at_rest == 0
    assert {watching.contact.a, watching.contact.b} & {"ball"}
    k = round(watching.contact.time / SUBSTEP) - 1
    assert judge.distance(rows[k]) < 0.0 <= judge.distance(rows[k - 1]) + 1e-9
    assert watching.least == -watching.contact.depth < -0.01


@pytest.mark.parametrize(("late", "met"), [(0.97, 1), (1.03, 0)])
def test_the_resting_arm_has_to_be_met_within_a_tenth_of_a_second(arena, late, met):
    judge, tables = arena
    rows, p_rows = in_the_way(judge, tables)
    alone = met_on_its_way(judge, tables.home, rows, p_rows)
    touched = round(alone.contact.time / SUBSTEP)
    # So long after it met the arm the ball is where the arm rested.
    there = touched + round(late * AS_WELL / SUBSTEP)
    judge.place(tables.home)
    on_it = judge.tips()[0] - tables.local_rows[tables.standing["ball"].first, 1:4]
    stays = np.tile(rows[-1], (there + 1, 1))
    stays[:400] = rows
    goes = np.tile(p_rows[0], (there + 1, 1))
    goes[there] = on_it
    watching = met_on_its_way(judge, tables.home, stays, goes)
    assert watching.met_at_rest == met
    assert (watching.contact is None) == bool(met)


def test_an_object_goes_on_as_it_moved_last():
    rows = np.arange(5)[:, None] * np.array([0.1, 0.0, -0.2])
    found = np.array([*places(rows, 2, 6)])
    assert len(found) == 4 + round(AS_WELL / SUBSTEP) + 1
    expected = np.arange(2, 2 + len(found))[:, None] * np.array([0.1, 0.0, -0.2])
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_an_arm_that_starts_to_move_in_contact_counts(arena):
    judge, tables = arena
    p_rows = into_the_arm(judge, tables)
    watching = watch(judge, tables.home, ball=p_rows[0])
    look(watching, np.tile(tables.home, (400, 1)), p_rows)
    rows = tables.home + 1e-5 * np.arange(4)[:, None] * (np.arange(14) == 6)
    look(watching, rows, np.tile(p_rows[-1], (4, 1)))
    assert watching.contact is not None


def test_a_displaced_base_and_a_larger_surface_are_nearer(arena):
    judge, tables = arena
    q = tables.home.copy()
    before = []
    for pair in judge.pairs:
        judge.place(q)
        before.append(judge.gap(pair))
    T = np.eye(4)
    T[:3, 3] = [0.0, -0.01, 0.0]
    judge.displace_base("left", T)
    judge.place(q)
    arms = [
        (k, pair)
        for k, pair in enumerate(judge.pairs)
        if set(judge.arm_of[list(pair)]) == {0, 1}
    ]
    for k, pair in arms:
        assert abs(judge.gap(pair) - before[k]) <= 0.01 + 1e-9
    assert min(judge.gap(pair) - before[k] for k, pair in arms) < -0.008
    judge.displace_base("left", np.eye(4))
    judge.place(q)
    assert judge.gap(arms[0][1]) == pytest.approx(before[arms[0][0]], abs=1e-12)


def test_the_gradient_is_that_of_finite_differences(arena):
    judge, tables = arena
    rng = np.random.default_rng(5)
    for _ in range(20):
        q = tables.home + rng.uniform(-0.5, 0.5, 14)
        pair = judge.pairs[int(rng.integers(len(judge.pairs)))]
        judge.place(q)
        distance, outward = judge.apart(pair)
        if distance < 0.02:
            continue
        for j in range(14):
            step = 1e-5 * (np.arange(14) == j)
            judge.place(q + step)
            up = judge.gap(pair)
            judge.place(q - step)
            slope = (up - judge.gap(pair)) / 2e-5
            assert outward[j] == pytest.approx(slope, abs=2e-3)


def test_hulls_of_meshes_are_never_judged_farther_than_the_meshes():
    scene = build_scene(setting_of("pandas", "path", 0))
    tables = compile_scene(scene)
    judge, exact = Judge(scene, tables), ExactWorld(scene, tables)
    rng = np.random.default_rng(0)
    seen = touching = 0
    for _ in range(25):
        q = rng.uniform(tables.lower, tables.upper)
        there = exact.distances(q).min()
        ours = judge.distance(q)
        assert ours <= max(there, 0.0) + 1e-5
        # What a hull adds to a Panda's links.
        assert ours >= min(there, SIGHT) - 0.02 or there <= 0.0
        seen += 0.0 < there < SIGHT
        touching += there <= 0.0
    assert seen > 3 and touching > 3
