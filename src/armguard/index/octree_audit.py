"""Audit of an octree: every invariant, in plain Python, by other means.

Overlap of a primitive and a cell is decided here by alternating projections onto two
convex sets and a separating direction, not by the kernel the tree is built with; cells
are made by halving from the root, not read from the nodes.
"""

import numpy as np
from numpy.typing import NDArray

from armguard.errors import OctreeError
from armguard.geometry.place import displacement
from armguard.geometry.shapes import ShapeKind
from armguard.index.octree_state import (
    ABSENT,
    COUNT,
    COUNT_UNSPLIT,
    DEPTH,
    ENTRIES_USED,
    FIRST_CHILD,
    FIRST_ENTRY,
    FREE_BLOCK,
    FREE_ENTRIES,
    FREE_ENTRY,
    HEAD,
    IN_LEAF,
    LEAF,
    LEAF_CAPACITY,
    LEAF_COUNT,
    MAX_DEPTH,
    NEXT_IN_LEAF,
    NEXT_OF_PRIMITIVE,
    NODES_USED,
    NONE,
    OVERFLOW_COUNT,
    OVERFLOWED,
    PARENT,
    PREVIOUS_IN_LEAF,
    PRIMITIVE,
    STATUS,
    OctreeState,
)
from armguard.index.world import World

Floats = NDArray[np.float64]

# Two independent computations may differ by this much [m].
UNDECIDED = 1e-9

# Alternating projections stop when no distance falls by more than this [m], or after
# this many steps; the bounds hold in any case.
SETTLED = 1e-12
STEPS = 400


def audit(world: World, state: OctreeState) -> None:
    """Raise OctreeError with the first invariant that does not hold.

    1. Topology: children name their parent, depths count up, no node twice.
    2. Cells: each is the half, third, … of its parent's; borders are the root's.
    3. Lists: linked both ways, counts right, entries name their leaf, nobody twice.
    4. Books: every node and every entry is in use or free, never both, none lost.
    5. Truth: a list holds exactly the primitives that inhabit the leaf.
    6. Rule: no leaf holds more than N objects above the depth limit; no eight leaves
       could be one. (Where a split was refused for want of room this may not hold.)
    7. Slack: a primitive's anchor, its row and its slack belong together.
    """
    leaves, cells, used = walk(state)
    members = read_lists(leaves, state)
    check_books(used, members, state)
    check_truth(leaves, cells, members, world, state)
    check_rule(leaves, members, world, state)
    check_slack(leaves, cells, world, state)


def demand(holds: bool, sentence: str) -> None:
    """Raise OctreeError with the sentence if the demand does not hold."""
    if not holds:
        raise OctreeError(f"octree audit: {sentence}")


def walk(state: OctreeState) -> tuple[list[int], dict[int, Floats], set[int]]:
    """Walk from the root; leaves, their cells with open borders, and nodes in use."""
    nodes, root = state.nodes, state.cells[0]
    leaves: list[int] = []
    open_cells: dict[int, Floats] = {}
    used: set[int] = set()
    stack: list[tuple[int, int, int, Floats]] = [(0, NONE, 0, root.copy())]
    while stack:
        node, parent, depth, cell = stack.pop()
        demand(node not in used, f"node {node} is reached twice")
        used.add(node)
        demand(nodes[node, PARENT] == parent, f"node {node} names a wrong parent")
        demand(nodes[node, DEPTH] == depth, f"node {node} has a wrong depth")
        demand(bool((state.cells[node] == cell).all()), f"cell {node} is misplaced")
        demand(depth <= state.header[MAX_DEPTH], f"node {node} is too deep")
        first = int(nodes[node, FIRST_CHILD])
        if first == LEAF:
            leaves.append(node)
            low = np.where(cell[:3] == root[:3], -np.inf, cell[:3])
            high = np.where(cell[3:] == root[3:], np.inf, cell[3:])
            open_cells[node] = np.concatenate([low, high])
            continue
        demand(first > 0, f"node {node} has children at {first}")
        middle = 0.5 * (cell[:3] + cell[3:])
        for c in range(8):
            upper = np.array([c & 1, c & 2, c & 4]) != 0
            low = np.where(upper, middle, cell[:3])
            high = np.where(upper, cell[3:], middle)
            stack.append((first + c, node, depth + 1, np.concatenate([low, high])))
    return leaves, open_cells, used


