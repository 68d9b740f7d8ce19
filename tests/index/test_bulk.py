"""A tree built at once is the one that single insertions give; a million fit."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from armguard.geometry import Box, Pose, ShapeKind
from armguard.geometry.bounds import row_bounds
from armguard.geometry.pairs import measure
from armguard.geometry.shapes import shape_row
from armguard.index import Octree, World
from armguard.index import octree_state as places
from armguard.index.octree import insert_all
from armguard.index.octree_bulk import box_meets_cell
from armguard.index.octree_cell import cell_at, grown_gap
from armguard.index.octree_state import empty_state
from speed.scenes import boxes_world
from worlds import move, random_world

SPHERE, BOX = int(ShapeKind.SPHERE), int(ShapeKind.BOX)


def picture_of(state):
    """Leaves by their places, with their members: what canonical means."""
    leaves = {}
    nodes = {name: state.nodes[name].tolist() for name in ("members", "link", "place")}
    of, after = (state.entries[x].tolist() for x in ("primitive", "next_in_leaf"))
    stack = [0]
    while stack:
        node = stack.pop()
        if nodes["members"][node] == places.DIVIDED:
            stack += range(nodes["link"][node], nodes["link"][node] + 8)
            continue
        members, entry = [], nodes["link"][node]
        while entry != places.NONE:
            members.append(of[entry])
            entry = after[entry]
        leaves[nodes["place"][node]] = sorted(members)
    return leaves


def inserted_one_by_one(octree):
    """A tree of the same cube and rule, by single insertions."""
    count = len(octree.world.kinds)
    state = empty_state(
        count,
        leaf_capacity=octree.leaf_capacity,
        max_depth=octree.max_depth,
        low=octree.low,
        high=octree.high,
        node_capacity=1 + 8 * 50_000,
        entry_capacity=400_000,
    )
    insert_all(octree.present, octree.world, state)
    assert state.counters[0].unsplit == 0
    return state


def assert_same_tree(octree):
    one_by_one = inserted_one_by_one(octree)
    assert picture_of(octree.state) == picture_of(one_by_one)
    return one_by_one


def assert_same_tree_and_slack(octree):
    one_by_one = assert_same_tree(octree)
    # A cell on the way down that was a leaf once may have lowered the slack of single
    # insertions further than any cell there is now.
    held = len(octree.state.slack)
    assert (one_by_one.slack[:held] <= octree.state.slack + 1e-12).all()


@pytest.mark.parametrize("capacity", [1, 2, 5, 20])
@pytest.mark.parametrize("moving", [0, 14, 60])
@pytest.mark.parametrize("seed", range(5))
def test_a_tree_built_at_once_is_that_of_single_insertions(seed, moving, capacity):
    _, _, _, world = random_world(seed, 60, moving)
    octree = Octree(world, leaf_capacity=capacity, max_depth=6)
    assert_same_tree_and_slack(octree)
    octree.check()


@pytest.mark.parametrize("seed", range(3))
def test_so_it_is_for_boxes_that_lie_on_the_planes_between_cells(seed):
    """Aligned boxes of whole steps in a cube of whole steps: faces touch everywhere."""
    rng = np.random.default_rng(seed)
    count = 300
    world = boxes_world(0, count, 0.0)
    world.rows[:, 1:4] = rng.integers(-32, 33, (count, 3)) / 16.0
    world.rows[:, 4:7] = rng.integers(1, 4, (count, 3)) / 16.0
    world.rows[:, 7:16] = np.eye(3).reshape(9)
    # Some are turned by a quarter, with the rounding of a rotation matrix.
    quarter = Rotation.from_euler("xyz", [90, 90, 0], degrees=True).as_matrix()
    world.rows[::3, 7:16] = quarter.reshape(9)
    world.growth[:40] = 1.0 / 16.0
    for i in range(count):
        row_bounds(world.kinds[i], world.rows[i], 0.0, world.boxes[i])
    assert_same_tree_and_slack(Octree(world, cube=(np.zeros(3), 8.0), max_depth=7))


def test_so_it_is_for_long_thin_boxes_and_for_parts_of_one_object():
    rng = np.random.default_rng(3)
    world = boxes_world(20, 800, 0.05)
    world.rows[:, 1:4] = rng.uniform(-2.0, 2.0, (820, 3))
    world.rows[:, 4:7] *= rng.choice([0.05, 1.0, 8.0], (820, 3))
    world.owners[:] = np.arange(820) // 3
    for i in range(820):
        row_bounds(world.kinds[i], world.rows[i], 0.0, world.boxes[i])
    assert_same_tree_and_slack(Octree(world, max_depth=7))


def test_what_is_plain_to_see_agrees_with_the_exact_gap():
    """And is plain nearly always: the exact test is the exception."""
    world = boxes_world(0, 3000, 0.0, seed=5)
    world.rows[:, 1:4] = np.random.default_rng(6).uniform(-0.2, 0.2, (3000, 3))
    world.rows[::7, 0] = 0.03
    state = empty_state(
        3000,
        leaf_capacity=1,
        max_depth=10,
        low=np.full(3, -0.4),
        high=np.full(3, 0.4),
        node_capacity=1,
        entry_capacity=1,
    )
    answers = []
    for i in range(3000):
        row_bounds(BOX, world.rows[i], 0.0, world.boxes[i])
        # Cells of 0.2 m that are nowhere at the border.
        place = (((1 << 3) + 7 * (i & 1)) << 3) + 7 * (1 - (i & 1))
        gap = grown_gap(i, place, world, state)
        cell = cell_at(place, state.cube)
        answer = box_meets_cell(world.rows[i], 0.0, cell, 1e-10)
        assert answer == 0 or (answer < 0) == (gap > 0.0)
        answers.append(answer)
    assert answers.count(1) > 300
    assert answers.count(-1) > 300
    # Rounded boxes near an edge or a corner are left to the exact test.
    assert answers.count(0) < 100


def test_a_row_that_is_no_number_is_left_to_the_exact_test():
    world = boxes_world(0, 1, 0.0)
    world.rows[0, 9] = np.nan
    cell = (-1.0, -1.0, -1.0, 1.0, 1.0, 1.0)
    world.rows[0, 1:4] = 1.0
    assert box_meets_cell(world.rows[0], 0.0, cell, 1e-10) == 0


def test_a_stationary_box_costs_less_than_three_hundred_bytes():
    """Boxes of a million, as sparse: the tree's share does not depend on how many."""
    world = boxes_world(14, 100_000, 0.05)
    octree = Octree(world)
    bytes_of_world = sum(array.nbytes for array in world)
    assert (octree.nbytes + bytes_of_world) / len(world.kinds) <= 300.0
    # Room for moving boxes is not a multiple of that for stationary ones.
    nodes, entries = octree.state.nodes, octree.state.entries
    header = octree.state.header
    assert len(nodes) - header[0].nodes_used < 20_000
    assert len(entries) - header[0].entries_used < 20_000


