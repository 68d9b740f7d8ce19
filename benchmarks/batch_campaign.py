"""Rates, proofs and plans of batches; writes docs/batch.json, docs/batch.md and plots.

make batch-campaign ARGS=panda_59_spheres.json   all of it, half an hour
make batch-campaign ARGS="--planning FILE"       the plans alone, some ten minutes
make batch-campaign ARGS=--page                  the page from the last results
"""

import json
from pathlib import Path
from typing import Any

import batch_planning
import batch_proofs
import batch_rates
from episodes.campaign import command
from pages import DOCS, rendered
from plots import drawn
from timing import describe_machine

RESULTS = DOCS / "batch.json"
IMAGES = DOCS / "images"

# Items in each scene of `batch_rates.SCENES`.
ITEMS = {name: sum(count) for name, count in batch_rates.SCENES.items()}


def draw_rates(figures: dict[str, Any], path: Path) -> None:
    """Times by scene size and by margin."""
    rates = figures["rates"]
    with drawn(path, (9.0, 3.8), 2) as (left, right):
        for robot in figures["robots"]:
            for kind in ("motions", "about home"):
                times = [rates[f"{robot}, {s}"][kind]["clear"] for s in ITEMS]
                left.plot([*ITEMS.values()], times, "o-", label=f"{robot}, {kind}")
            for rest in ("", ", own links left out"):
                row = rates[f"{robot}, by margin{rest}"]
                places = [str(m) for m in row]
                right.plot(places, [*row.values()], "o-", label=f"{robot}{rest}")
        left.set(xlabel="balls and boxes", ylabel="clear [ns a row]", ylim=(0, None))
        right.set(xlabel="margin [m]", ylabel="distances [ns a row]", ylim=(0, None))
        left.legend(fontsize=8)
        right.legend(fontsize=8)


def draw_proofs(figures: dict[str, Any], path: Path) -> None:
    """Share of proven motions by their least distance above a buffer."""
    edges = [1e3 * edge for edge in batch_proofs.EDGES]
    with drawn(path, (6.0, 3.8)) as (axes,):
        for name, row in figures["proofs"].items():
            shares = row["share by clearance"]
            known = [
                (x, s) for x, s in zip(edges[1:], shares, strict=True) if s is not None
            ]
            axes.plot(*zip(*known, strict=True), "o-", label=name)
        axes.set(
            xscale="log",
            xlabel="least headroom of samples, up to [mm]",
            ylabel="share proven",
        )
        axes.set_ylim(0.0, 1.05)
        axes.legend()


def main() -> None:
    """Measure, unless only the page is wanted, and write."""
    parser = command(__doc__)
    parser.add_argument("files", nargs="*", metavar="FILE", help="robots of spheres")
    parser.add_argument("--planning", action="store_true")
    parser.add_argument("--page", action="store_true")
    chosen = parser.parse_args()
    files = chosen.files
    if chosen.planning:
        figures = json.loads(RESULTS.read_text(encoding="utf-8"))
        figures["planning"] = batch_planning.measure(files)
        RESULTS.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    elif not chosen.page:
        robots = batch_rates.robots_of(files)
        figures = {
            "machine": describe_machine(),
            "robots": [*robots],
            "rates": batch_rates.measure(robots, peers=True),
            "proofs": batch_proofs.measure(batch_proofs.MOTIONS),
            "planning": batch_planning.measure(files),
        }
        RESULTS.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    figures = json.loads(RESULTS.read_text(encoding="utf-8"))
    draw_rates(figures, IMAGES / "batch_rates.png")
    draw_proofs(figures, IMAGES / "batch_proofs.png")
    (DOCS / "batch.md").write_text(rendered("batch", **figures), encoding="utf-8")
    print("wrote docs/batch.md")


if __name__ == "__main__":
    main()
