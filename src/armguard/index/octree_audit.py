"""Audit of an octree: every invariant, checked in plain Python by independent code.

Overlap of a primitive and a cell is decided here by alternating projections onto two
convex sets and a separating direction, not by the kernel that builds the tree. Cells
result from halving the root, not from the nodes.
"""

import numpy as np
from numpy.typing import NDArray

from armguard.errors import OctreeError
from armguard.geometry.place import displacement
from armguard.index.gap_bounds import bracket_gaps
from armguard.index.octree_cell import cell_at
from armguard.index.octree_state import (
    ABSENT,
    DIVIDED,
    FREE,
    NONE,
    OVERFLOWED,
    OctreeState,
)
from armguard.index.world import World

Floats = NDArray[np.float64]

# Greatest accepted difference of two independent computations [m].
UNDECIDED = 1e-9


def audit(world: World, state: OctreeState) -> None:
    """Raise OctreeError with the first invariant that does not hold.

    1. Topology: children name their parent, none is too deep, no node twice.
    2. Cells: each place is its parent's with the child's number, and leads to the cell
       that halving gives.
    3. Lists: linked both ways, counts right, entries name their leaf, no duplicates.
    4. Books: every node and every entry is in use or free, never both, none lost.
    5. Truth: a list holds exactly the primitives that overlap the leaf.
    6. Rule: no leaf holds more than N objects above the depth limit; no eight leaves
       could be one. (If a split was refused for lack of room this may not hold.)
    7. Slack: no leaf changes before a primitive has moved from its anchor by its slack.
    """
    leaves, cells, used = walk(state)
    members = read_lists(leaves, state)
    check_books(used, members, state)
    gaps = gaps_of_primitives(leaves, cells, world, state)
    check_truth(leaves, members, gaps)
    check_rule(leaves, members, world, state)
    check_slack(gaps, world, state)


def demand(holds: bool, sentence: str) -> None:
    """Raise OctreeError with the sentence if the demand does not hold."""
    if not holds:
        raise OctreeError(f"octree audit: {sentence}")


def walk(state: OctreeState) -> tuple[list[int], dict[int, Floats], set[int]]:
    """Leaves, their cells with open borders, and nodes in use, by a walk."""
    nodes = state.nodes
    root = np.concatenate([state.cube[0], state.cube[0] + state.cube[1]])
    leaves: list[int] = []
    open_cells: dict[int, Floats] = {}
    used: set[int] = set()
    stack: list[tuple[int, int, int, int, Floats]] = [(0, NONE, 0, 1, root.copy())]
    while stack:
        node, parent, depth, place, cell = stack.pop()
        demand(node not in used, f"node {node} is reached twice")
        used.add(node)
        demand(nodes[node].parent == parent, f"node {node} names a wrong parent")
        demand(nodes[node].place == place, f"node {node} is misplaced")
        there = np.array(cell_at(place, state.cube))
        demand(np.abs(there - cell).max() <= UNDECIDED, f"cell {node} is misplaced")
        demand(depth <= state.rule[0].max_depth, f"node {node} is too deep")
        if nodes[node].members != DIVIDED:
            demand(nodes[node].members >= 0, f"node {node} is no leaf")
            leaves.append(node)
            low = np.where(cell[:3] == root[:3], -np.inf, cell[:3])
            high = np.where(cell[3:] == root[3:], np.inf, cell[3:])
            open_cells[node] = np.concatenate([low, high])
            continue
        first = int(nodes[node].link)
        demand(first > 0, f"node {node} has children at {first}")
        middle = 0.5 * (cell[:3] + cell[3:])
        for c in range(8):
            upper = np.array([c & 1, c & 2, c & 4]) != 0
            low = np.where(upper, middle, cell[:3])
            high = np.where(upper, cell[3:], middle)
            child = np.concatenate([low, high])
            stack.append((first + c, node, depth + 1, 8 * place + c, child))
    return leaves, open_cells, used


def read_lists(leaves: list[int], state: OctreeState) -> dict[int, set[int]]:
    """Members of each leaf by its own list, checked against the primitives' lists."""
    nodes, entries, residency = state.nodes, state.entries, state.residency
    members: dict[int, set[int]] = {}
    homes: dict[int, set[int]] = {}
    for leaf in leaves:
        seen: set[int] = set()
        entry = int(nodes[leaf].link)
        while entry != NONE:
            demand(entries[entry].leaf == leaf, f"entry {entry} names another leaf")
            i = int(entries[entry].primitive)
            demand(i not in seen, f"primitive {i} is in leaf {leaf} twice")
            seen.add(i)
            homes.setdefault(i, set()).add(leaf)
            entry = int(entries[entry].next_in_leaf)
        demand(nodes[leaf].members == len(seen), f"leaf {leaf} miscounts its members")
        members[leaf] = seen
    for i in range(residency.shape[0]):
        own: set[int] = set()
        entry, previous = int(residency[i].first_entry), NONE
        while entry != NONE:
            demand(entries[entry].primitive == i, f"entry {entry} is not of {i}")
            demand(
                entries[entry].previous_of_primitive == previous,
                f"entry {entry} is not linked back",
            )
            own.add(int(entries[entry].leaf))
            entry, previous = int(entries[entry].next_of_primitive), entry
        listed = homes.get(i, set())
        demand(own == listed, f"lists of primitive {i} and of its leaves differ")
        absent = residency[i].status in (ABSENT, OVERFLOWED)
        demand(not (absent and own), f"primitive {i} is absent but has leaves")
    return members


