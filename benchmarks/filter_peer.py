"""What a filtered cycle costs, beside a step of a peer, in the same states.

make filter-peer                       20,000 cycles; writes docs/filter_peer.json

The bay with balls close to both arms, so that 35 pairs are near. The arms do as the
guard orders; every twentieth state is given to the peer as well, mink with the
settings it has by default, DAQP as its solver, and all pairs that the guard checks. It
is left out where it is not installed: `pip install mink "qpsolvers"`.
"""

import json
import sys
from time import perf_counter_ns

import numpy as np

from armguard.cli.console import say
from armguard.respond import Guard
from closed_loop.judge import Judge
from episodes.campaign import command
from episodes.follower import Arms
from episodes.records import keep
from pages import DOCS
from reach.answers import MinkPeer, is_installed
from speed.filter import crowded_scene, driven
from timing import describe_machine, percentiles, quiet

RESULTS = DOCS / "filter_peer.json"

# Every so many cycles the peer is asked.
SHARE = 20

# Cycles before measuring begins.
WARM = 500


def main() -> int:
    """Measure; write docs/filter_peer.json."""
    parser = command(__doc__)
    parser.add_argument("--cycles", type=int, default=20_000)
    chosen = parser.parse_args()
    scene = crowded_scene(say)
    guard = Guard(scene, self_test=False)
    tables = guard.tables
    peer = None
    if is_installed():
        limits = tables.lower, tables.upper, Arms(tables).joined("velocity")
        peer = MinkPeer(scene, Judge(scene, tables), limits, "mink")
    else:
        say("the peer is left out: mink or qpsolvers is not installed")
    with quiet():
        times, peers, near = measure(guard, peer, chosen.cycles)
    found = {
        "machine": describe_machine(),
        "cycles": chosen.cycles,
        "near_pairs_median": float(np.median(near)),
        "filter": percentiles(times),
    }
    if peers:
        found["mink"] = percentiles(peers)
        found["ratio"] = found["mink"]["median_us"] / found["filter"]["median_us"]
    keep(RESULTS, "filter", found, chosen.cycles)
    print(json.dumps(found, indent=1))
    return 0


def measure(
    guard: Guard, peer: MinkPeer | None, cycles: int
) -> tuple[list[int], list[int], list[int]]:
    """Drive both arms to and fro through the filter.

    Returns:
        Times of the filter and of the peer [ns], and how many pairs were near.
    """
    times, peers, near = [], [], []
    for k, cycle in enumerate(driven(guard, cycles + WARM)):
        if k < WARM:
            continue
        times.append(cycle.taken)
        near.append(len(cycle.command.verdict.near))
        if peer is not None and k % SHARE == 0:
            begin = perf_counter_ns()
            peer.velocity(cycle.q, cycle.desired)
            peers.append(perf_counter_ns() - begin)
    return times, peers, near


if __name__ == "__main__":
    sys.exit(main())
