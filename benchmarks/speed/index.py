"""`bench index`: the paper's findings about its octree, measured again."""

from dataclasses import replace
from typing import Any

import numpy as np

from armguard.guard import Reason
from armguard.guard.answer import Counts
from armguard.respond import Guard
from armguard.scene import Scene, bay_scene
from arrays import Floats
from speed.scenes import crowded_bay, only_last, sway
from timing import Progress, percentiles, quiet, time_in_turns

CYCLES = 2000
PAPER_PERIOD = 30e-3
CAPACITIES = tuple(range(1, 21))
SIZES = (35, 50, 75, 100, 200, 2_000, 20_000)


def bench(cycles: int, progress: Progress) -> dict[str, Any]:
    """Time and work against N, links moving, and the number of primitives."""
    guard = Guard(bay_scene(), progress=progress)
    fast = sway(guard.tables, cycles)
    slow = sway(guard.tables, cycles, PAPER_PERIOD)
    progress("time against N")
    by_capacity = against_capacity(fast)
    progress("time against links moving")
    by_links = against_links(guard, fast)
    progress("changes of leaf")
    changes = {
        "1ms": changes_of_leaf(guard, fast),
        "30ms": changes_of_leaf(guard, slow),
    }
    sizes = []
    for size in SIZES:
        progress(f"octree and brute force at {size} primitives")
        sizes.append(against_brute_force(size, fast[:500]))
    n5 = by_capacity[CAPACITIES.index(5)]
    middle = [r["median_us"] for r in by_capacity if 4 <= r["leaf_capacity"] <= 12]
    progress("random states, octree against brute force")
    random_states = agree_on_random_states(5 * cycles, progress)
    return {
        "ours": sizes[0]["octree"],
        "peers": {"brute_force": sizes[0]["brute_force"]},
        "ratio": {"brute_force": sizes[0]["ratio"]},
        "cycles": cycles,
        "time_against_N": by_capacity,
        "time_against_links_moving": by_links,
        "changes_of_leaf": changes,
        "octree_against_brute_force": sizes,
        "random_states": random_states,
        "row_1": {
            "share_of_pairs_measured_at_N5": n5["share_measured"],
            "share_of_pairs_sharing_a_leaf_at_N5": n5["share_sharing_leaf"],
            "share_of_link_cycles_that_change_leaf_1ms": changes["1ms"]["link_cycles"],
            "links_checked_when_only_the_last_moves": by_links[0]["links_checked"],
            "N4_to_N12_spread": (max(middle) - min(middle)) / float(np.mean(middle)),
            "octree_overtakes_at": overtakes(sizes),
        },
    }


def guard_with(scene: Scene, **settings: Any) -> Guard:
    """A guard of a scene with other settings of its index."""
    scene.index = replace(scene.index, **settings)
    return Guard(scene)


def against_capacity(q: Floats) -> list[dict[str, Any]]:
    """Time and counts for each N, all measured in turns."""
    guards = [guard_with(bay_scene(), leaf_capacity=n) for n in CAPACITIES]
    with quiet():
        times = time_in_turns([guard.step for guard in guards], q)
    rows = []
    for n, guard, t in zip(CAPACITIES, guards, times, strict=True):
        guard.reset()
        counts = [guard.step(row).counts for row in q]
        checkable = guard.tables.checkable_pairs
        tested = mean_of(counts, "pairs_tested")
        shared = tested + mean_of(counts, "pairs_filtered")
        rows.append(
            {
                "leaf_capacity": n,
                **percentiles(t),
                "nodes": guard.index.statistics()["nodes"],
                "pairs_tested": tested,
                "pairs_sharing_a_leaf": shared,
                "share_measured": tested / checkable,
                "share_sharing_leaf": shared / checkable,
                "link_cycles_that_change_leaf": link_cycles(counts),
            }
        )
    return rows


def mean_of(counts: list[Counts], name: str) -> float:
    """Mean of one of the counts of cycles."""
    return float(np.mean([getattr(c, name) for c in counts]))


