"""The octree: complete, canonical, self-auditing; attacked with random motion."""

import numpy as np
import pytest

from armguard.errors import OctreeError
from armguard.geometry import Box, Pose, Sphere
from armguard.geometry.bounds import row_bounds
from armguard.geometry.pairs import measure
from armguard.geometry.place import displacement
from armguard.geometry.shapes import shape_row
from armguard.index import BruteForce, Octree, World
from armguard.index import octree_state as places
from armguard.index.octree import insert_all
from armguard.index.octree_query import octree_candidates, primitives_in_box
from armguard.index.octree_state import empty_state
from armguard.index.octree_update import octree_update
from worlds import move, random_world

MOVING = 14


def missing_pairs(octree, world, moving, growth):
    """Pairs within the growth, by brute force, that the candidates lack."""
    out = np.zeros(10)
    missing = []
    for i in range(moving):
        if not octree.present[i]:
            continue
        found = set(octree.candidates(i).tolist())
        for j in range(len(world.kinds)):
            if j == i or not octree.present[j] or j in found:
                continue
            measure(world.kinds[i], world.rows[i], world.kinds[j], world.rows[j], out)
            if out[0] <= growth:
                missing.append((i, j, out[0]))
    return missing


def walk(seed, steps, every, **settings):
    """A random walk of insertions, moves, removals and jumps, audited on the way."""
    rng, shapes, poses, world = random_world(seed, 40, MOVING)
    octree = Octree(world, **settings)
    for k in range(steps):
        i = int(rng.integers(MOVING if rng.random() < 0.8 else 40))
        chance = rng.random()
        if chance < 0.05:
            octree.remove(i)
        elif chance < 0.12:
            octree.insert(i)
        else:
            step = 0.0 if rng.random() < 0.1 else 10.0 ** rng.uniform(-4.0, -0.7)
            move(rng, i, shapes, poses, world, step)
            octree.update(i)
        if k % every == 0:
            yield octree, world
    yield octree, world


@pytest.mark.parametrize("capacity", [1, 2, 5, 12, 20])
def test_every_invariant_holds_on_a_random_walk(capacity):
    for octree, _ in walk(capacity, 400, every=8, leaf_capacity=capacity):
        octree.check()


def test_no_near_pair_is_ever_missing():
    for octree, world in walk(7, 20_000, every=40):
        assert missing_pairs(octree, world, MOVING, 0.05) == []


def test_a_hundred_thousand_steps_leave_the_tree_a_fresh_one_would_be():
    for octree, world in walk(3, 100_000, every=10_000):
        octree.check()
        fresh = Octree(world, leaf_capacity=5, max_depth=octree.max_depth)
        fresh.low, fresh.high = octree.low, octree.high
        fresh.state = fresh._build(octree.present)
        assert picture_of(octree) == picture_of(fresh)
        assert octree.state.counters[0].unsplit == 0


def picture_of(octree):
    """Leaves by their cells, with their members: what canonical means."""
    state = octree.state
    leaves = {}
    found = octree.leaves()
    for leaf, cell in zip(found, octree.cells(found), strict=True):
        members, entry = [], state.nodes[leaf].link
        while entry != places.NONE:
            members.append(int(state.entries[entry].primitive))
            entry = state.entries[entry].next_in_leaf
        leaves[tuple(cell)] = sorted(members)
    return leaves


def test_the_slack_is_a_promise():
    """Move almost as far as the slack allows, in many directions: nothing changes."""
    rng, shapes, poses, world = random_world(9, 40, MOVING)
    octree = Octree(world)
    for k in range(3000):
        i = int(rng.integers(MOVING))
        before = poses[i].copy()
        anchor = octree.state.anchors[i]
        away = displacement(world.kinds[i], anchor, world.rows[i])
        room = float(octree.state.slack[i]) - away
        if room <= 1e-9:
            octree.update(i)
            continue
        direction = rng.normal(size=3)
        poses[i][:3, 3] += 0.999999 * room * direction / np.linalg.norm(direction)
        world.rows[i] = shape_row(shapes[i], poses[i])
        row_bounds(world.kinds[i], world.rows[i], 0.0, world.boxes[i])
        skipped = octree.state.counters[0].skipped
        octree.update(i)
        assert octree.state.counters[0].skipped == skipped + 1
        if k % 30 == 0:
            octree.check()
        poses[i][:] = before
        move(rng, i, shapes, poses, world, 0.02)
        octree.update(i)