def read_lists(leaves: list[int], state: OctreeState) -> dict[int, set[int]]:
    """Members of each leaf, by its own list; checked against the primitives' lists."""
    nodes, entries, residency = state.nodes, state.entries, state.residency
    members: dict[int, set[int]] = {}
    for leaf in leaves:
        seen: set[int] = set()
        entry, previous = int(nodes[leaf, HEAD]), NONE
        while entry != NONE:
            demand(entries[entry, IN_LEAF] == leaf, f"entry {entry} names another leaf")
            demand(
                entries[entry, PREVIOUS_IN_LEAF] == previous,
                f"entry {entry} is not linked back",
            )
            i = int(entries[entry, PRIMITIVE])
            demand(i not in seen, f"primitive {i} is in leaf {leaf} twice")
            seen.add(i)
            entry, previous = int(entries[entry, NEXT_IN_LEAF]), entry
        demand(nodes[leaf, COUNT] == len(seen), f"leaf {leaf} miscounts its members")
        members[leaf] = seen
    for i in range(len(residency)):
        own: set[int] = set()
        entry = int(residency[i, FIRST_ENTRY])
        while entry != NONE:
            demand(entries[entry, PRIMITIVE] == i, f"entry {entry} is not of {i}")
            own.add(int(entries[entry, IN_LEAF]))
            entry = int(entries[entry, NEXT_OF_PRIMITIVE])
        demand(residency[i, LEAF_COUNT] == len(own), f"primitive {i} miscounts leaves")
        listed = {leaf for leaf in leaves if i in members[leaf]}
        demand(own == listed, f"lists of primitive {i} and of its leaves differ")
        absent = residency[i, STATUS] in (ABSENT, OVERFLOWED)
        demand(not (absent and own), f"primitive {i} is absent but has leaves")
    return members


def check_books(
    used: set[int], members: dict[int, set[int]], state: OctreeState
) -> None:
    """Nodes and entries: in use or free, never both, none lost."""
    nodes, entries, header = state.nodes, state.entries, state.header
    free_nodes: set[int] = set()
    block = int(header[FREE_BLOCK])
    while block != NONE:
        eight = set(range(block, block + 8))
        demand(not eight & (used | free_nodes), f"block {block} is used and free")
        free_nodes |= eight
        block = int(nodes[block, PARENT])
    demand(
        len(used) + len(free_nodes) == header[NODES_USED],
        f"{header[NODES_USED] - len(used) - len(free_nodes)} nodes are lost",
    )
    held = sum(map(len, members.values()))
    free = 0
    entry = int(header[FREE_ENTRY])
    while entry != NONE:
        demand(entries[entry, PRIMITIVE] == NONE, f"entry {entry} is used and free")
        free += 1
        entry = int(entries[entry, NEXT_IN_LEAF])
    demand(held + free == header[ENTRIES_USED], "entries are lost")
    demand(header[FREE_ENTRIES] == len(entries) - held, "free entries are miscounted")
    overflowed = int((state.residency[:, STATUS] == OVERFLOWED).sum())
    demand(header[OVERFLOW_COUNT] == overflowed, "overflows are miscounted")


def check_truth(
    leaves: list[int],
    cells: dict[int, Floats],
    members: dict[int, set[int]],
    world: World,
    state: OctreeState,
) -> None:
    """A list holds exactly the primitives that inhabit the leaf."""
    low = np.array([cells[leaf][:3] for leaf in leaves])
    high = np.array([cells[leaf][3:] for leaf in leaves])
    for i in range(len(world.kinds)):
        if state.residency[i, STATUS] in (ABSENT, OVERFLOWED):
            continue
        lower, upper = bracket_gaps(int(world.kinds[i]), world.rows[i], low, high)
        radius = world.rows[i, 0] + world.growth[i]
        for leaf, least, most in zip(leaves, lower, upper, strict=True):
            if most < radius - UNDECIDED:
                demand(i in members[leaf], f"leaf {leaf} lacks primitive {i}")
            elif least > radius + UNDECIDED:
                demand(
                    i not in members[leaf],
                    f"leaf {leaf} holds primitive {i}, which is "
                    f"{least - radius:.3g} m away",
                )