def link_cycles(counts: list[Counts]) -> float:
    """Share of moved links that changed a leaf."""
    moved = sum(c.links_checked for c in counts)
    return sum(c.links_changed_leaf for c in counts) / moved if moved else 0.0


def against_links(guard: Guard, q: Floats) -> list[dict[str, Any]]:
    """Time against the number of links that move, the last of an arm first."""
    rows = []
    for moving in range(1, 15):
        held = only_last(q, guard.tables.home, moving, arms=2)
        with quiet():
            (times,) = time_in_turns([guard.step], held, passes=20)
        counts = [guard.step(row).counts for row in held]
        rows.append(
            {
                "links_moving": moving,
                **percentiles(times),
                "links_checked": int(np.median([c.links_checked for c in counts])),
                "pairs_tested": mean_of(counts, "pairs_tested"),
            }
        )
    return rows


def changes_of_leaf(guard: Guard, q: Floats) -> dict[str, float]:
    """How often a step changes the tree."""
    guard.step(q[0])
    counts = [guard.step(row).counts for row in q[1:]]
    moves = np.array([c.leaves_entered + c.leaves_left for c in counts])
    changes = np.array([c.splits + c.merges for c in counts])
    return {
        "cycles": float(np.mean(moves + changes > 0)),
        "cycles_that_split_or_merge": float(np.mean(changes > 0)),
        "link_cycles": link_cycles(counts),
    }


def against_brute_force(size: int, q: Floats) -> dict[str, Any]:
    """The same scene with both kinds of index, in turns."""
    scene = crowded_bay(size)
    cube = None if size > SIZES[0] else scene.index.cube
    octree = guard_with(scene, kind="octree", cube=cube)
    brute = guard_with(scene, kind="brute_force")
    same = all(octree.step(x).tobytes() == brute.step(x).tobytes() for x in q[::10])
    with quiet():
        # Brute force takes seconds a pass where it does not matter any more.
        passes = 5 if size <= 200 else 1
        times = time_in_turns([octree.step, brute.step], q, passes=passes)
    ours, theirs = percentiles(times[0]), percentiles(times[1])
    statistics = octree.index.statistics()
    return {
        "primitives": size,
        "pairs_checkable": octree.tables.checkable_pairs,
        "octree": ours,
        "brute_force": theirs,
        "ratio": theirs["median_us"] / ours["median_us"],
        "same_verdicts": same,
        **{key: statistics[key] for key in ("nodes", "max_depth", "bytes")},
    }


def agree_on_random_states(count: int, progress: Progress) -> dict[str, int]:
    """Octree and brute force on random joint states: jumps, and walks between them.

    Every tenth state lies anywhere within the limits; the nine after it are steps away
    from it, of any size between a micrometre's worth and a tenth of a radian.
    """
    rng = np.random.default_rng(20)
    octree = Guard(bay_scene())
    brute = guard_with(bay_scene(), kind="brute_force")
    t = octree.tables
    different = too_close = 0
    q = t.home.copy()
    for k in range(count):
        if k % 10 == 0:
            q = rng.uniform(t.lower, t.upper)
        else:
            step = 10.0 ** rng.uniform(-6.0, -1.0)
            q = np.clip(q + rng.uniform(-step, step, len(q)), t.lower, t.upper)
        ours, theirs = octree.step(q), brute.step(q)
        different += ours.tobytes() != theirs.tobytes()
        too_close += ours.reason is Reason.TOO_CLOSE
        if count >= 10 and k % (count // 10) == 0:
            progress(f"state {k} of {count}, {different} verdicts differ")
    return {"states": count, "verdicts_that_differ": different, "too_close": too_close}


def overtakes(sizes: list[dict[str, Any]]) -> int | None:
    """The least size measured from which on the octree is faster; None if never."""
    least = None
    for row in reversed(sizes):
        if row["ratio"] <= 1.0:
            break
        least = row["primitives"]
    return least