def test_what_leaves_the_cube_is_not_lost():
    _, shapes, poses, world = random_world(4, 30, MOVING)
    octree = Octree(world)
    for i in (0, 1):
        poses[i][:3, 3] = (50.0 + 0.1 * i, 0.0, 0.0)
        world.rows[i] = shape_row(shapes[i], poses[i])
        row_bounds(world.kinds[i], world.rows[i], 0.0, world.boxes[i])
        octree.update(i)
    octree.check()
    assert 1 in octree.candidates(0)
    assert missing_pairs(octree, world, MOVING, 0.05) == []


def test_the_cube_grows_when_something_is_inserted_outside():
    _, shapes, poses, world = random_world(4, 30, MOVING)
    octree = Octree(world)
    edge = octree.high[0] - octree.low[0]
    octree.remove(20)
    poses[20][:3, 3] = (-30.0, 5.0, 0.0)
    world.rows[20] = shape_row(shapes[20], poses[20])
    row_bounds(world.kinds[20], world.rows[20], 0.0, world.boxes[20])
    octree.insert(20)
    octree.check()
    assert octree.high[0] - octree.low[0] > edge
    assert octree.present.all()


def spheres(centres, radius=0.05, growth=0.02, owners=None):
    """A world of equal spheres."""
    centres = np.asarray(centres, dtype=float)
    count = len(centres)
    rows = np.array(
        [shape_row(Sphere(radius=radius), Pose(xyz=tuple(c)).matrix()) for c in centres]
    ).reshape(-1, 16)
    world = World(
        kinds=np.zeros(count, dtype=np.int32),
        rows=rows,
        boxes=np.zeros((count, 6)),
        owners=np.arange(count, dtype=np.int32) if owners is None else owners,
        growth=np.full(count, growth),
    )
    for i in range(count):
        row_bounds(0, rows[i], 0.0, world.boxes[i])
    return world


def test_boxes_in_one_place_are_split_only_to_the_depth_limit():
    octree = Octree(spheres(np.zeros((30, 3))), leaf_capacity=2, max_depth=4)
    octree.check()
    assert octree.statistics()["most_objects_in_a_leaf"] == 30
    assert octree.candidates(0).tolist() == list(range(1, 30))


def test_large_boxes_that_overlap_fill_no_memory_with_leaves():
    world = spheres(np.zeros((12, 3)), radius=40.0, growth=0.0)
    octree = Octree(world, leaf_capacity=2, max_depth=10)
    octree.check()
    assert octree.max_depth < 10
    assert octree.nbytes < 200 << 20
    assert octree.candidates(0).tolist() == list(range(1, 12))


def test_parts_of_one_object_count_once():
    world = spheres(np.zeros((30, 3)), owners=np.zeros(30, dtype=np.int32))
    assert Octree(world, leaf_capacity=2).statistics()["leaves"] == 1


@pytest.mark.parametrize(("nodes", "entries"), [(1, 400), (9, 60), (4097, 25)])
def test_a_tree_without_room_is_slow_but_complete(nodes, entries):
    rng, shapes, poses, world = random_world(13, 40, MOVING)
    octree = Octree(world)
    octree.state = empty_state(
        40,
        leaf_capacity=2,
        max_depth=6,
        low=octree.low,
        high=octree.high,
        node_capacity=nodes,
        entry_capacity=entries,
    )
    insert_all(np.ones(40, dtype=bool), world, octree.state)
    for _ in range(300):
        i = int(rng.integers(MOVING))
        move(rng, i, shapes, poses, world, 0.05)
        octree.update(i)
        assert missing_pairs(octree, world, MOVING, 0.05) == []
    octree.check()


def test_a_tree_recovers_when_there_is_room_again():
    world = spheres(np.random.default_rng(0).uniform(-1, 1, (12, 3)))
    octree = Octree(world, leaf_capacity=1)
    octree.state = empty_state(
        12, leaf_capacity=1, max_depth=3, low=octree.low, high=octree.high,
        node_capacity=1, entry_capacity=8,
    )  # fmt: skip
    insert_all(np.ones(12, dtype=bool), world, octree.state)
    assert octree.statistics()["overflowed_primitives"] == 4
    for i in range(4):
        octree.remove(i)
    for i in range(4, 12):
        octree_update(i, world, octree.state)
    assert octree.statistics()["overflowed_primitives"] == 0
    octree.check()


