"""Observables of motion: lines past thin bodies, times to contact, supervision.

make motion                                   all of it, about an hour
make motion ARGS="--part thin --share 0.02"   some of it, to try it out
python benchmarks/motion_campaign.py --page   the page anew from the last figures
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from episodes.campaign import command
from episodes.kernels import kernels_in_words
from episodes.records import keep, read
from motions.clocks import clock_figures
from motions.contact_time import approach_figures, contact_figures
from motions.contradictions import clean_figures, contradiction_figures
from motions.refused import refused_figures
from motions.slower import slower_figures
from motions.thin import thin_figures
from pages import DOCS, rendered
from timing import describe_machine

RESULTS = DOCS / "motion.json"

Figures = dict[str, Any]

# Lines past thin bodies; motions to contact; episodes of a plant that gets slower.
LINES = 10_000
MOTIONS = 1_000_000
EPISODES = 250

# Episodes with a wrong cycle; plays of a contradiction at each speed; clean cycles.
WRONG_CYCLES = 10_000
PLAYS = 100
CLEAN = 10_000_000

PARTS: Mapping[str, Callable[[float, int], Figures]] = {
    "thin": lambda share, seed: thin_figures(int(share * LINES), seed),
    "contact": lambda share, seed: contact_figures(int(share * MOTIONS), seed),
    "approach": lambda _, seed: approach_figures(seed),
    "slower": lambda share, seed: slower_figures(int(share * EPISODES), seed),
    "clocks": lambda *_: clock_figures(),
    "refused": lambda share, seed: refused_figures(
        int(share * WRONG_CYCLES), seed, DOCS
    ),
    "contradictions": lambda share, seed: contradiction_figures(
        max(int(share * PLAYS), 1), seed
    ),
    "clean": lambda share, seed: clean_figures(int(share * CLEAN), seed),
}


def main() -> None:
    """Measure; write docs/motion.json and .md."""
    parser = command(__doc__)
    parser.add_argument("--part", choices=PARTS, help="all if left out")
    parser.add_argument("--share", type=float, default=1.0, help="of the campaign")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--page", action="store_true", help="from the last figures")
    parser.add_argument("--output", type=Path, default=RESULTS)
    chosen = parser.parse_args()
    output: Path = chosen.output
    parts = [] if chosen.page else [chosen.part] if chosen.part else list(PARTS)
    for name in parts:
        figures = PARTS[name](chosen.share, chosen.seed)
        found = {"machine": describe_machine(), **figures}
        keep(output, name, found, chosen.share)
    output.with_suffix(".md").write_text(page(read(output)), encoding="utf-8")


def page(results: Figures) -> str:
    """The page, of the parts there are.

    Args:
        results: Figures by part.
    """
    lags = results.get("clocks", {}).get("lags", [])
    by_stop = {(lag["delay_ms"], lag["left"], lag["speed"]): lag["ms"] for lag in lags}
    return rendered(
        "motion",
        **results,
        lags=by_stop,
        lag_kinds=dict.fromkeys((delay, left) for delay, left, _ in by_stop),
        kernels=kernels_in_words(results),
    )


if __name__ == "__main__":
    main()
