"""`bench scale`: the bay among up to a million boxes, and a thousand that move."""

from collections.abc import Callable
from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.bounds import row_bounds
from armguard.index import Octree, World
from armguard.index.octree_query import octree_candidates
from armguard.index.octree_state import OctreeState
from armguard.index.octree_update import octree_update
from armguard.kernel import kernel
from armguard.respond import Guard
from armguard.scene import Scene, SceneTables
from armguard.scene.compile import compile_scene
from arrays import Floats, Ints
from peers import NOT_INSTALLED
from speed.scenes import bay_among_boxes, boxes_world, sway
from timing import Progress, percentiles, quiet, time_in_turns

CYCLES = 500
SIZES = (35, 200, 2_000, 20_000, 200_000, 1_000_000)

# Beyond this many primitives brute force is not run: a cycle takes milliseconds.
BRUTE_FORCE_LIMIT = 20_000

# A peer that takes longer than this to build is not built at larger sizes [s].
PEER_BUILD_LIMIT = 60.0

COAL = "coal_dynamic_aabb_tree"

# Boxes that move in the last part, and how far a cycle takes them at most [m].
MOVERS = 1000
MOVER_STEP = 1e-3


def bench(
    cycles: int, progress: Progress, sizes: tuple[int, ...] = SIZES
) -> dict[str, Any]:
    """Time of a cycle, of a build, and bytes, against the number of primitives.

    Args:
        cycles: Configurations to measure at each size.
        progress: Called with a sentence before each part.
        sizes: Numbers of primitives, ascending; ratios are to the first.
    """
    small = Guard(bay_among_boxes(sizes[0]), progress=progress)
    q = sway(small.tables, cycles)
    rows: list[dict[str, Any]] = []
    too_slow: str | None = None
    for size in sizes:
        row = at_size(size, q, small, progress, too_slow)
        rows.append(row)
        built = row["peers"][COAL].get("build_s", 0.0)
        if too_slow is None and built > PEER_BUILD_LIMIT:
            too_slow = f"not built: {built:.0f} s at {size} primitives"
    progress(f"{MOVERS} moving boxes")
    last = rows[-1]
    return {
        "cycles": cycles,
        "ours": last["ours"],
        "peers": last["peers"],
        "ratio": last["ratio"],
        "against_primitives": rows,
        "moving": [against_movers(cycles, boxes) for boxes in (0, sizes[-1])],
        "row_4": {
            "primitives": last["primitives"],
            "cycle_over_first_size": last["over_first_size"],
            "index_build_s": last["index_build_s"],
            "bytes_per_primitive": last["bytes_per_primitive"],
        },
    }


def at_size(
    size: int, q: Floats, small: Guard, progress: Progress, too_slow: str | None
) -> dict[str, Any]:
    """Everything at one number of primitives.

    Args:
        size: Primitives, the bay's included.
        q: Configurations.
        small: A guard of the first size, measured in turns with the others.
        progress: Called with a sentence before each part.
        too_slow: Why the peer is not built, None if it is.
    """
    progress(f"building {size} primitives")
    scene, scene_s = timed(lambda: bay_among_boxes(size))
    tables, tables_s = timed(lambda: compile_scene(scene))
    guard, guard_s = timed(lambda: Guard(scene))
    index = guard.index
    assert isinstance(index, Octree)
    with quiet():
        builds = [timed(lambda: octree_of(tables, index.world)) for _ in range(3)]
    progress(f"building the peer of {size} primitives")
    contestants, peers = peers_of(size, scene, tables, too_slow)
    progress(f"measuring {len(q)} cycles at {size} primitives")
    with quiet():
        # Two alike in turns: a guard that runs after a peer finds cold caches, which at
        # a few microseconds a cycle is half of the time.
        small_times, our_times = time_in_turns([small.step, guard.step], q)
        times = time_in_turns(list(contestants.values()), q)
    ours = percentiles(our_times)
    for name, taken in zip(contestants, times, strict=True):
        peers[name] |= percentiles(taken)
    byte_count = index.nbytes + sum(array.nbytes for array in index.world)
    statistics = index.statistics()
    return {
        "primitives": size,
        "ours": ours,
        "over_first_size": ours["median_us"] / percentiles(small_times)["median_us"],
        "scene_s": scene_s,
        "tables_s": tables_s,
        "guard_s": guard_s,
        "index_build_s": min(seconds for _, seconds in builds),
        "bytes_per_primitive": byte_count / size,
        "tree_bytes_per_primitive": index.nbytes / size,
        "nodes": statistics["nodes"],
        "entries": statistics["entries"],
        "max_depth": statistics["max_depth"],
        "peers": peers,
        "ratio": {
            name: peers[name]["median_us"] / ours["median_us"] for name in contestants
        },
    }