def corrupted():
    """Each way to break an octree, and what the audit says."""

    def slack(state):
        state.slack[0] += 0.5

    def lost_member(state):
        leaf = state.entries[state.residency[0].first_entry].leaf
        state.nodes[leaf].link = state.entries[state.nodes[leaf].link].next_in_leaf

    def miscount(state):
        leaf = state.entries[state.residency[0].first_entry].leaf
        state.nodes[leaf].members += 1

    def wrong_place(state):
        state.nodes[3].place += 1

    def unlinked_back(state):
        entry = state.residency[0].first_entry
        state.entries[entry].previous_of_primitive = 7

    def wrong_parent(state):
        state.nodes[1].parent = 4

    def lost_entries(state):
        state.header[0].entries_used += 1

    def miscounted_free(state):
        state.header[0].free_entries -= 1

    def lost_nodes(state):
        state.header[0].nodes_used += 8

    def smaller_capacity(state):
        state.rule[0].leaf_capacity = 2

    def larger_capacity(state):
        state.rule[0].leaf_capacity = 39

    return [
        (slack, "by its slack"),
        (lost_member, "miscounts"),
        (miscount, "miscounts"),
        (wrong_place, "misplaced"),
        (unlinked_back, "linked back"),
        (wrong_parent, "wrong parent"),
        (lost_entries, "entries are lost"),
        (miscounted_free, "free entries"),
        (lost_nodes, "nodes are lost"),
        (smaller_capacity, "should be split"),
        (larger_capacity, "should be a leaf"),
    ]


@pytest.mark.parametrize(("break_it", "says"), corrupted(), ids=lambda x: str(x)[:20])
def test_the_audit_finds_what_is_broken(break_it, says):
    _, _, _, world = random_world(2, 40, MOVING)
    octree = Octree(world)
    octree.check()
    break_it(octree.state)
    with pytest.raises(OctreeError, match=says):
        octree.check()


def test_the_audit_finds_a_primitive_that_moved_without_an_update():
    _, shapes, poses, world = random_world(2, 40, MOVING)
    octree = Octree(world)
    poses[0][:3, 3] += 0.7
    world.rows[0] = shape_row(shapes[0], poses[0])
    row_bounds(world.kinds[0], world.rows[0], 0.0, world.boxes[0])
    with pytest.raises(OctreeError, match="primitive 0"):
        octree.check()


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"leaf_capacity": 0}, "leaf_capacity is 0; it must be >= 1"),
        ({"max_depth": 11}, "max_depth is 11; it must be from 0 to 10"),
        ({"cube": (np.zeros(3), -1.0)}, "edge"),
        ({"cube": (np.full(3, np.nan), 1.0)}, "finite"),
    ],
)
def test_settings_out_of_range_are_refused(settings, says):
    with pytest.raises(OctreeError, match=says):
        Octree(spheres([[0, 0, 0]]), **settings)


def test_a_row_that_is_not_finite_is_refused():
    world = spheres([[0, 0, 0], [1, 0, 0]])
    world.rows[1, 2] = np.nan
    with pytest.raises(OctreeError, match="not finite"):
        Octree(world)


def test_an_unknown_id_is_refused():
    with pytest.raises(OctreeError, match="no primitive 3; there are 1"):
        Octree(spheres([[0, 0, 0]])).candidates(3)


def test_brute_force_offers_every_box_that_is_present():
    brute = BruteForce(spheres(np.zeros((5, 3))))
    brute.remove(3)
    assert brute.candidates(0).tolist() == [1, 2, 4]
    brute.insert(3)
    brute.check()
    assert brute.candidates(0).tolist() == [1, 2, 3, 4]
    assert brute.statistics()["primitives"] == 5


