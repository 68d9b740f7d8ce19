"""A long random walk of an octree: insertions, moves and removals, audited on the way.

python benchmarks/octree_campaign.py --steps 1000000

Prints where it is, and one line of JSON at the end. Ends with 1 if an audit fails, a
near pair is missing, or the tree differs from a fresh one.
"""

import argparse
import json
import sys
from time import perf_counter
from typing import Any

import numpy as np

from armguard.errors import OctreeError
from armguard.geometry.bounds import row_bounds
from armguard.geometry.pairs import measure
from armguard.geometry.pose import rotation_from_rpy
from armguard.geometry.shapes import ShapeKind
from armguard.index import Octree, World
from armguard.index import octree_state as places
from armguard.kernel import kernel
from arrays import Bools, Floats

PRIMITIVES, MOVING = 160, 60

# Comparisons with brute force for each audit.
COMPARISONS = 50
GROWTH = 0.05

# Half the edge of the cube the primitives start in, and of the one they jump about in:
# some leave the tree's cube, and it grows when they are inserted there [m].
START, JUMP = 0.8, 1.0


def main() -> int:
    """Walk; 0 if nothing was wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=1_000_000)
    parser.add_argument("--audits", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    start = perf_counter()
    try:
        answer = walk(chosen.steps, chosen.audits, chosen.seed)
    except OctreeError as error:
        answer = {"failed": str(error)}
    answer["seconds"] = perf_counter() - start
    print(json.dumps(answer))
    good = "failed" not in answer and not answer["missing_pairs"]
    return 0 if good and answer["same_as_fresh"] else 1


def walk(steps: int, audits: int, seed: int) -> dict[str, Any]:
    """Random steps; what was done, and what was wrong.

    Args:
        steps: Insertions, moves and removals.
        audits: How often the tree is audited and compared with brute force.
        seed: Of it all.
    """
    rng = np.random.default_rng(seed)
    world = random_world(rng)
    octree = Octree(world, leaf_capacity=4)
    done = {"inserted": 0, "removed": 0, "moved": 0, "jumped": 0, "cube_grew": 0}
    missing = checked = 0
    rooms: list[tuple[int, int]] = []
    every = max(steps // audits, 1)
    for k in range(steps):
        i = int(rng.integers(MOVING if rng.random() < 0.7 else PRIMITIVES))
        what = rng.random()
        if what < 0.08:
            octree.remove(i)
            done["removed"] += 1
        elif what < 0.25:
            before = octree.state
            octree.insert(i)
            done["cube_grew"] += octree.state is not before
            done["inserted"] += 1
        else:
            jumps = what < 0.35
            displace(rng, i, world, jumps)
            octree.update(i)
            done["jumped" if jumps else "moved"] += 1
        if k % max(every // COMPARISONS, 1) == 0:
            pairs, lost = compare(octree)
            checked, missing = checked + pairs, missing + lost
        if k % every == every - 1:
            octree.check()
            header = octree.state.header
            rooms.append((int(header[0].nodes_used), int(header[0].entries_used)))
            print(f"step {k + 1} of {steps}, {missing} pairs missing", file=sys.stderr)
    return {
        "steps": steps,
        **done,
        "audits": len(rooms),
        "pairs_compared": checked,
        "missing_pairs": missing,
        "same_as_fresh": picture(octree) == picture(fresh_one(octree)),
        "refused_splits": int(octree.state.counters[0].unsplit),
        # Handed out at least once: what is taken back is used again, or these would
        # grow without end.
        "nodes_used_first_and_last": [rooms[0][0], rooms[-1][0]],
        "entries_used_first_and_last": [rooms[0][1], rooms[-1][1]],
        "bytes": octree.nbytes,
    }


def random_world(rng: np.random.Generator) -> World:
    """Spheres, capsules and boxes of all sizes; those that move come first."""
    world = World(
        kinds=rng.integers(0, 3, PRIMITIVES).astype(np.int32),
        rows=np.zeros((PRIMITIVES, 16)),
        boxes=np.zeros((PRIMITIVES, 6)),
        owners=np.arange(PRIMITIVES, dtype=np.int32),
        growth=np.where(np.arange(PRIMITIVES) < MOVING, GROWTH, 0.0),
    )
    for i, row in enumerate(world.rows):
        size = 10.0 ** rng.uniform(-2.0, -0.5)
        row[1:4] = rng.uniform(-START, START, 3)
        if world.kinds[i] == ShapeKind.BOX:
            row[4:7] = size * rng.uniform(0.05, 1.0, 3)
            row[7:16] = rotation_from_rpy(*rng.uniform(-np.pi, np.pi, 3)).reshape(9)
        else:
            row[0] = 0.5 * size
            if world.kinds[i] == ShapeKind.CAPSULE:
                row[4:7] = row[1:4] + size * rng.normal(size=3)
        row_bounds(world.kinds[i], row, 0.0, world.boxes[i])
    return world


def displace(rng: np.random.Generator, i: int, world: World, jumps: bool) -> None:
    """Move a primitive: a step of any size below 0.3 m, or somewhere else."""
    row = world.rows[i]
    if jumps:
        step = rng.uniform(-JUMP, JUMP, 3) - row[1:4]
    else:
        step = rng.normal(size=3) * 10.0 ** rng.uniform(-5.0, -1.0)
    row[1:4] += step
    if world.kinds[i] == ShapeKind.CAPSULE:
        row[4:7] += step
    elif world.kinds[i] == ShapeKind.BOX:
        angles = rng.normal(size=3) * 10.0 ** rng.uniform(-5.0, -0.5)
        R = rotation_from_rpy(*angles) @ row[7:16].reshape(3, 3)
        # A product of a million rotations is none any more.
        q, r = np.linalg.qr(R)
        row[7:16] = (q * np.sign(np.diag(r))).reshape(9)
    row_bounds(world.kinds[i], row, 0.0, world.boxes[i])


def compare(octree: Octree) -> tuple[int, int]:
    """Pairs within the growth by brute force, and how many the candidates lack."""
    near = np.zeros((PRIMITIVES, PRIMITIVES), dtype=np.bool_)
    near_pairs(octree.world, octree.present, np.zeros(10), near)
    pairs = missing = 0
    for i in np.flatnonzero(near.any(axis=1)):
        wanted = set(np.flatnonzero(near[i]).tolist())
        pairs += len(wanted)
        missing += len(wanted - set(octree.candidates(int(i)).tolist()))
    return pairs, missing


@kernel(inline=False, entry=True)
def near_pairs(world: World, present: Bools, witness: Floats, out: Bools) -> None:
    """Mark the pairs of a moving primitive and another that are within the growth."""
    for i in range(MOVING):
        for j in range(present.shape[0]):
            if i == j or not (present[i] and present[j]):
                continue
            a, b = min(i, j), max(i, j)
            measure(
                world.kinds[a], world.rows[a], world.kinds[b], world.rows[b], witness
            )
            out[i, j] = not witness[0] > GROWTH


def fresh_one(octree: Octree) -> Octree:
    """A tree of the same primitives in the same cube, built at once."""
    world = octree.world
    centre = 0.5 * (octree.low + octree.high)
    edge = float(octree.high[0] - octree.low[0])
    fresh = Octree(
        world,
        leaf_capacity=octree.leaf_capacity,
        max_depth=octree.max_depth,
        cube=(centre, edge),
    )
    fresh.low, fresh.high = octree.low, octree.high
    fresh.state = fresh._build(octree.present)
    return fresh


def picture(octree: Octree) -> dict[tuple[float, ...], list[int]]:
    """Leaves by their cells, with their members: what canonical means."""
    nodes, entries = octree.state.nodes, octree.state.entries
    leaves = octree.leaves()
    seen = {}
    for leaf, cell in zip(leaves, octree.cells(leaves), strict=True):
        members, entry = [], nodes[leaf].link
        while entry != places.NONE:
            members.append(int(entries[entry].primitive))
            entry = entries[entry].next_in_leaf
        seen[tuple(cell)] = sorted(members)
    return seen


if __name__ == "__main__":
    sys.exit(main())