def timed(make: Callable[[], Any]) -> tuple[Any, float]:
    """What a call makes, and how long it takes [s]."""
    start = perf_counter()
    made = make()
    return made, perf_counter() - start


def octree_of(tables: SceneTables, world: World) -> Octree:
    """The octree of a world, as a guard of these tables builds it."""
    return Octree(
        world,
        leaf_capacity=tables.index.leaf_capacity,
        max_depth=tables.index.max_depth,
        cube=(tables.cube_centre, tables.cube_edge),
    )


def brute_force(scene: Scene) -> Guard:
    """A guard of the same scene without an index."""
    chosen = scene.index
    scene.index = replace(chosen, kind="brute_force")
    try:
        return Guard(scene)
    finally:
        scene.index = chosen


def peers_of(
    size: int, scene: Scene, tables: SceneTables, too_slow: str | None
) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
    """Steps of the peers by name, and what is known of each: how long it was built."""
    contestants: dict[str, Any] = {}
    reason = f"not run above {BRUTE_FORCE_LIMIT} primitives"
    peers: dict[str, dict[str, Any]] = {"brute_force": {"left_out": reason}}
    if size <= BRUTE_FORCE_LIMIT:
        contestants["brute_force"] = brute_force(scene).step
        peers["brute_force"] = {}
    peers[COAL] = {"left_out": too_slow}
    if too_slow is None:
        try:
            from peers.pinocchio_coal import CoalManager
        except ImportError:
            peers[COAL] = {"left_out": NOT_INSTALLED}
        else:
            peer, seconds = timed(lambda: CoalManager(tables))
            contestants[COAL], peers[COAL] = peer.step, {"build_s": seconds}
    return contestants, peers


def against_movers(cycles: int, boxes: int) -> dict[str, Any]:
    """A cycle of an index in which a thousand boxes move among fixed ones.

    Every box takes a step, its leaves are brought up to date, and its candidates are
    collected; nothing is measured.

    Args:
        cycles: Cycles to measure.
        boxes: Fixed boxes.
    """
    world = boxes_world(MOVERS, boxes, growth=0.05)
    octree = Octree(world)
    rng = np.random.default_rng(1)
    # Each walks to and fro, so that the crowd stays together.
    steps = rng.uniform(-MOVER_STEP, MOVER_STEP, (MOVERS, 3))
    seen = np.zeros(len(world.kinds), dtype=np.int64)
    out = np.zeros(len(world.kinds), dtype=np.int32)
    token = 1
    candidates = 0

    def cycle(row: Floats) -> None:
        nonlocal token, candidates
        candidates = follow_all(steps * row[0], world, octree.state, seen, token, out)
        token += MOVERS

    signs = np.where(np.arange(cycles) // 50 % 2, -1.0, 1.0)[:, None]
    with quiet():
        (times,) = time_in_turns([cycle], signs)
    return {
        "moving": MOVERS,
        "standing": boxes,
        **percentiles(times),
        "us_per_moving": percentiles(times)["median_us"] / MOVERS,
        "candidates_per_moving": candidates / MOVERS,
    }


@kernel(inline=False, entry=True)
def follow_all(
    steps: Floats,
    world: World,
    state: OctreeState,
    seen: Ints,
    token: int,
    out: NDArray[np.int32],
) -> int:
    """Move the first boxes of a world and look up their candidates.

    Args:
        steps: How far each moves, shape (k, 3) [m].
        world: The boxes.
        state: Their octree.
        seen: Scratch, shape (p,).
        token: The first of k numbers `seen` does not hold.
        out: Scratch, shape (p,).

    Returns:
        Candidates of all of them together.
    """
    for i in range(steps.shape[0]):
        for k in range(3):
            world.rows[i, 1 + k] += steps[i, k]
        row_bounds(world.kinds[i], world.rows[i], 0.0, world.boxes[i])
        octree_update(i, world, state)
    found = 0
    for i in range(steps.shape[0]):
        found += octree_candidates(i, state, seen, token + i, out)
    return found
