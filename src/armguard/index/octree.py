"""N-objects octree: a cube divided until no leaf holds more than N objects."""

from math import ceil, log2

import numpy as np
from numpy.typing import NDArray

from armguard.errors import OctreeError
from armguard.geometry.bounds import row_bounds
from armguard.index.octree_audit import audit
from armguard.index.octree_bulk import (
    BUILT,
    CLEAR,
    ENTRIES_SHORT,
    LISTS_SHORT,
    NODES_SHORT,
    build_tree,
    grown_extent,
)
from armguard.index.octree_query import candidate_bound, octree_candidates
from armguard.index.octree_state import (
    ABSENT,
    DEPTH_LIMIT,
    OVERFLOWED,
    STACK_ROOM,
    Counters,
    OctreeState,
    empty_state,
    state_with_room,
)
from armguard.index.octree_update import (
    octree_insert,
    octree_remove,
    octree_update,
)
from armguard.index.octree_walk import (
    corners,
    entries_of_moving,
    most_owners,
    walk_leaves,
)
from armguard.index.world import World
from armguard.kernel import kernel
from armguard.record import records

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# Spare capacity after a build, since a moving scene splits and merges leaves: multiple
# of the entries of the moving primitives, and least numbers of nodes and entries.
SPARE = 4
LEAST_NODES = 8 * 512
LEAST_ENTRIES = 8192

# Nodes or entries beyond which the depth is reduced instead: large objects that overlap
# would fill any memory with leaves of equal lists.
MOST_ROOM = 1 << 18

# Primitives that have an anchor even without a growth.
LEAST_ANCHORS = 1024