def check_rule(
    leaves: list[int],
    members: dict[int, set[int]],
    world: World,
    state: OctreeState,
) -> None:
    """Split above N objects, merged when N suffice."""
    if state.counters[COUNT_UNSPLIT]:
        return
    nodes, header = state.nodes, state.header
    capacity = header[LEAF_CAPACITY]
    families: dict[int, list[int]] = {}
    for leaf in leaves:
        if nodes[leaf, DEPTH] < header[MAX_DEPTH]:
            held = {int(world.owners[i]) for i in members[leaf]}
            demand(len(held) <= capacity, f"leaf {leaf} should be split")
        families.setdefault(int(nodes[leaf, PARENT]), []).append(leaf)
    for parent, children in families.items():
        if len(children) == 8:
            together = {
                int(world.owners[i]) for leaf in children for i in members[leaf]
            }
            demand(len(together) > capacity, f"node {parent} should be a leaf")


def check_slack(
    leaves: list[int],
    cells: dict[int, Floats],
    world: World,
    state: OctreeState,
) -> None:
    """No cell is nearer to changing sides than the slack promises."""
    low = np.array([cells[leaf][:3] for leaf in leaves])
    high = np.array([cells[leaf][3:] for leaf in leaves])
    for i in range(len(world.kinds)):
        if state.residency[i, STATUS] in (ABSENT, OVERFLOWED):
            continue
        moved = displacement(int(world.kinds[i]), state.anchors[i], world.rows[i])
        promise = state.slack[i] - moved
        lower, upper = bracket_gaps(int(world.kinds[i]), world.rows[i], low, high)
        radius = world.rows[i, 0] + world.growth[i]
        away = np.maximum(np.abs(lower - radius), np.abs(upper - radius))
        least = float(away.min())
        demand(
            promise <= least + UNDECIDED,
            f"primitive {i} may move {promise:.3g} m by its slack, but a cell changes "
            f"after {least:.3g} m",
        )


def bracket_gaps(
    kind: int, row: Floats, low: Floats, high: Floats
) -> tuple[Floats, Floats]:
    """Distance of a core to many cells, between two bounds, each shape (k,) [m].

    Alternating projections give a pair of points, whose distance is the upper bound;
    the direction between them separates the two sets by at least the lower one.

    Args:
        kind: ShapeKind.
        row: Row of the primitive, shape (16,).
        low: Lower corners of the cells, shape (k, 3) [m].
        high: Upper corners, shape (k, 3) [m].
    """
    inside = np.tile(row[1:4], (len(low), 1))
    upper = np.full(len(low), np.inf)
    for _ in range(STEPS):
        outside = np.clip(inside, low, high)
        inside = nearest_in_core(kind, row, outside)
        before, upper = upper, np.linalg.norm(outside - inside, axis=1)
        if (before - upper).max(initial=0.0) < SETTLED:
            break
    length = np.where(upper > 0.0, upper, 1.0)[:, None]
    n = (outside - inside) / length
    # A cell is open where it has no bound; there the direction has no component.
    corner = np.where(n > 0.0, low, high)
    nearest_side = np.where(n != 0.0, n * np.where(n != 0.0, corner, 0.0), 0.0).sum(1)
    lower = nearest_side - core_reach(kind, row, n)
    return np.where(upper > 0.0, np.clip(lower, 0.0, upper), 0.0), upper


def core_reach(kind: int, row: Floats, n: Floats) -> Floats:
    """How far a core extends along directions n of shape (k, 3), from the origin."""
    if kind == ShapeKind.SPHERE:
        return np.asarray(n @ row[1:4])
    if kind == ShapeKind.CAPSULE:
        return np.maximum(n @ row[1:4], n @ row[4:7])
    R = row[7:16].reshape(3, 3)
    return np.asarray(n @ row[1:4] + np.abs(n @ R) @ row[4:7])


def nearest_in_core(kind: int, row: Floats, points: Floats) -> Floats:
    """Nearest points of a core, shape (k, 3) [m]."""
    if kind == ShapeKind.SPHERE:
        return np.broadcast_to(row[1:4], points.shape)
    if kind == ShapeKind.CAPSULE:
        start, axis = row[1:4], row[4:7] - row[1:4]
        length2 = float(axis @ axis)
        along = (points - start) @ axis / length2 if length2 > 0.0 else 0.0
        return np.asarray(start + np.multiply.outer(np.clip(along, 0.0, 1.0), axis))
    R, half = row[7:16].reshape(3, 3), row[4:7]
    return np.asarray(row[1:4] + np.clip((points - row[1:4]) @ R, -half, half) @ R.T)
