"""How exact the distances are: a million pairs before independent oracles.

make accuracy                                    all of it, about half an hour
make accuracy ARGS="--quick"                     a few thousand pairs, to try it out
make accuracy ARGS="--clipping"                  overlap by clipped edges alone
python benchmarks/accuracy_campaign.py --show box-hull nested 12     one case
"""

import argparse
import multiprocessing
from concurrent.futures import Executor, ProcessPoolExecutor
from importlib.metadata import version
from typing import Any

from accuracy.clipping import PLACES, compared
from accuracy.judge import (
    FIGURES,
    MISSED,
    NAMES,
    TARGETS,
    judge,
    merged,
    summed_up,
    swallowed,
)
from accuracy.peers import NOTABLE, PEERS, VERDICTS, compare, tasks
from accuracy.regimes import REGIMES
from armguard.geometry.pairs import has_closed_form
from episodes.kernels import kernels_in_words
from episodes.records import keep, read
from pages import DOCS, rendered

RESULTS = DOCS / "accuracy.json"

PROCESSES = 2

# Pairs judged together, and how many of the first batch with 50 digits.
BATCH = 250
EXACT = 40

# Longest a batch may take before the campaign counts as hung [s].
PATIENCE = 900.0

DISTRIBUTIONS = {"Coal": "coal", "FCL": "python-fcl", "MuJoCo": "mujoco"}


def work(task: tuple[str, str, int, int]) -> tuple[str, str, int, dict[str, Any]]:
    """Figures of one batch."""
    name, regime, first, count = task
    batch = judge(*NAMES[name], regime, range(first, first + count))
    return name, regime, count, summed_up(batch, EXACT if first == 0 else 0)


def over_pairs(pool: Any, total: int) -> dict[str, Any]:
    """Figures of every pair of kinds over at least this many pairs in all."""
    each = -(-total // (len(NAMES) * len(REGIMES)))
    work_list = [
        (name, regime, first, min(BATCH, each - first))
        for first in range(0, each, BATCH)
        for name in NAMES
        for regime in REGIMES
    ]
    kinds: dict[str, Any] = {}
    for name, pair in NAMES.items():
        tried = swallowed(*pair)
        kinds[name] = {"closed_form": has_closed_form(*pair), "pairs": 0, "nan": tried}
    answers = pool.imap_unordered(work, work_list)
    for done in range(len(work_list)):
        name, regime, count, part = answers.next(timeout=PATIENCE)
        merged(kinds[name], part, regime)
        kinds[name]["pairs"] += count
        if done % 200 == 0:
            print(f"{done} of {len(work_list)} batches", flush=True)
    return kinds


def over_peers(pool: Executor, names: list[str], count: int) -> dict[str, Any]:
    """What peers get wrong."""
    peers: dict[str, Any] = {name: {} for name in names}
    work_list = tasks(names, count)
    for (peer, _, _), found in zip(
        work_list, pool.map(compare, work_list), strict=True
    ):
        for kind, part in found.items():
            whole = peers[peer].setdefault(
                kind, {"asked": 0, "unsupported": 0, "worst": 0.0, "wrong": {}}
            )
            whole["asked"] += part["asked"]
            whole["unsupported"] += part["unsupported"]
            whole["worst"] = max(whole["worst"], part["worst"])
            for word, case in part["wrong"].items():
                known = whole["wrong"].get(word)
                total = case["count"] + (known["count"] if known else 0)
                if known is None or case["error"] > known["error"]:
                    whole["wrong"][word] = known = dict(case)
                known["count"] = total
        print(f"{peer} asked", flush=True)
    return peers


def over_clipping(pool: Any, total: int) -> dict[str, int]:
    """How often the sign of the distance and clipped edges agree, of so many pairs."""
    each = BATCH * PLACES
    batches = [(seed, BATCH) for seed in range(-(-total // each))]
    parts = pool.starmap(compared, batches, chunksize=1)
    return {key: sum(part[key] for part in parts) for key in parts[0]}


def show(name: str, regime: str, number: str) -> None:
    """One case: the shapes, what we say, what the oracle says, what peers say."""
    batch = judge(*NAMES[name], regime, [int(number)])
    pair = batch.pairs[0]
    print(pair.shape_a, pair.T_a, pair.shape_b, pair.T_b, sep="\n")
    print(f"armguard {batch.out[0, 0]:.17g}, witness row {batch.out[0].tolist()}")
    print(f"true     {batch.lower[0]:.17g} to {batch.upper[0]:.17g}")
    for figure, entry in summed_up(batch, 1).items():
        print(f"  {figure}: {entry}")
    for peer, ask in PEERS.items():
        try:
            print(f"{peer} {ask(pair)}")
        except Exception as error:
            print(f"{peer} refuses: {error}")


def main() -> None:
    """Run, write docs/accuracy.json and docs/accuracy.md."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pairs", type=int, default=1_000_000)
    parser.add_argument("--peers", type=int, default=100, help="pairs a peer, each")
    parser.add_argument("--clipping", action="store_true", help="clipping alone")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--page", action="store_true", help="from the last results")
    parser.add_argument("--show", nargs=3, metavar=("KINDS", "REGIME", "NUMBER"))
    chosen = parser.parse_args()
    if chosen.show:
        show(*chosen.show)
        return
    if chosen.page:
        write_page()
        return
    if chosen.quick:
        chosen.pairs, chosen.peers = 5000, 3
    context = multiprocessing.get_context("spawn")
    with context.Pool(PROCESSES) as pool:
        clipped = over_clipping(pool, chosen.pairs)
        keep(RESULTS, "clipping", clipped, chosen.pairs, ("geometry",))
        if chosen.clipping:
            write_page()
            return
        kinds = over_pairs(pool, chosen.pairs)
    # Workers that start children of their own must not be daemons.
    with ProcessPoolExecutor(PROCESSES, mp_context=context) as pool:
        peers = over_peers(pool, list(PEERS) if chosen.peers else [], chosen.peers)
    keep(RESULTS, "kinds", kinds, chosen.pairs, ("geometry",))
    found = {
        "count": chosen.peers,
        "found": peers,
        "versions": {name: version(d) for name, d in DISTRIBUTIONS.items()},
    }
    keep(RESULTS, "peers", found, chosen.peers, ("geometry",))
    write_page()


def write_page() -> None:
    """Write docs/accuracy.md from docs/accuracy.json."""
    (DOCS / "accuracy.md").write_text(page(read(RESULTS)), encoding="utf-8")
    print("wrote docs/accuracy.md")


def page(results: dict[str, Any]) -> str:
    """The whole page."""
    kinds = results["kinds"]
    return rendered(
        "accuracy",
        kinds=kinds,
        regimes=REGIMES,
        figures=FIGURES,
        targets=TARGETS,
        missed=MISSED,
        worst={
            figure: max(kinds, key=lambda kind: kinds[kind][figure]["worst"])
            for figure in FIGURES
        },
        peers=results["peers"],
        clipping=results["clipping"],
        notable=NOTABLE,
        verdicts=VERDICTS,
        kernels=kernels_in_words(results),
    )


if __name__ == "__main__":
    main()