class Octree:
    """Index of primitives by the leaves of an octree that they overlap.

    The decomposition rule is the paper's: a leaf with more than N objects is split,
    eight leaves that hold at most N together are merged. The tree is canonical:
    structure and lists are a function of the present poses alone.

    Primitives with a growth count as moving: they have spare capacity, and each one up
    to the last of them has an anchor. Others may move as well, but each of their
    updates searches the tree.

    Args:
        world: Primitives of the index. Arrays are shared: the caller writes rows and
            boxes, and calls `update`.
        leaf_capacity: The paper's N.
        max_depth: Depth at which leaves are not split; chosen from the growth if None.
        cube: Centre and edge of the root [m]; chosen around the primitives if None,
            and enlarged if it does not contain them all.

    Raises:
        OctreeError: A setting is out of range, or a row is not finite.

    References:
        The paper, section 3; see docs/paper.md.
    """

    def __init__(
        self,
        world: World,
        *,
        leaf_capacity: int = 5,
        max_depth: int | None = None,
        cube: tuple[Floats, float] | None = None,
    ) -> None:
        if leaf_capacity < 1:
            raise OctreeError(f"leaf_capacity is {leaf_capacity}; it must be >= 1")
        if max_depth is not None and not 0 <= max_depth <= DEPTH_LIMIT:
            raise OctreeError(
                f"max_depth is {max_depth}; it must be from 0 to {DEPTH_LIMIT}"
            )
        if not np.isfinite(world.rows).all():
            raise OctreeError("a primitive's row is not finite")
        self.world = world
        self.leaf_capacity = leaf_capacity
        everyone = np.ones(len(world.kinds), dtype=np.bool_)
        self.low, self.high = root_corners(extent_of(everyone, world), cube)
        self.max_depth = (
            depth_for(float(self.high[0] - self.low[0]), world.growth)
            if max_depth is None
            else max_depth
        )
        self.state = self._build(everyone)

    def insert(self, i: int) -> None:
        """Add primitive i; the root cube grows if the primitive is outside.

        If the capacity is too small, the tree is rebuilt with more.

        Raises:
            OctreeError: The row of the primitive is not finite.
        """
        self._check_id(i)
        if not np.isfinite(self.world.rows[i]).all():
            raise OctreeError(f"the row of primitive {i} is not finite")
        if self._grow_cube(i):
            present = self.present
            present[i] = True
            self.state = self._build(present)
            return
        refused = int(self.state.counters[0].unsplit)
        octree_insert(i, self.world, self.state)
        overflowed = self.state.residency[i].status == OVERFLOWED
        if overflowed or self.state.counters[0].unsplit != refused:
            self.state = self._build(self.present)

    def remove(self, i: int) -> None:
        """Remove primitive i."""
        self._check_id(i)
        octree_remove(i, self.world, self.state)

    def update(self, i: int) -> None:
        """Update the tree after primitive i moved to its present row."""
        self._check_id(i)
        octree_update(i, self.world, self.state)

    def candidates(self, i: int) -> NDArray[np.int32]:
        """Ids of primitives that share a leaf with primitive i, ascending."""
        self._check_id(i)
        state = self.state
        state.header[0].token += 1
        out = np.zeros(candidate_bound(i, state), dtype=np.int32)
        token = int(state.header[0].token)
        found = octree_candidates(i, state, state.primitive_marks, token, out)
        return np.sort(out[:found])

    @property
    def present(self) -> Bools:
        """True for each primitive in the tree, shape (p,)."""
        return np.asarray(self.state.residency["status"] != ABSENT)

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays of the tree, without those of the world."""
        return sum(array.nbytes for array in self.state)

    def check(self) -> None:
        """Check every invariant; see `octree_audit`.

        Raises:
            OctreeError: The first invariant that is violated, in words.
        """
        audit(self.world, self.state)

    def leaves(self) -> NDArray[np.int32]:
        """Ids of the leaves, in the order of a walk from the root, children in turn."""
        out = np.zeros(int(self.state.header[0].nodes_used), dtype=np.int32)
        return out[: walk_leaves(self.state, out)].copy()

    def cells(self, nodes: NDArray[np.int32]) -> Floats:
        """Lower and upper corner of nodes, shape (k, 6) [m]."""
        out = np.zeros((len(nodes), 6))
        corners(self.state.nodes["place"][nodes], self.state.cube, out)
        return out

    def statistics(self) -> dict[str, object]:
        """Figures of the tree by name: nodes, leaves, depths, lists, memory."""
        state = self.state
        leaves = self.leaves()
        lengths = state.nodes["members"][leaves]
        depths = np.bincount(np.log2(state.nodes["place"][leaves]).astype(int) // 3)
        return {
            "kind": "octree",
            "leaf_capacity": self.leaf_capacity,
            "max_depth": self.max_depth,
            "cube_low": self.low.tolist(),
            "cube_edge": float(self.high[0] - self.low[0]),
            "primitives": int(self.present.sum()),
            "nodes": (len(leaves) - 1) // 7 + len(leaves),
            "leaves": len(leaves),
            "empty_leaves": int((lengths == 0).sum()),
            "leaves_at_depth": depths.tolist(),
            "entries": int(lengths.sum()),
            "mean_list": float(lengths.mean()),
            "longest_list": int(lengths.max()),
            "most_objects_in_a_leaf": int(most_owners(leaves, self.world, state)),
            "refused_splits": int(state.counters[0].unsplit),
            "overflowed_primitives": int(state.header[0].overflow_count),
            "node_room": [int(state.header[0].nodes_used), state.nodes.shape[0]],
            "entry_room": [int(state.header[0].entries_used), state.entries.shape[0]],
            "bytes": self.nbytes,
        }

    def _grow_cube(self, i: int) -> bool:
        """Enlarge the cube until it contains primitive i.

        An unbounded side of a primitive does not count: outermost leaves are unbounded.

        Returns:
            Whether the cube was enlarged.
        """
        box = np.zeros(6)
        world = self.world
        row_bounds(world.kinds[i], world.rows[i], world.growth[i], box)
        box[:3] = np.where(np.isneginf(box[:3]), self.low, box[:3])
        box[3:] = np.where(np.isposinf(box[3:]), self.high, box[3:])
        grown = False
        while (box[:3] < self.low).any() or (box[3:] > self.high).any():
            # Double the edge towards the side on which the primitive is outside.
            edge = self.high - self.low
            towards_low = box[:3] < self.low
            self.low = np.where(towards_low, self.low - edge, self.low)
            self.high = np.where(towards_low, self.high, self.high + edge)
            self.max_depth = min(self.max_depth + 1, DEPTH_LIMIT)
            grown = True
        return grown

    def _check_id(self, i: int) -> None:
        if not 0 <= i < len(self.world.kinds):
            raise OctreeError(
                f"there is no primitive {i}; there are {len(self.world.kinds)}"
            )

    def _build(self, present: Bools) -> OctreeState:
        """Tree of the present primitives, with spare capacity for moving ones."""
        world = self.world
        count = len(present)
        moving = np.flatnonzero(world.growth > 0.0)
        anchored = max(int(moving[-1]) + 1 if len(moving) else 0, LEAST_ANCHORS)
        extent = extent_of(present, world)
        reach = np.abs(np.concatenate([self.low, self.high, extent]))
        clear = CLEAR * float(reach[np.isfinite(reach)].max())
        # Pages that are never written take no memory, so the capacity may be generous.
        room = {
            NODES_SHORT: LEAST_NODES + 2 * count,
            ENTRIES_SHORT: LEAST_ENTRIES + 4 * count,
            LISTS_SHORT: LEAST_ENTRIES + 4 * count,
        }
        most = max(MOST_ROOM, 64 * count)
        masks = np.zeros(count, dtype=np.uint8)
        frames = np.zeros((STACK_ROOM, 3), dtype=np.int64)
        while True:
            state = empty_state(
                count,
                leaf_capacity=self.leaf_capacity,
                max_depth=self.max_depth,
                low=self.low,
                high=self.high,
                node_capacity=room[NODES_SHORT],
                entry_capacity=room[ENTRIES_SHORT],
                anchor_count=min(anchored, count),
            )
            lists = np.zeros(room[LISTS_SHORT], dtype=np.int32)
            answer = build_tree(present, clear, world, state, lists, masks, frames)
            if answer == BUILT:
                break
            if room[answer] <= most or self.max_depth == 0:
                room[answer] *= 2
            else:
                # Finer leaves inside many large objects do not separate them.
                self.max_depth -= 1
        state = state._replace(counters=records(1, Counters))
        held = SPARE * entries_of_moving(world, state)
        return state_with_room(
            state,
            spare_nodes=LEAST_NODES + 8 * held,
            spare_entries=LEAST_ENTRIES + held,
        )


@kernel(entry=True)
def insert_all(present: Bools, world: World, state: OctreeState) -> None:
    """Insert every primitive that is present, in order."""
    for i in range(present.shape[0]):
        if present[i]:
            octree_insert(i, world, state)


def extent_of(present: Bools, world: World) -> Floats:
    """Lower and upper corner of the grown primitives, shape (6,) [m]."""
    out = np.zeros(6)
    grown_extent(present, world, np.zeros(6), out)
    return out


def root_corners(
    extent: Floats, cube: tuple[Floats, float] | None
) -> tuple[Floats, Floats]:
    """Corners of a cube that contains an extent and the requested cube, (3,) [m]."""
    low, high = extent[:3], extent[3:]
    if cube is not None:
        centre, edge = np.asarray(cube[0], dtype=np.float64), float(cube[1])
        if not (np.isfinite(centre).all() and np.isfinite(edge) and edge > 0.0):
            raise OctreeError(
                f"cube has centre {centre} and edge {edge}; they must be finite, the "
                "edge > 0"
            )
        if (centre - edge / 2 <= low).all() and (high <= centre + edge / 2).all():
            return centre - edge / 2, centre + edge / 2
        low, high = (
            np.minimum(low, centre - edge / 2),
            np.maximum(high, centre + edge / 2),
        )
    if not (np.isfinite(low).all() and np.isfinite(high).all()):
        low, high = np.full(3, -0.5), np.full(3, 0.5)
    centre, half = (low + high) / 2, float((high - low).max()) / 2 * 1.001
    return centre - half, centre + half


def depth_for(edge: float, growth: Floats) -> int:
    """Depth at which a leaf is twice as large as a growth, at most DEPTH_LIMIT.

    Finer leaves would be inside the grown primitives: more lists, but few shorter ones.
    """
    largest = float(growth.max()) if len(growth) else 0.0
    if largest <= 0.0:
        return DEPTH_LIMIT // 2
    return int(min(max(ceil(log2(edge / largest)) - 1, 1), DEPTH_LIMIT))