def test_candidates_are_each_met_once():
    _, _, _, world = random_world(21, 40, MOVING)
    octree = Octree(world)
    out, seen = np.zeros(40, dtype=np.int32), np.zeros(40, dtype=np.int64)
    for i in range(MOVING):
        found = octree_candidates(i, octree.state, seen, i + 1, out)
        ids = out[:found].tolist()
        assert len(set(ids)) == len(ids)
        assert i not in ids


def boxes_to_look_in(octree):
    """Boxes inside the cube, across its faces, outside, and at the edges of cells."""
    rng = np.random.default_rng(8)
    low, edge = octree.low, octree.high - octree.low
    for _ in range(150):
        corners = low + edge * rng.uniform(-0.4, 1.4, (2, 3))
        yield np.concatenate([corners.min(axis=0), corners.max(axis=0)])
    for away in np.concatenate([np.eye(3), -np.eye(3)]):
        centre = low + 0.5 * edge + 3.0 * edge * away
        yield np.concatenate([centre - 0.1 * edge, centre + 0.1 * edge])
    for cell in octree.cells(octree.leaves())[:60]:
        yield np.concatenate([cell[3:], cell[3:] + 0.01])
        yield np.concatenate([cell[:3] - 0.01, cell[:3]])


def test_what_is_found_in_a_box_is_what_the_leaves_that_it_meets_hold():
    _, _, _, world = random_world(5, 40, MOVING)
    octree = Octree(world, leaf_capacity=1)
    leaves = picture_of(octree)
    assert len(leaves) > 50
    out, seen = np.zeros(40, dtype=np.int32), np.zeros(40, dtype=np.int64)
    for token, box in enumerate(boxes_to_look_in(octree), start=1):
        # What is outside is in the outermost leaves.
        a, b = np.clip(box.reshape(2, 3), octree.low, octree.high)
        known = {
            i
            for cell, members in leaves.items()
            if (np.array(cell[:3]) <= b).all() and (np.array(cell[3:]) >= a).all()
            for i in members
        }
        i = token % 40
        found = primitives_in_box(i, box.copy(), octree.state, seen, token, out)
        ids = out[:found].tolist()
        assert sorted(ids) == sorted(known - {i})


def test_a_box_without_a_corner_is_looked_at_to_the_far_end():
    _, _, _, world = random_world(5, 40, MOVING)
    octree = Octree(world, leaf_capacity=1)
    out, seen = np.zeros(40, dtype=np.int32), np.zeros(40, dtype=np.int64)
    whole = np.concatenate([octree.low, octree.high])
    for k in range(6):
        box, token = whole.copy(), k + 1
        box[k] = np.nan
        assert primitives_in_box(0, box, octree.state, seen, token, out) == 39


def test_an_empty_world_has_one_leaf():
    octree = Octree(spheres(np.zeros((0, 3))))
    octree.check()
    assert octree.statistics()["leaves"] == 1


def test_a_box_inhabits_the_leaves_it_overlaps_and_no_others():
    """A thin plate across the diagonal: its bounding box would fill the cube."""
    shape = Box(size=(2.4, 2.4, 0.002))
    world = spheres(np.random.default_rng(1).uniform(-0.9, 0.9, (60, 3)), growth=0.0)
    T = Pose(rpy=(np.pi / 4, 0, 0)).matrix()
    world.kinds[0], world.rows[0] = int(shape.kind), shape_row(shape, T)
    row_bounds(world.kinds[0], world.rows[0], 0.0, world.boxes[0])
    octree = Octree(world, leaf_capacity=2, max_depth=4)
    octree.check()
    held = sum(0 in members for members in picture_of(octree).values())
    assert held < 0.5 * octree.statistics()["leaves"]


def test_a_batch_of_moves_leaves_a_canonical_tree_too():
    """All primitives are moved first and updated one by one, as the cycle does it.

    A split in between sees members where they are now, not where their lists say: a
    member may be in none of the children, and the split needless (found by jumps).
    """
    rng, shapes, poses, world = random_world(17, 40, MOVING)
    octree = Octree(world, leaf_capacity=3)
    for k in range(400):
        for i in range(MOVING):
            move(rng, i, shapes, poses, world, 0.0 if k % 3 else 0.1)
        for i in range(MOVING):
            octree.update(i)
        if k % 8 == 0:
            octree.check()
            assert missing_pairs(octree, world, MOVING, 0.05) == []
