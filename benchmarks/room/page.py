"""Writes docs/room.md from the figures."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import paper_buffer as paper
from episodes.kernels import told_of
from room.co_braking import WAYS
from room.plots import draw_co_braking, draw_least, draw_needs, draw_warnings
from room.summary import closing_bounds, needs, passed_at, warned_at, worst
from room.warned import MODES

Rows = Sequence[Mapping[str, Any]]

# Targets: path beside speed at this speed of the tool; co-braking beside an object; and
# the clearance at the stop beside the least that does [-].
AT_SPEED = "0.25"
HALF = 0.5
SAVED = 0.30
BESIDE_LEAST = 1.3


def write_page(results: Mapping[str, Rows], docs: Path) -> None:
    """Write the page and its plots."""
    rows, passed = results["approaches"], results["passing"]
    head_on, wall = results["co_braking"], results["least_buffer"]
    images = docs / "images"
    draw_warnings(rows, passed, images / "room_warnings.png")
    draw_needs(rows, images / "room_needs.png")
    draw_co_braking(head_on, images / "room_co_braking.png")
    draw_least(wall, images / "room_least.png")
    text = "\n".join(
        [
            "# How much room a guard leaves",
            "",
            "Written by `make room`, from [room.json](room.json).",
            "",
            *targets(rows, passed, head_on, wall),
            *warnings_section(rows, passed),
            *co_braking_section(head_on),
            *least_section(wall),
            told_of(results),
            "",
        ]
    )
    (docs / "room.md").write_text(text, encoding="utf-8")


def targets(rows: Rows, passed: Rows, head_on: Rows, wall: Rows) -> list[str]:
    """What was aimed at, beside what was measured."""
    stop, slow = (warned_at(rows, level)[AT_SPEED] for level in ("STOP", "SLOW"))
    by = {level: passed_at(passed, level)[AT_SPEED] for level in ("STOP", "SLOW")}
    fair, declared = (saved(head_on, way) for way in WAYS[1:])
    contacts = sum(row[WAYS[0]]["contacts"] for row in head_on)
    runs = sum(row[WAYS[0]]["runs"] for row in head_on)
    ratio = worst(wall, beside_least)
    lines = [
        ("approach, path beside speed at 0.25 m/s, stop", HALF, stop["ratio"]),
        ("the same, first slow", HALF, slow["ratio"]),
        ("passing, path beside speed at 0.25 m/s, stop", HALF, by["STOP"]["ratio"]),
        ("the same, first slow", HALF, by["SLOW"]["ratio"]),
    ]
    table_rows = [
        [
            what,
            f"≤ {aim:.2f}",
            "not known" if got is None else f"{got:.2f}",
            met(got, aim),
        ]
        for what, aim, got in lines
    ]
    for what, shares in (
        ("an object of its declared top speed", declared),
        ("an object of its actual speed", fair),
    ):
        least = min(shares)
        table_rows.append(
            [
                f"head-on, gap saved by one guard beside {what}",
                f"≥ {SAVED:.0%}",
                f"{least:.0%} to {max(shares):.0%}",
                "yes" if least >= SAVED else "not everywhere",
            ]
        )
    table_rows.append(
        ["contacts head-on", "0", f"{contacts} in {runs} runs", met(contacts, 0)]
    )
    table_rows.append(
        [
            "path beside the least fixed buffer that does, worst of 6, 12, 24 in/s",
            f"≤ {BESIDE_LEAST}",
            f"{ratio:.2f}",
            met(ratio, BESIDE_LEAST),
        ]
    )
    return [*table("figure | target | measured | met", table_rows), ""]


def warnings_section(rows: Rows, passed: Rows) -> list[str]:
    """How near an operator may work."""
    kinds = {"all": None, "at a fixture": "fixture", "at the other arm": "arm"}
    body = []
    for level in ("STOP", "SLOW"):
        for name, kind in kinds.items():
            for speed, m in warned_at(rows, level, kind).items():
                modes = [mm(m[mode]) for mode in MODES]
                if level == "SLOW":
                    modes[-1] = "–"
                body.append(
                    [
                        level,
                        name,
                        speed,
                        str(m["count"]),
                        *modes,
                        f"{m['ratio']:.2f}",
                        f"{m['half']:.0%}",
                        f"{m['full']:.0%}",
                    ]
                )
    beside = []
    for level in ("STOP", "SLOW"):
        for speed, m in passed_at(passed, level).items():
            modes = [mm(m[mode]) for mode in MODES]
            if level == "SLOW":
                modes[-1] = "–"
            ratio = "–" if m["ratio"] is None else f"{m['ratio']:.2f}"
            told = [level, speed, f"{m['count']} of {m['of']}", *modes, ratio]
            beside.append([*told, mm(m["path_alone"])])
    coarse = needs(rows, "speed")[AT_SPEED]["path"]
    closing = closing_bounds(rows)[AT_SPEED]
    slow, stop = (warned_at(rows, level)[AT_SPEED] for level in ("SLOW", "STOP"))
    way = slow["path"] - stop["path"]
    return [
        "## How near an operator may work",
        "",
        "![Mean clearance at the first slow and at the stop, by "
        "mode](images/room_warnings.png)",
        "",
        "Two arms in the bay, with its own stopping figures. A tool is led in a "
        "straight line from standstill at a fixture, or at the other arm, from 0.3 "
        "to 0.8 m away; the arm's other freedom swings at random. The guard gets "
        "exact positions and velocities every millisecond. Told is the true "
        "distance of the pair that is slowed or stopped for; *half*: share of the "
        "approaches in which path needs at most half of what speed does; *full "
        "speed*: share in which the tool had its speed when both modes warned. "
        "Where that is less than half, or fewer than half of the passages count, the "
        "plot has no point.",
        "",
        *table(
            "level | approach | tool [m/s] | count | path [mm] | speed [mm] | "
            "fixed [mm] | path / speed | half | full speed",
            body,
        ),
        "",
        "![What the pair at the stop needs, by cause](images/room_needs.png)",
        "",
        f"The stop of mode speed holds {mm(coarse)} mm at {AT_SPEED} m/s for what "
        "levers do not know: where the joints lead. Time left, by which arms are "
        "slowed, goes by the closing speed that levers allow in mode speed, by the "
        f"rate along the pair's normal in mode path: {closing:.2f} m/s on average at "
        f"{AT_SPEED} m/s. From its slow to its stop path lets the "
        f"clearance fall by {mm(way)} mm, "
        f"{way / float(AT_SPEED):.2f} s of the tool's way.",
        "",
        "### Passing by",
        "",
        "One arm alone; its tool goes 0.5 m in a straight line along a panel of 0.3 "
        "m by 0.2 m, parallel to its way. Told is the least distance at which the "
        "panel may stand without a slow, or a stop; *count*: passages that every "
        "mode lets pass when there is no panel, and that have such a distance "
        "within 0.8 m; found to 2 mm. The last column has path over all it lets "
        "pass.",
        "",
        *table(
            "level | tool [m/s] | count | path [mm] | speed [mm] | fixed [mm] | "
            "path / speed | path, all [mm]",
            beside,
        ),
        "",
    ]


def co_braking_section(rows: Rows) -> list[str]:
    """Two arms head-on."""
    body = [
        [
            row["arm"],
            f"{row['tool_speed']:g}",
            *(mm(row[way]["gap"]) for way in WAYS),
            *(f"{1.0 - row[WAYS[0]]['gap'] / row[way]['gap']:.0%}" for way in WAYS[1:]),
            f"{1e3 * row[WAYS[0]]['least']:.1f}",
        ]
        for row in rows
    ]
    return [
        "## Two arms head-on",
        "",
        "![Gap at the stop by who knows what](images/room_co_braking.png)",
        "",
        "Two slides face each other, each at the speed told; top speed 1.25 m/s, "
        "floor 5 mm. Under one guard both brake. Under its own guard each arm takes "
        "the other for an object, seen every millisecond, that nobody stops. The "
        "plant is as bad as declared: old measurements that flatter, full "
        "acceleration from the last moment on, late and soft stops. *least*: what "
        "stays between them under one guard.",
        "",
        *table(
            "figures | each [m/s] | one guard [mm] | own, actual speed [mm] | "
            "own, top speed [mm] | saved of actual | saved of top | least [mm]",
            body,
        ),
        "",
        "An object of the actual speed is no safe stand-in: the other arm may speed up "
        "until its stop takes effect, which one guard counts and such an object does "
        "not. Without floor, latency and swing the saving is a third at any speed: an "
        "arm that brakes evenly makes half of the way of one that goes on, so two that "
        "brake need 1 where they would need 1.5. Floor and latency are the same either "
        "way and lessen it, most at low speed; a swing adds to it, since what nobody "
        "stops goes on while the arm settles.",
        "",
    ]


def least_section(rows: Rows) -> list[str]:
    """The paper's arm at a wall."""
    names = ("path, floor 0 mm", "path, floor 5 mm", "speed mode")
    body = [
        [
            row["arm"],
            f"{row['tool_speed'] / paper.INCH:.0f}",
            mm(row["least"]),
            mm(row["closed_form"]),
            *(
                f"{mm(got)} ({got / row['least']:.2f})"
                for got in (row[name]["distance"] for name in names)
            ),
            f"{1e3 * row['path, floor 0 mm']['least']:.2f}",
        ]
        for row in rows
    ]
    return [
        "## Beside the least that does",
        "",
        "![Clearance at the stop beside the least fixed buffer that "
        "does](images/room_least.png)",
        "",
        "The paper's arm as one slide, head-on at a wall, with the figures of "
        "[paper.md](paper.md#what-the-papers-own-numbers-imply): latency 25 ms and "
        "a long swing, or 48 in/s² after the same latency. The least fixed buffer "
        "is found by bisection to 0.2 mm with the same worst plant; the closed form "
        "beside it is `stop_travel` and the error of a position. In brackets: times "
        "the least. *left*: least distance under path with no floor.",
        "",
        *table(
            "figures | tool [in/s] | least [mm] | closed form [mm] | "
            "path, floor 0 [mm] | path, floor 5 mm [mm] | "
            "speed, floor 0 [mm] | left [mm]",
            body,
        ),
        "",
    ]


def saved(rows: Rows, way: str) -> list[float]:
    """Shares of the gap that one guard saves, row by row [-]."""
    return [1.0 - row[WAYS[0]]["gap"] / row[way]["gap"] for row in rows]


def beside_least(row: Mapping[str, Any]) -> float:
    """Clearance of path, with the floor a scene has, by the least that does [-]."""
    return float(row["path, floor 5 mm"]["distance"] / row["least"])


def met(got: float | None, aim: float) -> str:
    """Whether a figure is at most what was aimed at."""
    return "yes" if got is not None and got <= aim else "no"


def mm(length: float | None) -> str:
    """A length in millimetres."""
    return "–" if length is None else f"{1e3 * length:.1f}"


def table(head: str, rows: Sequence[Sequence[str]]) -> list[str]:
    """A table in Markdown; titles of its columns are divided by bars."""
    rule = ["---"] * len(head.split("|"))
    return [f"| {head} |", *("| " + " | ".join(line) + " |" for line in [rule, *rows])]
