"""No pair that matters is left out: answers are those of a search of all pairs."""

import numpy as np
import pytest

from armguard.address import array_at, stack
from armguard.geometry.pairs import measure
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.guard import Monitor
from armguard.guard.initial import all_pairs, listed_pairs, pairs_at_rest
from armguard.guard.near_pairs import may_meet
from armguard.guard.needs import LOOK_AHEAD
from armguard.guard.search_distance import pair_look
from armguard.guard.static_errors import static_needs
from armguard.guard.workspace import open_workspace
from armguard.kernel import kernel
from armguard.lanes import WIDTH, load
from armguard.respond import Guard
from armguard.scene import bay_scene, two_pandas_scene
from armguard.scene.compile import compile_scene

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


@kernel(entry=True)
def meeting(lines, out):
    """Bits of each block's pairs that may meet."""
    v = open_workspace(lines).watch
    for b in range(len(out)):
        out[b] = may_meet(b, load(v.block_need[b], 0), v)


@kernel(entry=True)
def looks(lines, pairs, needs, out):
    """What is known of pairs before they are measured, shape (k, 3)."""
    w = open_workspace(lines)
    for k in range(len(pairs)):
        out[k] = pair_look(int(pairs[k, 0]), int(pairs[k, 1]), needs[k], w)


@pytest.mark.parametrize("name", SCENES)
def test_blocks_list_every_pair_once_with_its_need(name):
    tables = compile_scene(scene_of(name, 0.03))
    errors = pairs_at_rest(tables)
    link, robot = errors["link_error"], errors["robot_error"]
    found = listed_pairs(tables, link, robot)
    rows = zip(found["pair_blocks"], found["block_need"], strict=True)
    listed = [
        (i, first + lane, needs[lane])
        for (i, first, bits), needs in rows
        for lane in range(WIDTH)
        if bits >> lane & 1
    ]
    pairs = all_pairs(tables)
    needs = static_needs(pairs, link, robot, tables)
    known = [(i, j, need) for (i, j), need in zip(pairs, needs, strict=True)]
    assert listed == known


@pytest.mark.parametrize("name", SCENES)
def test_pairs_whose_swept_boxes_are_apart_are_sorted_out_and_no_others(name):
    guard = Monitor(scene_of(name, 0.03), self_test=False)
    watch, rng = guard._watch, np.random.default_rng(2)
    blocks, out = watch.pair_blocks, np.zeros(len(watch.pair_blocks), dtype=np.int64)
    apart = near = 0
    for _ in range(20):
        corner = rng.uniform(-0.25, 0.25, (3, watch.swept.shape[1]))
        watch.swept[:3], watch.swept[3:] = corner, corner + 0.2
        unknown = rng.integers(0, len(guard.tables.kinds))
        watch.swept[:, unknown] = np.nan
        meeting(guard._lines, out)
        for (i, first, bits), needs, found in zip(
            blocks, watch.block_need, out, strict=True
        ):
            for lane in range(WIDTH):
                j = first + lane
                if not bits >> lane & 1:
                    assert not found >> lane & 1
                    continue
                a, b = watch.swept[:, i], watch.swept[:, j]
                gap = np.maximum(a[:3] - b[3:], b[:3] - a[3:]).max()
                assert (found >> lane & 1 == 0) == (gap > needs[lane])
                apart, near = apart + (gap > needs[lane]), near + (gap <= needs[lane])
                if unknown in (i, j):
                    assert found >> lane & 1
    assert apart > 1000
    assert near > 1000


@kernel(entry=True)
def write_distances(lines, pairs, out):
    """Distance of each pair of primitives, where the last cycle placed them [m]."""
    world = open_workspace(lines).world
    witness = array_at(stack(WITNESS_WIDTH), (WITNESS_WIDTH,), np.float64)
    for k in range(len(pairs)):
        i, j = pairs[k, 0], pairs[k, 1]
        rows, kinds = world.rows, world.kinds
        measure(kinds[i], rows[i], kinds[j], rows[j], witness)
        out[k] = witness[0]


def distances(guard, q, pairs):
    """Distance of each pair of primitives at a position of the joints [m]."""
    guard.reset()
    for now in (0.0, PERIOD):
        guard.step(q, now, velocity=np.zeros(len(q)), now=now)
    out = np.zeros(len(pairs))
    write_distances(guard._lines, pairs, out)
    return out


def test_a_pair_is_sorted_out_by_its_middle_only_if_it_keeps_the_look_ahead():
    scene = scene_of("two Pandas", 0.005)
    guard = Monitor(scene, budget=100_000, self_test=False)
    driver = Guard(scene, self_test=False)
    still = Monitor(scene, self_test=False)
    tables, watch, rng = driver.tables, guard._watch, np.random.default_rng(5)
    window = LOOK_AHEAD * watch.timing.slow_time
    top = np.concatenate([part.stopping.velocity for part in tables.robots])
    pairs = all_pairs(tables)
    needs = static_needs(pairs, watch.link_error, watch.robot_error, tables)
    found, again = np.zeros((2, len(pairs), 3))
    q, velocity, desired = driver.home.copy(), 0.0 * top, 0.0 * top
    spare, tried = [], 0
    for k in range(800):
        if k % 100 == 0:
            desired = top * rng.uniform(-1.0, 1.0, len(top))
        now = k * PERIOD
        guard.step(q, now, velocity=velocity, now=now)
        if k % 20 == 0:
            looks(guard._lines, pairs, needs, found)
            before, after = (
                distances(still, q + time * velocity, pairs) for time in (0.0, 1e-5)
            )
            closing = np.maximum(before - after, 0.0) / 1e-5
            out = (found[:, 1] < 0.0) & (found[:, 2] > -np.inf)
            spare += list((found[:, 2] - needs - window * closing)[out])
            # With so much more to keep the look-ahead does not fit any more.
            known = (found[:, 2] > -np.inf) & (closing > 0.01)
            more = np.where(known, found[:, 2] - 0.5 * window * closing, needs)
            looks(guard._lines, pairs, more, again)
            assert not ((again[:, 1] < 0.0) & (again[:, 2] > -np.inf))[known].any()
            tried += (again[:, 2] > -np.inf)[known].sum()
        command = driver.filter(q, desired, now, velocity=velocity, now=now)
        velocity = command.velocity.copy()
        q = q + PERIOD * velocity
    assert len(spare) > 1000
    assert min(spare) >= 0.0
    assert tried > 1000