def check_books(
    used: set[int], members: dict[int, set[int]], state: OctreeState
) -> None:
    """Check that each node and entry is in use or free, never both, none lost."""
    nodes, entries, header = state.nodes, state.entries, state.header[0]
    free_nodes: set[int] = set()
    block = int(header.free_block)
    while block != NONE:
        eight = set(range(block, block + 8))
        demand(not eight & (used | free_nodes), f"block {block} is used and free")
        free = bool((nodes["members"][block : block + 8] == FREE).all())
        demand(free, f"block {block} is free but not marked so")
        free_nodes |= eight
        block = int(nodes[block].parent)
    demand(
        len(used) + len(free_nodes) == header.nodes_used,
        f"{header.nodes_used - len(used) - len(free_nodes)} nodes are lost",
    )
    held = sum(map(len, members.values()))
    taken_back = 0
    entry = int(header.free_entry)
    while entry != NONE:
        demand(entries[entry].primitive == NONE, f"entry {entry} is used and free")
        taken_back += 1
        entry = int(entries[entry].next_in_leaf)
    demand(held + taken_back == header.entries_used, "entries are lost")
    demand(
        header.free_entries == entries.shape[0] - held, "free entries are miscounted"
    )
    overflowed = int((state.residency["status"] == OVERFLOWED).sum())
    demand(header.overflow_count == overflowed, "overflows are miscounted")


def gaps_of_primitives(
    leaves: list[int], cells: dict[int, Floats], world: World, state: OctreeState
) -> dict[int, tuple[Floats, Floats]]:
    """Bounds of the gap between each primitive, grown, and every leaf [m].

    Primitives without leaves, absent or overflowed, are left out.
    """
    low = np.array([cells[leaf][:3] for leaf in leaves])
    high = np.array([cells[leaf][3:] for leaf in leaves])
    gaps = {}
    for i in range(len(world.kinds)):
        if state.residency[i].status not in (ABSENT, OVERFLOWED):
            kind, radius = int(world.kinds[i]), world.rows[i, 0] + world.growth[i]
            lower, upper = bracket_gaps(kind, world.rows[i], low, high)
            gaps[i] = lower - radius, upper - radius
    return gaps


def check_truth(
    leaves: list[int],
    members: dict[int, set[int]],
    gaps: dict[int, tuple[Floats, Floats]],
) -> None:
    """Check that each list holds exactly the primitives that overlap its leaf."""
    for i, (lower, upper) in gaps.items():
        held = np.array([i in members[leaf] for leaf in leaves])
        for k in np.flatnonzero(~held & (upper < -UNDECIDED)):
            raise OctreeError(f"octree audit: leaf {leaves[k]} lacks primitive {i}")
        for k in np.flatnonzero(held & (lower > UNDECIDED)):
            raise OctreeError(
                f"octree audit: leaf {leaves[k]} holds primitive {i}, which is "
                f"{lower[k]:.3g} m away"
            )


def check_rule(
    leaves: list[int],
    members: dict[int, set[int]],
    world: World,
    state: OctreeState,
) -> None:
    """Check the rule: leaves are split above N objects and merged at N or fewer."""
    if state.counters[0].unsplit:
        return
    nodes = state.nodes
    capacity, deepest = state.rule[0].leaf_capacity, 8 ** state.rule[0].max_depth
    families: dict[int, list[int]] = {}
    for leaf in leaves:
        if nodes[leaf].place < deepest:
            held = {int(world.owners[i]) for i in members[leaf]}
            demand(len(held) <= capacity, f"leaf {leaf} should be split")
        families.setdefault(int(nodes[leaf].parent), []).append(leaf)
    for parent, children in families.items():
        if len(children) == 8:
            together = {
                int(world.owners[i]) for leaf in children for i in members[leaf]
            }
            demand(len(together) > capacity, f"node {parent} should be a leaf")


def check_slack(
    gaps: dict[int, tuple[Floats, Floats]], world: World, state: OctreeState
) -> None:
    """Check that no cell changes sides within the slack of a primitive."""
    for i, (lower, upper) in gaps.items():
        moved = displacement(int(world.kinds[i]), state.anchors[i], world.rows[i])
        promise = state.slack[i] - moved
        least = float(np.maximum(np.abs(lower), np.abs(upper)).min())
        demand(
            promise <= least + UNDECIDED,
            f"primitive {i} may move {promise:.3g} m by its slack, but a cell changes "
            f"after {least:.3g} m",
        )
