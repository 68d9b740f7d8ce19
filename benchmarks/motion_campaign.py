"""Observables of motion: lines past thin things, times to contact, supervision.

make motion                                   all of it, about an hour
make motion ARGS="--part thin --share 0.02"   some of it, to try it out
python benchmarks/motion_campaign.py --page   the page anew from the last figures
"""

import argparse
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

from armguard.benchmark.machine import describe_machine
from armguard.cli.console import say
from episodes.records import keep, read
from motions.clocks import clock_figures
from motions.contact_time import approach_figures, contact_figures
from motions.contradictions import clean_figures, contradiction_figures
from motions.page import page
from motions.refused import refused_figures
from motions.slower import slower_figures
from motions.thin import thin_figures

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
RESULTS = DOCS / "motion.json"

Progress = Callable[[str], None]

# Lines past thin things; motions to contact; episodes of a plant that gets slower.
LINES = 10_000
MOTIONS = 1_000_000
EPISODES = 250

# Episodes with a wrong cycle; plays of a contradiction at each speed; clean cycles.
WRONG_CYCLES = 10_000
PLAYS = 100
CLEAN = 10_000_000

PARTS: Mapping[str, Callable[[float, int, Progress], dict[str, Any]]] = {
    "thin": lambda share, seed, tell: thin_figures(int(share * LINES), seed, tell),
    "contact": lambda share, seed, tell: contact_figures(
        int(share * MOTIONS), seed, tell
    ),
    "approach": lambda share, seed, tell: approach_figures(seed, tell),
    "slower": lambda share, seed, tell: slower_figures(
        int(share * EPISODES), seed, tell
    ),
    "clocks": lambda share, seed, tell: clock_figures(tell),
    "refused": lambda share, seed, tell: refused_figures(
        int(share * WRONG_CYCLES), seed, DOCS, tell
    ),
    "contradictions": lambda share, seed, tell: contradiction_figures(
        max(int(share * PLAYS), 1), seed, tell
    ),
    "clean": lambda share, seed, tell: clean_figures(int(share * CLEAN), seed, tell),
}


def main() -> None:
    """Measure; write docs/motion.json and .md."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--part", choices=PARTS, help="all if left out")
    parser.add_argument("--share", type=float, default=1.0, help="of the campaign")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--page", action="store_true", help="from the last figures")
    parser.add_argument("--output", type=Path, default=RESULTS)
    chosen = parser.parse_args()
    output: Path = chosen.output
    parts = [] if chosen.page else [chosen.part] if chosen.part else list(PARTS)
    for name in parts:
        figures = PARTS[name](chosen.share, chosen.seed, say)
        found = {"machine": describe_machine(), **figures}
        keep(output, name, found, chosen.share)
    output.with_suffix(".md").write_text(page(read(output)), encoding="utf-8")


if __name__ == "__main__":
    main()
