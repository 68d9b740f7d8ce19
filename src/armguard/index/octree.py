"""The N-objects octree: a cube divided until no leaf holds more than N primitives."""

from math import ceil, log2

import numpy as np
from numpy.typing import NDArray

from armguard.errors import OctreeError
from armguard.geometry.bounds import row_bounds
from armguard.index.octree_audit import audit
from armguard.index.octree_query import octree_candidates
from armguard.index.octree_shape import count_owners
from armguard.index.octree_state import (
    ABSENT,
    COUNT,
    COUNT_UNSPLIT,
    DEPTH,
    ENTRIES_USED,
    FIRST_CHILD,
    FREE_ENTRIES,
    LEAF,
    NODES_USED,
    OVERFLOW_COUNT,
    STATUS,
    TOKEN,
    OctreeState,
    empty_state,
)
from armguard.index.octree_update import (
    octree_insert,
    octree_remove,
    octree_update,
)
from armguard.index.world import World
from armguard.kernel import kernel

Floats = NDArray[np.float64]

# Deeper than this a leaf of a ten metre cube is 1 cm [-].
DEPTH_LIMIT = 10

# Room beyond what the first build needed: a scene in motion splits and merges.
SPARE = 4
LEAST_NODES = 1 + 8 * 512
LEAST_ENTRIES = 8192