def test_a_thousand_moving_boxes_are_all_kept():
    movers, standing = 1000, 3000
    world = boxes_world(movers, standing, 0.05)
    rng = np.random.default_rng(0)
    # Some of those that stand are where the others move.
    world.rows[movers : movers + 500, 1:4] = rng.uniform(-2.0, 2.0, (500, 3))
    for i in range(movers, movers + 500):
        row_bounds(BOX, world.rows[i], 0.0, world.boxes[i])
    octree = Octree(world)
    out = np.zeros(10)
    near = 0
    for _ in range(8):
        steps = rng.normal(size=(movers, 3)) * 10.0 ** rng.uniform(-4, -1, (movers, 1))
        world.rows[:movers, 1:4] += steps
        for i in range(movers):
            row_bounds(BOX, world.rows[i], 0.0, world.boxes[i])
        for i in range(movers):
            octree.update(i)
        for i in range(0, movers, 5):
            low, high = world.boxes[i, :3] - 0.05, world.boxes[i, 3:] + 0.05
            meet = (world.boxes[:, :3] <= high) & (world.boxes[:, 3:] >= low)
            found = set(octree.candidates(i).tolist())
            for j in np.flatnonzero(meet.all(axis=1)):
                if j == i:
                    continue
                a, b = sorted((i, int(j)))
                measure(BOX, world.rows[a], BOX, world.rows[b], out)
                if out[0] <= 0.05:
                    near += 1
                    assert j in found
    assert near > 1000
    assert octree.statistics()["overflowed_primitives"] == 0
    assert_same_tree(octree)


