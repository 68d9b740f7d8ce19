"""Attacks on all doors, judged from outside; writes docs/security.json and its table.

make attack                               all of it, at most ten minutes on two cores
make attack ARGS="--only keys browser"    some of it, the others as they were
make attack ARGS="--share 0.01"           a hundredth of it, to try it out
make attack ARGS="--full"                 with all the connections and mutants: longer
make attack ARGS="--page"                 the table from the last results
"""

import sys
import time
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from importlib import import_module
from multiprocessing import get_context
from typing import Any

from armguard.cli.console import jsonable, say
from attack.row import Row, none, write_table
from episodes.campaign import command
from episodes.kernels import GUARD, kernels_in_words
from episodes.records import keep, read
from pages import DOCS

RESULTS = DOCS / "security.json"

# Doors that are attacked at a time.
AT_A_TIME = 2

# Which mutants of files are tried.
SEED = 20

# Greatest memory and time that a file may take [MB], [s].
MEMORY, TIME = 1024.0, 20.0


def doors(share: float, full: bool) -> Mapping[str, tuple[Any, ...]]:
    """What attacks each door, a module or a function, and its arguments; longest first.

    Args:
        share: Share of the tries of each kind.
        full: Whether to try as often as it takes hours for.
    """

    def part(count: int) -> int:
        return max(int(share * count), 1)

    connections, seconds = (1_000_000, 3600.0) if full else (100_000, 150.0)
    return {
        "starts": ("starts", part(50), part(100 if full else 30)),
        "recordings": (recordings, part(100_000 if full else 20_000), SEED),
        "inputs": (inputs, part(100_000 if full else 5_000), SEED),
        "connects": ("connects", part(connections), max(share * seconds, 30.0)),
        "zenoh": (zenoh, part(10_000)),
        "browser": (browser, part(1_000), part(1_000)),
        "keys": ("service", part(10_000)),
        "fixtures": ("rack", part(5)),
        "desires": ("desires", part(6)),
    }


def recordings(count: int, seed: int) -> list[Row]:
    """Checkpoints and whole recordings with right checksums, changed at random."""
    from attack.recordings import run

    words = "of recordings, changed, with right checksums"
    found = run(count, seed)
    return [mutants("recording", f"{kind} {words}", found[kind]) for kind in found]


def inputs(count: int, seed: int) -> list[Row]:
    """Scenes, robots, meshes, keys and archives that are none, or much too large."""
    from attack.inputs import run

    found = run(count, seed)
    ended = {**found, "grown_mb": found["peak_MB"]}
    ended["signals"] += found["no_memory"]
    attack = "scenes, robots, meshes and recordings: bombs, then mutants of good files"
    return [mutants("files", attack, ended)]


def mutants(door: str, attack: str, found: Mapping[str, Any]) -> Row:
    """A row of files that were opened."""
    had = found["signals"] + found["tracebacks"]
    memory, time = found["grown_mb"], found["longest_s"]
    return Row(
        attack,
        found["tried"],
        had,
        "signals and tracebacks",
        f"0, at most {MEMORY:.0f} MB and {TIME:.0f} s each",
        had == 0 and memory <= MEMORY and time <= TIME,
        f"at most {memory:.0f} MB and {time:.1f} s",
        found,
        door=door,
    )


def browser(raw: int, sockets: int) -> list[Row]:
    """Messages sent with or right after a handshake, and pages of other origins."""
    from attack.browser import run

    found = run(raw, sockets)
    rows = []
    for kind, attack in (
        ("raw", "messages sent with the handshake, from other origins and without the "
         "cookie"),
        ("chromium", "sockets that pages of other origins open in Chromium"),
    ):  # fmt: skip
        one = found[kind]
        had = (
            sum(one["done"].values())
            + (one["moved_rad"] > 0.0)
            + one["opened"]
            + one.get("ports_told_from_closed_ones", 0)
        )
        unit = "opened, executed or learnt"
        rows.append(none(attack, one["tries"], had, unit, door="browser", **one))
    return rows


def zenoh(count: int) -> list[Row]:
    """Messages that are forged, replayed and moved, as peer, client and by a router."""
    from attack.zenoh_bus import run

    # Attack, what counts its tries, and what counts those that had an effect.
    kinds = (
        ("commands forged", "forged_commands", "forged_commands_obeyed"),
        ("desires and states forged", "forged_wishes", "forged_wishes_accepted"),
        ("claims with force forged", "claims", "claims_granted"),
        ("tokens overheard", "claims", "tokens_overheard"),
    )
    rows = []
    for mode, found in run(count).items():
        for attack, tried, had in kinds:
            more = found if attack == "tokens overheard" else {}
            name, unit = f"{attack} over Zenoh, {mode}", had.rpartition("_")[2]
            rows.append(
                none(name, found[tried], found[had], unit, door="zenoh", **more)
            )
    return rows


DOORS = tuple(doors(1.0, False))


def attack(door: str, share: float, full: bool) -> dict[str, Any]:
    """Attack a door: rows of the table, and how long it took [s]."""
    run, *words = doors(share, full)[door]
    began = time.monotonic()
    if isinstance(run, str):
        run = import_module(f"attack.{run}").run
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
    parser = command(__doc__)
    parser.add_argument("--only", nargs="+", choices=DOORS, default=list(DOORS))
    parser.add_argument("--share", type=float, default=1.0, help="of all tries")
    parser.add_argument("--full", action="store_true", help="see above")
    parser.add_argument("--page", action="store_true", help="from the last results")
    chosen = parser.parse_args()
    if not chosen.page:
        for door, found in attacked(chosen.only, chosen.share, chosen.full):
            tried = sum(row["tried"] for row in found["rows"])
            keep(RESULTS, door, found, tried, (*GUARD, "recording", "service"))
    known = read(RESULTS)
    results = {name: known[name] for name in DOORS if name in known}
    write_table(results, RESULTS.with_suffix(".md"), kernels_in_words(known, *results))
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