class Octree:
    """Index of primitives by the leaves of an octree they inhabit.

    The decomposition rule is the paper's: a leaf with more than N primitives is split,
    eight leaves that hold at most N together are merged. Structure and lists are a
    function of where the primitives are, never of how they got there.

    Args:
        world: The primitives. Arrays are shared: the caller writes rows and boxes, and
            calls `update`.
        leaf_capacity: The paper's N.
        max_depth: Leaves at this depth are not split; chosen from the growth if None.
        cube: Centre and edge of the root [m]; chosen around the primitives if None,
            and enlarged if it does not hold them all.

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
        count = len(world.kinds)
        self._seen = np.zeros(count, dtype=np.int64)
        self._token = 0
        self._out = np.zeros(max(count, 1), dtype=np.int32)
        boxes = grown_boxes(world)
        self.low, self.high = root_corners(boxes, cube)
        self.max_depth = (
            depth_for(float(self.high[0] - self.low[0]), world.growth)
            if max_depth is None
            else max_depth
        )
        self.state = self._build(np.ones(count, dtype=np.bool_))

    def insert(self, i: int) -> None:
        """Take primitive i in; the root cube grows if the primitive is outside.

        Raises:
            OctreeError: The row of the primitive is not finite.
        """
        self._check_id(i)
        if not np.isfinite(self.world.rows[i]).all():
            raise OctreeError(f"the row of primitive {i} is not finite")
        box = np.zeros(6)
        growth = self.world.growth[i]
        row_bounds(self.world.kinds[i], self.world.rows[i], growth, box)
        if (box[:3] < self.low).any() or (box[3:] > self.high).any():
            present = self.present
            present[i] = True
            while (box[:3] < self.low).any() or (box[3:] > self.high).any():
                # Twice the edge, towards the side that sticks out.
                edge = self.high - self.low
                towards_low = box[:3] < self.low
                self.low = np.where(towards_low, self.low - edge, self.low)
                self.high = np.where(towards_low, self.high, self.high + edge)
                self.max_depth = min(self.max_depth + 1, DEPTH_LIMIT)
            self.state = self._build(present)
            return
        octree_insert(i, self.world, self.state)

    def remove(self, i: int) -> None:
        """Leave primitive i out from now on."""
        self._check_id(i)
        octree_remove(i, self.world, self.state)

    def update(self, i: int) -> None:
        """Follow primitive i to its present row."""
        self._check_id(i)
        octree_update(i, self.world, self.state)

    def candidates(self, i: int) -> NDArray[np.int32]:
        """Ids that share a leaf with primitive i, ascending."""
        self._check_id(i)
        self._token += 1
        found = octree_candidates(i, self.state, self._seen, self._token, self._out)
        return np.sort(self._out[:found])

    @property
    def present(self) -> NDArray[np.bool_]:
        """Which primitives are in the tree, shape (p,)."""
        return np.asarray(self.state.residency[:, STATUS] != ABSENT)

    def check(self) -> None:
        """Audit every invariant; see `octree_audit`.

        Raises:
            OctreeError: The first invariant that is broken, in words.
        """
        audit(self.world, self.state)

    def leaves(self) -> NDArray[np.int32]:
        """Ids of the leaves, in the order of a walk from the root, children in turn."""
        nodes = self.state.nodes
        found, stack = [], [0]
        while stack:
            node = stack.pop()
            if nodes[node, FIRST_CHILD] == LEAF:
                found.append(node)
            else:
                first = nodes[node, FIRST_CHILD]
                stack.extend(range(first + 7, first - 1, -1))
        return np.array(found, dtype=np.int32)

    def statistics(self) -> dict[str, object]:
        """What the tree looks like: nodes, leaves, depths, lists, memory."""
        state = self.state
        leaves = self.leaves()
        lengths = state.nodes[leaves, COUNT]
        depths = np.bincount(state.nodes[leaves, DEPTH])
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
            "most_objects_in_a_leaf": self._most_objects(leaves),
            "refused_splits": int(state.counters[COUNT_UNSPLIT]),
            "overflowed_primitives": int(state.header[OVERFLOW_COUNT]),
            "node_room": [int(state.header[NODES_USED]), len(state.nodes)],
            "entry_room": [int(state.header[ENTRIES_USED]), len(state.entries)],
            "bytes": int(sum(array.nbytes for array in state)),
        }

    def _most_objects(self, leaves: NDArray[np.int32]) -> int:
        most = 0
        for leaf in leaves:
            self.state.header[TOKEN] += 1
            most = max(most, count_owners(int(leaf), 0, self.world, self.state))
        return most

    def _check_id(self, i: int) -> None:
        if not 0 <= i < len(self.world.kinds):
            raise OctreeError(
                f"there is no primitive {i}; there are {len(self.world.kinds)}"
            )

    def _build(self, present: NDArray[np.bool_]) -> OctreeState:
        """Build, with room that grows until no split was refused for want of it."""
        count = len(self.world.kinds)
        nodes, entries = LEAST_NODES, max(LEAST_ENTRIES, 16 * count)
        while True:
            state = empty_state(
                count,
                leaf_capacity=self.leaf_capacity,
                max_depth=self.max_depth,
                low=self.low,
                high=self.high,
                node_capacity=nodes,
                entry_capacity=entries,
            )
            insert_all(present, self.world, state)
            used = state.header[NODES_USED]
            held = entries - state.header[FREE_ENTRIES]
            refused = state.counters[COUNT_UNSPLIT] + state.header[OVERFLOW_COUNT]
            roomy = used * SPARE <= nodes and held * SPARE <= entries
            if roomy and refused == 0:
                state.counters[:] = 0
                return state
            nodes, entries = SPARE * nodes, SPARE * entries


@kernel
def insert_all(present: NDArray[np.bool_], world: World, state: OctreeState) -> None:
    """Insert every primitive that is present, in order."""
    for i in range(present.shape[0]):
        if present[i]:
            octree_insert(i, world, state)


def grown_boxes(world: World) -> Floats:
    """Bounding boxes of the primitives as they are indexed, shape (p, 6) [m]."""
    boxes = np.zeros((len(world.kinds), 6))
    for i, kind in enumerate(world.kinds):
        row_bounds(kind, world.rows[i], world.growth[i], boxes[i])
    return boxes


def root_corners(
    boxes: Floats, cube: tuple[Floats, float] | None
) -> tuple[Floats, Floats]:
    """Corners of a cube that holds the boxes, and the wished-for cube."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    if len(boxes):
        low, high = boxes[:, :3].min(axis=0), boxes[:, 3:].max(axis=0)
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
    if not np.isfinite(low).all():
        low, high = np.full(3, -0.5), np.full(3, 0.5)
    centre, half = (low + high) / 2, float((high - low).max()) / 2 * 1.001
    return centre - half, centre + half


def depth_for(edge: float, growth: Floats) -> int:
    """Depth at which a leaf is twice as large as a growth, at most DEPTH_LIMIT.

    Finer leaves would each lie inside the grown primitives: more lists, few of them
    any shorter.
    """
    largest = float(growth.max()) if len(growth) else 0.0
    if largest <= 0.0:
        return DEPTH_LIMIT // 2
    return int(min(max(ceil(log2(edge / largest)) - 1, 1), DEPTH_LIMIT))
