"""Mutants of the deciding code against the tests: what lives shows what no test asks.

make mutants                                  what is due; hours the first time
make mutants ARGS="--only guard/stops.py"     some of it: a file, a kernel, an identity
make mutants ARGS="--list --only stops"       every mutant and how it fared
make mutants ARGS=--due                       those whose kernel or tests have changed
"""

import argparse
import importlib
import os
import re
import sys
from collections.abc import Sequence
from pathlib import Path

from mutants.build import build
from mutants.page import page
from mutants.places import Mutant
from mutants.results import (
    Known,
    added,
    digest_of,
    is_due,
    read_equivalent,
    read_results,
    read_tests,
    record,
    write_results,
)
from mutants.trial import Outcome, Trial, tests_of

ROOT = Path(__file__).parents[1]
BUILD = ROOT / "build" / "mutants"
RESULTS = ROOT / "docs" / "mutants.json"

# How many mutants the build holds, and the seed they are drawn by.
COUNT, SEED = 520, 0

TESTS = ("tests/motion", "tests/guard", "tests/respond", "tests/index")
TESTS += ("tests/closed_loop",)

# Processor time a mutant's tests may take [s].
LIMIT = 300.0


def main() -> None:
    """Build, try what is due, write docs/mutants.json and .md."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", default="", help="pattern of file:kernel:identity")
    parser.add_argument("--first", type=int, help="no more than so many")
    parser.add_argument("--limit", type=float, default=LIMIT, help="[s] for each")
    parser.add_argument("--workers", type=int, default=1, choices=(1, 2))
    parser.add_argument("--list", action="store_true", help="of all, with outcomes")
    parser.add_argument("--due", action="store_true", help="list what is to be tried")
    parser.add_argument("--page", action="store_true", help="the page anew, no run")
    parser.add_argument(
        "--again", action="store_true", help="try what is known as well"
    )
    parser.add_argument("--tests", nargs="*", default=list(TESTS))
    chosen = parser.parse_args()
    # One thread: a fork would lose the others. The build has caches of its own.
    os.environ |= {
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "PYTHONPATH": str(BUILD / "src"),
        "ARMGUARD_CACHE": str(BUILD / "cache"),
    }
    mutants = build(ROOT / "src" / "armguard", BUILD / "src" / "armguard", COUNT, SEED)
    # What is imported so far comes from the package itself; the rest is to be mutated.
    sys.path.insert(0, str(BUILD / "src"))
    importlib.invalidate_caches()
    for name in [name for name in sys.modules if name.split(".")[0] == "armguard"]:
        del sys.modules[name]
    known = results_of(mutants)
    tested = digest_of(test_files(chosen.tests), ROOT)
    wanted = [
        one
        for one in mutants
        if re.search(chosen.only, f"{one.file}:{one.function}:{one.identity}")
    ]
    due = [
        one
        for one in wanted
        if chosen.again or is_due(one, known, ROOT, tested, chosen.limit)
    ]
    if chosen.list or chosen.due:
        for one in due if chosen.due else wanted:
            outcome = known.get(one.identity, {"outcome": "not tried"})["outcome"]
            print(f"{one.identity} {outcome:9} {text_of(one)}")
        return
    from armguard import kernel, mutant_switch
    from timing import describe_machine

    if not kernel.PACKAGE.is_relative_to(BUILD):
        raise SystemExit(f"the package is imported from {kernel.PACKAGE}, not {BUILD}")
    machine = describe_machine()
    about = {
        "kernels": kernel.KERNEL_CACHE.name.removeprefix("kernels-"),
        "tests": sorted({*read_tests(RESULTS), *chosen.tests}),
        "limit": chosen.limit,
        "machine": f"{machine['cpu']}, Python {machine['python']}",
    }

    def keep(mutant: Mutant, outcome: Outcome) -> None:
        """Keep and print an outcome."""
        entry = record(mutant, outcome, ROOT)
        # Another run may have kept something meanwhile.
        known.update(results_of(mutants))
        entry |= {"tested": tested, "limit": chosen.limit}
        before = None if chosen.again else known.get(mutant.identity)
        known[mutant.identity] = added(before, entry)
        write_results(RESULTS, known, about)
        write_page(known, about)
        killed = sum(one["outcome"] == "killed" for one in known.values())
        print(
            f"{killed}/{len(known)} {mutant.identity} {outcome.outcome} {outcome.how} "
            f"{outcome.run}/{outcome.tests} tests {outcome.seconds:g} s "
            f"{text_of(mutant)} {outcome.by}",
            flush=True,
        )

    if chosen.page:
        write_page(known, about)
        return
    trial = Trial(
        mutant_switch,
        due[: chosen.first],
        mutants,
        BUILD / f"dry-{about['kernels']}.json",
        {file: digest_of([file], ROOT) for file in test_files(chosen.tests)},
        {
            key: one["passed"]
            for key, one in known.items()
            if "passed" in one and not chosen.again
        },
        chosen.limit,
        chosen.workers,
        keep,
        lambda text: print(text, flush=True),
    )
    run_tests(trial, chosen.tests)


def results_of(mutants: Sequence[Mutant]) -> Known:
    """What is known of these mutants."""
    known = read_results(RESULTS)
    return {
        one.identity: known[one.identity] for one in mutants if one.identity in known
    }


def run_tests(trial: Trial, tests: Sequence[str]) -> None:
    """Start pytest once; it collects the tests that every fork runs."""
    import hypothesis
    import pytest

    # The same examples each time: a dry run could say nothing of others.
    hypothesis.settings.register_profile(
        "mutants", derandomize=True, database=None, deadline=None
    )
    hypothesis.settings.load_profile("mutants")
    code = pytest.main(list(tests_of(tests)), plugins=[trial])
    if code:
        raise SystemExit(int(code))


def test_files(tests: Sequence[str]) -> list[str]:
    """Files of the chosen tests, and those beside them that hold what they share."""
    found = set((ROOT / "tests").glob("*.py"))
    for name in tests:
        path = ROOT / name.split("::")[0]
        found |= set(path.rglob("*.py")) if path.is_dir() else {path}
    return sorted(path.relative_to(ROOT).as_posix() for path in found)


def write_page(known: Known, about: dict[str, object]) -> None:
    """Write docs/mutants.md."""
    text = page(known, about, read_equivalent())
    RESULTS.with_suffix(".md").write_text(text, encoding="utf-8")


def text_of(one: Mutant) -> str:
    """A mutant in a line."""
    return f"{one.file}:{one.at} {one.function}: {one.before} -> {one.after}"


if __name__ == "__main__":
    main()
