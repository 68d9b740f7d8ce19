"""Which published rows were measured with other kernels than those of today.

make campaigns-due

Prints a table: what, how much of it was run, with which kernels, and how to run it
anew; a run goes on until it is as long as the row that it takes the place of.
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from episodes.kernels import UNKNOWN, is_todays, kernels_of
from episodes.records import read, versions_of
from pages import DOCS

# How the figures of a file are measured; PART is one of its rows.
COMMANDS = {
    "closed_loop": "make closed-loop",
    "gripping_campaign": 'make gripping ARGS="--kind PART"',
    "evading": 'make evading ARGS="--kind PART"',
    "sensed_loops": "make sensed-loops ARGS=\"--kind 'PART'\"",
    "freedom": "make freedom ARGS=\"--kind 'PART'\"",
    "reach": "make reach",
    "map": "make map-campaign ARGS=\"--kind 'PART'\"",
    "coordinate": "make coordinate-campaign ARGS=\"--kind 'PART'\"",
    "verify": 'make verify-campaign ARGS="--kind PART"',
    "soak": 'make soak ARGS="--kind PART"',
    "motion": 'make motion ARGS="--part PART"',
    "inputs": 'make motion ARGS="--part PART"',
    "room": 'make room ARGS="--only PART"',
    "ways_out": "make ways-out",
    "accuracy": "make accuracy",
    "results": 'make campaign ARGS="--only PART"',
    "security": 'make attack ARGS="--only PART"',
    "cue_times": "make cues",
    "reflex": "make reflex-campaign ARGS=\"--kind 'PART'\"",
    "filter_peer": "make filter-peer",
}


class Due(NamedTuple):
    """A row that was measured with other kernels."""

    row: str
    size: float
    kernels: str
    command: str


def due(docs: Path) -> Iterator[Due]:
    """Rows of all files that were measured with other kernels."""
    for name, command in COMMANDS.items():
        results = read(docs / f"{name}.json")
        runs = results.pop("runs", None)
        for part, figures in results.items():
            rows = versions_of(figures) if runs is None else [runs.get(part, {})]
            for row in rows:
                if not is_todays(row):
                    size = row.get("size", row.get("episodes", 0))
                    again = command.replace("PART", part)
                    kernels = row.get("kernels", UNKNOWN)
                    yield Due(f"{name} {part}", size, kernels, again)


def main() -> int:
    """Print them; always 0."""
    found = list(due(DOCS))
    print(f"kernels of today: {kernels_of()}; rows of other kernels: {len(found)}")
    if found:
        rows = [("row", "run", "kernels", "again")]
        for d in found:
            size = f"{d.size:g}" if isinstance(d.size, float) else str(d.size)
            rows.append((d.row, size, d.kernels, d.command))
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        for row in rows:
            cells = (c.ljust(w) for c, w in zip(row, widths, strict=True))
            print("  ".join(cells).rstrip())
    return 0


if __name__ == "__main__":
    sys.exit(main())
