"""Attacks on all doors, judged from outside; writes docs/security.json and its table.

make attack                               all of it, at most ten minutes on two cores
make attack ARGS="--only keys browser"    some of it, the others as they were
make attack ARGS="--share 0.01"           a hundredth of it, to try it out
make attack ARGS="--full"                 with all the connections and mutants: longer
make attack ARGS="--page"                 the table from the last results
"""

import argparse
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from armguard.cli.console import jsonable, say
from attack.row import write_table
from episodes.kernels import GUARD, told_of
from episodes.records import keep, read

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "docs" / "security.json"

# Doors that are attacked at a time.
AT_A_TIME = 2

# Which mutants of files are tried.
SEED = 20


def counts(share: float, full: bool) -> Mapping[str, tuple[str, tuple[float, ...]]]:
    """Module and arguments of the attacks on each door, those that take longest first.

    Args:
        share: Share of the tries of each kind.
        full: Whether to try as often as it takes hours for.
    """

    def part(count: int) -> int:
        return max(int(share * count), 1)

    connections, seconds = (1_000_000, 3600.0) if full else (100_000, 150.0)
    return {
        "starts": ("starts", (part(50), part(100 if full else 30))),
        "recordings": ("others", (part(100_000 if full else 20_000), SEED)),
        "inputs": ("others", (part(100_000 if full else 5_000), SEED)),
        "connects": ("connects", (part(connections), max(share * seconds, 30.0))),
        "zenoh": ("others", (part(10_000),)),
        "browser": ("others", (part(1_000), part(1_000))),
        "keys": ("service", (part(10_000),)),
        "fixtures": ("rack", (part(5),)),
        "desires": ("desires", (part(6),)),
    }


DOORS = tuple(counts(1.0, False))


def attack(door: str, share: float, full: bool) -> dict[str, Any]:
    """Attack a door: rows of the table, and how long it took [s]."""
    module, words = counts(share, full)[door]
    began = time.monotonic()
    made = import_module(f"attack.{module}")
    run: Callable[..., Any] = getattr(made, door) if module == "others" else made.run
    rows = [jsonable(asdict(row)) for row in run(*words)]
    return {"rows": rows, "seconds": time.monotonic() - began}


def attacked(
    chosen: list[str], share: float, full: bool
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Attack doors, some at a time; each door and what came of it when it is done."""
    context = get_context("spawn")
    with ProcessPoolExecutor(AT_A_TIME, context, max_tasks_per_child=1) as pool:
        running = {pool.submit(attack, door, share, full): door for door in chosen}
        for one in as_completed(running):
            say(f"{running[one]}: {one.result()['seconds']:.0f} s")
            yield running[one], one.result()


def main() -> int:
    """Attack, write docs/security.json and the table; 1 if an attack had an effect."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", choices=DOORS, default=list(DOORS))
    parser.add_argument("--share", type=float, default=1.0, help="of all tries")
    parser.add_argument("--full", action="store_true", help="see above")
    parser.add_argument("--page", action="store_true", help="from the last results")
    chosen = parser.parse_args()
    if not chosen.page:
        for door, found in attacked(chosen.only, chosen.share, chosen.full):
            tried = sum(row["tried"] for row in found["rows"])
            keep(RESULTS, door, found, tried, (*GUARD, "station"))
    known = read(RESULTS)
    results = {name: known[name] for name in DOORS if name in known}
    write_table(results, RESULTS.with_suffix(".md"), told_of(known, *results))
    rows = [row for one in results.values() for row in one["rows"]]
    failed = [row for row in rows if not row["passed"]]
    for row in failed:
        say(
            f"FAIL {row['attack']}: {row['had']:,} {row['unit']} of {row['tried']:,}; "
            f"{row['note']}"
        )
    say(f"{len(rows) - len(failed)} of {len(rows)} rows are as they are to be")
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
