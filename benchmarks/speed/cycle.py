"""`bench cycle`: a cycle in the bay, all links moving, beside its peers."""

from typing import Any

import numpy as np

from armguard.respond import Guard
from armguard.scene import bay_scene, bay_task
from peers import Pairs, Peer, available_peers
from speed.scenes import sway
from timing import Progress, percentiles, quiet, time_in_turns

CYCLES = 2000

# Configurations whose near pairs are compared with those of the peers.
AGREEMENT = 200


def bench(cycles: int, progress: Progress) -> dict[str, Any]:
    """Durations of `Guard.step` and of its peers over the same motion."""
    guard = Guard(bay_scene(), progress=progress)
    tables = guard.tables
    q = sway(tables, cycles)
    found = list(available_peers(tables))
    absent = [sentence for sentence in found if isinstance(sentence, str)]
    peers = [peer for peer in found if not isinstance(peer, str)]
    progress(f"measuring {cycles} cycles beside {len(peers)} peers")
    with quiet():
        times = time_in_turns([guard.step, *(peer.step for peer in peers)], q)
        read = time_in_turns([lambda row: read_all(guard, row)], q)[0]
    ours = percentiles(times[0])
    # The least of the passes for each configuration: work, without the machine's noise.
    undisturbed = percentiles(times[0].min(axis=0))
    results = {p.name: percentiles(t) for p, t in zip(peers, times[1:], strict=True)}
    counts = [guard.step(row).counts for row in q]
    return {
        "scene": "bay",
        "cycles": cycles,
        "links_moving": int(np.median([c.bodies_moved for c in counts])),
        "ours": ours,
        "ours_with_report_read": percentiles(read),
        "ours_undisturbed": undisturbed,
        "peers": results,
        "ratio": {
            name: result["median_us"] / ours["median_us"]
            for name, result in results.items()
        },
        "p999_over_median": tail_over_median(ours),
        "p999_over_median_undisturbed": tail_over_median(undisturbed),
        "pairs_checkable": tables.checkable_pairs,
        "pairs_tested_mean": float(np.mean([c.pairs_tested for c in counts])),
        "agreement": agreement(guard, peers, q),
        "not_installed": absent,
    }


def tail_over_median(times: dict[str, float]) -> float:
    """How much longer than the median the slowest cycle in a thousand takes [-]."""
    return times["p999_us"] / times["median_us"]


def read_all(guard: Guard, row: Any) -> object:
    """A step whose verdict is read as a loop would read it."""
    verdict = guard.step(row)
    return verdict.level, verdict.nearest


def near_of(guard: Guard, row: Any) -> Pairs:
    """Near pairs of the guard, by primitive."""
    number = {label: k for k, label in enumerate(guard.tables.labels)}
    return {
        (number[p.primitive_a], number[p.primitive_b]) for p in guard.step(row).near
    }


def agreement(guard: Guard, peers: list[Peer], q: Any) -> dict[str, Any]:
    """On how many configurations each peer finds the same near pairs as the guard.

    The motion stays clear of most obstacles, so the tasks' approaches are added.
    """
    task = bay_task(2000)
    order = [task.names.index(name) for name in guard.q_names]
    rows = np.concatenate(
        [q[:: max(len(q) // 50, 1)], task.q[:: 2000 // AGREEMENT, order]]
    )
    ours = [near_of(guard, row) for row in rows]
    answer: dict[str, Any] = {
        "configurations": len(rows),
        "with_near_pairs": sum(map(bool, ours)),
    }
    for peer in peers:
        both = [(a, peer.near_pairs(row)) for a, row in zip(ours, rows, strict=True)]
        answer[peer.name] = {
            "same": sum(a == b for a, b in both),
            "only_ours": sum(len(a - b) for a, b in both),
            "only_theirs": sum(len(b - a) for a, b in both),
        }
    return answer
