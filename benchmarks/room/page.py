"""Writes docs/room.md from the figures."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import paper_buffer as paper
from episodes.kernels import told_of
from pages import rendered
from room.co_braking import WAYS
from room.plots import draw_co_braking, draw_least, draw_needs, draw_warnings
from room.summary import LEVELS, closing_bounds, needs, passed_at, warned_at

Rows = Sequence[Mapping[str, Any]]

KINDS = {"all": None, "at a fixture": "fixture", "at the other arm": "arm"}

# Speed of the tool that the targets and the text are about [m/s].
AT_SPEED = "0.25"


def write_page(results: Mapping[str, Rows], docs: Path) -> None:
    """Write the page and its plots."""
    rows, passed = results["approaches"], results["passing"]
    head_on, wall = results["co_braking"], results["least_buffer"]
    images = docs / "images"
    draw_warnings(rows, passed, images / "room_warnings.png")
    draw_needs(rows, images / "room_needs.png")
    draw_co_braking(head_on, images / "room_co_braking.png")
    draw_least(wall, images / "room_least.png")
    text = rendered(
        "room",
        warned={
            level: {name: warned_at(rows, level, kind) for name, kind in KINDS.items()}
            for level in LEVELS
        },
        passed={level: passed_at(passed, level) for level in LEVELS},
        head_on=head_on,
        wall=wall,
        ways=WAYS,
        saved_by={
            way: [1.0 - row[WAYS[0]]["gap"] / row[way]["gap"] for row in head_on]
            for way in WAYS[1:]
        },
        beside_least=max(r["path, floor 5 mm"]["distance"] / r["least"] for r in wall),
        unknown=needs(rows, "speed")[AT_SPEED]["path"],
        closing=closing_bounds(rows)[AT_SPEED],
        inch=paper.INCH,
        kernels=told_of(results),
    )
    (docs / "room.md").write_text(text, encoding="utf-8")
