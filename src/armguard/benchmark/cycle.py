"""`bench cycle`: a cycle in the bay, all links moving, beside its peers."""

from collections.abc import Callable
from typing import Any

import numpy as np

from armguard.benchmark.machine import describe_machine
from armguard.benchmark.motion import sway
from armguard.benchmark.peers import Pairs, Peer, available_peers
from armguard.benchmark.timing import percentiles, quiet, time_in_turns
from armguard.respond import Guard
from armguard.scene import bay_scene

Progress = Callable[[str], None]

CYCLES = 2000
PERIOD = 1e-3

# Configurations on which the peers are asked for their near pairs.
AGREEMENT = 200


def bench_cycle(cycles: int | None, progress: Progress) -> dict[str, Any]:
    """Durations of `Guard.step` and of its peers over the same motion.

    Args:
        cycles: Cycles to measure.
        progress: Called with a sentence before each part.
    """
    count = CYCLES if cycles is None else cycles
    guard = Guard(bay_scene(), progress=progress)
    tables = guard.tables
    q = sway(tables.home, tables.lower, tables.upper, cycles=count, period=PERIOD)
    peers: list[Peer] = []
    absent: list[str] = []
    for found in available_peers(tables):
        if isinstance(found, str):
            absent.append(found)
        else:
            peers.append(found)
    progress(f"measuring {count} cycles beside {len(peers)} peers")
    with quiet():
        times = time_in_turns([guard.step, *(peer.step for peer in peers)], q)
        read = time_in_turns([lambda row: read_all(guard, row)], q)[0]
    ours = percentiles(times[0])
    # The least of the passes for each configuration: work, without the machine's noise.
    undisturbed = percentiles(times[0].min(axis=0))
    results = {p.name: percentiles(t) for p, t in zip(peers, times[1:], strict=True)}
    verdicts = [guard.step(row) for row in q]
    tested = [v.counts.pairs_tested for v in verdicts]
    return {
        "name": "cycle",
        "machine": describe_machine(),
        "scene": "bay",
        "cycles": count,
        "links_moving": int(np.median([v.counts.bodies_moved for v in verdicts])),
        "ours": ours,
        "ours_with_report_read": percentiles(read),
        "ours_undisturbed": undisturbed,
        "peers": results,
        "ratio": {
            name: result["median_us"] / ours["median_us"]
            for name, result in results.items()
        },
        "p999_over_median": ours["p999_us"] / ours["median_us"],
        "p999_over_median_undisturbed": undisturbed["p999_us"]
        / undisturbed["median_us"],
        "pairs_checkable": tables.checkable_pairs,
        "pairs_tested_mean": float(np.mean(tested)),
        "agreement": agreement(guard, peers, q),
        "not_installed": absent,
    }


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

    The motion stays clear of most things, so the tasks' approaches are added.
    """
    from armguard.scene import bay_task

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
        theirs = [peer.near_pairs(row) for row in rows]
        answer[peer.name] = {
            "same": sum(a == b for a, b in zip(ours, theirs, strict=True)),
            "only_ours": sum(len(a - b) for a, b in zip(ours, theirs, strict=True)),
            "only_theirs": sum(len(b - a) for a, b in zip(ours, theirs, strict=True)),
        }
    return answer