def floor_and_spheres():
    """A floor in thousands of leaves, and small boxes on it, of which three move."""
    rng = np.random.default_rng(8)
    world = boxes_world(3, 3000, 0.05)
    world.rows[:, 1:4] = rng.uniform(-3.0, 3.0, (3003, 3))
    world.rows[:, 3] = 0.03
    world.rows[:, 4:7] = 0.02
    floor = shape_row(Box(size=(8.0, 8.0, 0.02)), Pose().matrix())
    world.rows[2000] = floor
    for i in range(3003):
        row_bounds(BOX, world.rows[i], 0.0, world.boxes[i])
    return world


def test_what_has_no_anchor_may_be_moved_all_the_same():
    world = floor_and_spheres()
    octree = Octree(world, max_depth=8)
    assert 2000 >= len(octree.state.anchors)
    assert len(octree.candidates(2000)) == 3002
    world.rows[2000, 3] = -0.5
    row_bounds(BOX, world.rows[2000], 0.0, world.boxes[2000])
    octree.update(2000)
    assert_same_tree(octree)
    assert len(octree.candidates(2000)) < 100


@pytest.mark.parametrize("room", [1, 50, 8192])
def test_more_leaves_than_a_search_has_room_for(room):
    """A long list is taken apart without scratch; too long a one overflows."""
    world = floor_and_spheres()
    octree = Octree(world, max_depth=8)
    octree.state = octree.state._replace(
        found=np.zeros(room, dtype=np.int32), left=np.zeros(room, dtype=np.int32)
    )
    octree.update(2000)
    overflowed = octree.statistics()["overflowed_primitives"]
    assert overflowed == (0 if room == 8192 else 1)
    assert len(octree.candidates(2000)) == 3002
    octree.remove(2000)
    assert octree.statistics()["overflowed_primitives"] == 0
    assert 2000 not in octree.candidates(0)
    octree.insert(2000)
    assert octree.statistics()["overflowed_primitives"] == 0
    assert_same_tree(octree)


def test_an_insertion_without_room_builds_anew():
    rng, shapes, poses, world = random_world(13, 40, 14)
    octree = Octree(world, leaf_capacity=2)
    octree.remove(20)
    state = octree.state
    octree.state = state._replace(nodes=state.nodes[: state.header[0].nodes_used])
    octree.state.header[0].free_entries = 0
    move(rng, 20, shapes, poses, world, 0.3)
    octree.insert(20)
    octree.check()
    assert octree.statistics()["overflowed_primitives"] == 0
    assert_same_tree(octree)


def test_a_world_without_end_has_a_cube():
    """A bounding box without end does not stretch the cube."""
    kinds = np.array([int(SPHERE)] * 3, dtype=np.int32)
    world = World(
        kinds=kinds,
        rows=np.zeros((3, 16)),
        boxes=np.zeros((3, 6)),
        owners=np.arange(3, dtype=np.int32),
        growth=np.full(3, np.inf),
    )
    octree = Octree(world, max_depth=2)
    assert np.isfinite(octree.high - octree.low).all()
    octree.remove(0)
    octree.insert(0)
    assert octree.candidates(0).tolist() == [1, 2]
