"""docs/motion.md, from the figures."""

from collections.abc import Callable, Mapping
from typing import Any

from closed_loop.page import table
from episodes.kernels import told_of

Figures = Mapping[str, Any]

HEAD = (
    "# Motion: between samples, before contact, when figures are wrong",
    "",
    "Written by `make motion`. Targets beside what was measured, in bold where it "
    "misses them; distances of the truth are Coal's, on MuJoCo's kinematics.",
    "",
)


def page(results: Figures) -> str:
    """The whole page, of the parts there are.

    Args:
        results: Figures by part.
    """
    lines = list(HEAD)
    parts: list[tuple[tuple[str, ...], Callable[..., list[str]]]] = [
        (("thin",), thin),
        (("contact", "approach"), contact),
        (("slower", "clocks"), supervision),
        (("refused",), refused),
        (("contradictions",), contradictions),
        (("clean",), clean),
    ]
    for names, write in parts:
        if all(name in results for name in names):
            lines += write(*(results[name] for name in names))
    lines += [told_of(results), ""]
    return "\n".join(lines)


def targets(rows: list[tuple[str, str, str]], part: str) -> list[str]:
    """The table of targets, and how to measure it again."""
    return [
        *table(["what", "target", "measured"], [list(row) for row in rows]),
        "",
        f'Again: `make motion ARGS="--part {part}"`.',
        "",
    ]


def marked(text: str, met: bool) -> str:
    """A figure, in bold if it misses its target."""
    return text if met else f"**{text}**"


def thin(r: Figures) -> list[str]:
    """Lines past thin things."""
    even, tenfold = r["samples"]
    deepest = max(c["samples"][0]["deepest_missed_mm"] for c in r["cases"])
    plan = r["plan"]
    rows = [
        ("lines missed by `check_path`", "0", f"{r['missed']:,} of {r['lines']:,}"),
        (
            "lines missed by samples that cost as much",
            "> 0",
            f"{even['missed']:,}, up to {deepest:.1f} mm deep",
        ),
        ("lines missed by ten times as many samples", "", f"{tenfold['missed']:,}"),
        (
            "not clear, though more than floor and resolution were kept",
            "0",
            f"{r['false_alarms']:,}",
        ),
        (
            f"check of a plan of {plan['rows']:,} rows",
            "≤ 0.2 s",
            f"{plan['median_s']:.3f} s, longest {plan['longest_s']:.3f} s",
        ),
    ]
    cases = [
        [
            f"{c['floor_mm']:g} mm",
            "needle" if c["needle"] else "none",
            f"{c['lines']:,}",
            f"{c['touching']:,}",
            str(c["missed"]),
            str(c["false_alarms"]),
            f"{1e3 * c['check_s'] / c['lines']:.2f} ms",
            f"{1e3 * c['samples'][0]['step_rad']:.1f} mrad",
            str(c["samples"][0]["missed"]),
            str(c["samples"][1]["missed"]),
        ]
        for c in r["cases"]
    ]
    return [
        "## Nothing is missed between samples",
        "",
        *targets(rows, "thin"),
        "Straight lines of one bay arm's joints, up to 0.6 rad each, past wires and "
        "plates 2 mm thin that stand beside a link somewhere on the way; both ends are "
        "clear. In half of them the tool is a needle, 2 mm thin as well. The truth "
        "is sampled so densely that nothing can move farther between two samples than "
        "it was away, or 0.02 mm. The samples are the guard's own measurements, at "
        "even steps, as many as take the processor time `check_path` takes in all; "
        "they end at the first hit, as it does.",
        "",
        *table(
            [
                "floor",
                "tool",
                "lines",
                "below the floor",
                "missed",
                "false alarms",
                "`check_path`",
                "even step",
                "samples miss",
                "ten times as many",
            ],
            cases,
        ),
        "",
        "Of the lines that stay above the floor "
        f"{r['alarms_nothing_below_floor']:,} were not called clear.",
        "",
    ]


def contact(r: Figures, straight: Figures) -> list[str]:
    """Times to contact."""
    every, close = r["all"], r["approaches"]
    late, hasty = r["wrong_from_cycle"], r["close"]["wrong_from_cycle"]
    rise = max(straight[way]["largest_rise_ms"] for way in ("tool", "joints"))
    rows = [
        (
            "told longer than it was",
            "0",
            f"{every['told_too_long']:,} of {every['motions']:,}",
        ),
        (
            f"the same, measured {r['age_ms']:g} ms before and wrong as declared",
            "0",
            f"{late['told_too_long']:,} of {late['motions']:,}",
        ),
        (
            "the same, a few mm before contact at full speed",
            "0",
            marked(
                f"{hasty['told_too_long']:,} of {hasty['motions']:,}, by up to "
                f"{hasty['longest_excess_ms']:.1f} ms",
                hasty["told_too_long"] == 0,
            ),
        ),
        (
            "told by true time, median of approaches that touch",
            "≥ 0.5",
            marked(f"{close['share_median']:.2f}", close["share_median"] >= 0.5),
        ),
        (
            "largest rise on a straight approach at constant speed",
            "0",
            f"{rise:.3g} ms",
        ),
    ]
    body = [
        [
            name,
            f"{f['motions']:,}",
            str(f["told_too_long"]),
            f"{f['touching'] / max(f['followed'], 1):.1%}",
            f"{f['share_p5']:.2f} / {f['share_median']:.2f} / {f['share_p95']:.2f}",
        ]
        for name, f in (
            ("all", every),
            ("approaches", close),
            *r["kinds"].items(),
            ("wrong, from the stamp", r["wrong_from_stamp"]),
            ("wrong, from the cycle", late),
            ("close", r["close"]["exact"]),
            ("close, wrong, from the stamp", r["close"]["wrong_from_stamp"]),
            ("close, wrong, from the cycle", hasty),
        )
    ]
    ways = [
        [
            way,
            str(f["approaches"]),
            f"{f['cycles']:,}",
            str(f["with_a_rise"]),
            f"{f['largest_rise_ms']:.3g} ms",
            f"{f['largest_fall_ms']:.3g} ms",
        ]
        for way, f in straight.items()
        if way != "machine"
    ]
    return [
        "## Time to contact is never told too long",
        "",
        *targets(rows, "contact"),
        f"{r['motions']:,} motions from {r['states']:,} random states of the bay's two "
        "arms, each led at one of the eight nearest pairs: with no acceleration "
        "(steady), a random one (even), all there is with a switch in each joint "
        "(bang-bang), or all there is towards that pair. Whether it is touched before "
        "the time that was told is judged in every motion; one in ten is followed for "
        f"{r['horizon_s']:g} s to see when it touches. In an approach every "
        "joint goes the way that brings the nearest pair together, in proportion to "
        "what it does for it. In a fifth of the states the guard gets what makes the "
        "nearest pair look farthest away and slowest.",
        "",
        *table(
            ["motions", "number", "too long", "touch", "told by true, 5 / 50 / 95 %"],
            body,
        ),
        "",
        "The time counts from the cycle: the age of the measurement is taken off, and "
        "the errors of model and positions off the distance. It is the longer of two "
        "bounds. One adds up all joints' speeds and accelerations, each times its "
        "longest lever; the other knows directions, but only at the times of a grid, "
        "each 1.45 times the one before: that, and that operators may always turn, is "
        "why it is short.",
        "",
        *table(
            [
                "straight for",
                "approaches",
                "cycles",
                "with a rise",
                "largest rise",
                "largest fall",
            ],
            ways,
        ),
        "",
    ]


def supervision(r: Figures, c: Figures) -> list[str]:
    """What is watched."""
    slower, honest = r["slower"], r["honest"]
    missed = slower["stops"] - slower["escalated"]
    broken = [f for f in c["faults"] if f["broken"]]
    seen = [f for f in broken if f["cycles"] is not None]
    longest = slower["longest_ms"] or 0.0
    rows = [
        (
            f"escalation after a stop with {r['left']:.0%} of the deceleration",
            "≤ 1 s",
            f"median {slower['median_ms'] or 0.0:.0f} ms, longest {longest:.0f} ms",
        ),
        (
            "slower stops that were not noticed",
            "",
            f"{missed} of {slower['stops']}",
        ),
        (
            "escalations that named the joint",
            "all",
            f"{slower['named']} of {slower['escalated']}",
        ),
        (
            "stops as declared that were escalated",
            "0",
            f"{honest['escalated']} of {honest['stops']}",
        ),
        (
            "faults of time and data that are noticed, and when",
            "all, next cycle",
            marked(
                f"{len(seen)} of {len(broken)}, "
                f"{max((f['cycles'] for f in seen), default=0)} cycles later at most",
                len(seen) == len(broken),
            ),
        ),
    ]
    classes = [
        stop_row(f"{k['from']:.0%} to {k['to']:.0%}", k) for k in r["classes"]
    ] + [stop_row(f"figures {name}", k) for name, k in r["profiles"].items()]
    faults = [
        [f["fault"], "-" if f["cycles"] is None else str(f["cycles"]), f["reason"]]
        for f in c["faults"]
    ]
    speeds = sorted({lag["speed"] for lag in c["lags"]})
    kinds = list(dict.fromkeys((lag["delay_ms"], lag["left"]) for lag in c["lags"]))
    told = {(k["delay_ms"], k["left"], k["speed"]): k["ms"] for k in c["lags"]}
    lags = [
        [
            f"{delay:g} ms late, {left:.0%} of the deceleration",
            *(
                "-" if told[delay, left, s] is None else f"{told[delay, left, s]:.0f}"
                for s in speeds
            ),
        ]
        for delay, left in kinds
    ]
    return [
        "## What is watched, and what is not",
        "",
        *targets(rows, "slower"),
        f"{r['runs']} runs in the closed loop's bay, with its operators, plants and "
        "measurements wrong within what is declared; from the middle on every stop has "
        f"{r['left']:.0%} of the least deceleration that is declared. Counted from the "
        "order of the stop; speeds of the fastest joint in shares of its top speed. It "
        f"says: *{r['example']}*",
        "",
        *table(["stops from", "number", "noticed", "median", "longest"], classes),
        "",
        "A stop that is slower is not told from the declared one before the difference "
        "has outgrown the errors of the measured velocity, nor below the speed that "
        "settling may have. One joint, figures *even*, exact measurements, time "
        "from the order to the brake in ms, by its speed:",
        "",
        *table(["the stop", *(f"{s:g} rad/s" for s in speeds)], lags),
        "",
        "Faults of time and of measurements, and how many cycles after the first input "
        "that breaks a figure the stop is ordered (0: in the same cycle):",
        "",
        *table(["fault", "cycles", "reason"], faults),
        "",
        "So this is **not** watched:",
        "",
        "- how long the drives take to obey, while no stop is ordered; and in a stop, "
        "delays and weak brakes that end within what settling may be;",
        "- an age between `sensing` and `stale`: it is counted into the need of every "
        "pair, and refused only beyond `stale`;",
        "- an age that is not in the stamp; velocities that differ from positions over "
        "time by no more than the declared errors and what a joint gains in a period; "
        "positions and velocities that both stand still from when a joint rests on.",
        "",
    ]


def refused(r: Figures) -> list[str]:
    """Faults of one cycle."""
    told = sorted(r["seen"].items(), key=lambda item: -item[1])
    rows = [
        ("disproved", "0", zero(r["disproved"], r["episodes"])),
        ("contacts", "0", zero(r["contact"], r["episodes"])),
    ]
    return [
        "## One wrong cycle",
        "",
        *targets(rows, "refused"),
        f"{r['episodes']:,} runs of a carriage at a wall, at corners of its figures, "
        f"with one cycle in which something is wrong ({r['kinds_of_fault']} kinds), on "
        "the way or in its stop. It stops as declared, half of the time as late and "
        f"weakly as it may. The nearest came to rest {r['least_gap_mm']:.2f} mm before "
        "the wall. That cycle was answered by "
        + ", ".join(f"`{name}` {count:,}" for name, count in told)
        + ".",
        "",
    ]


def contradictions(r: Figures) -> list[str]:
    """Velocities beside positions."""
    plays, named = (sum(row[k] for row in r["rows"]) for k in ("plays", "soon"))
    rows = [
        (
            f"contradictions named within 80 ms of motion, {r['kinds']} kinds",
            "all",
            marked(f"{named:,} of {plays:,}", named == plays),
        )
    ]
    body = [
        [
            row["kind"],
            f"{row['speed']:g} rad/s",
            f"{row['soon']} of {row['plays']}",
            f"{row['longest_ms']:.0f} ms",
            ", ".join(f"`{name}`" for name in row["reasons"]),
        ]
        for row in r["rows"]
    ]
    return [
        "## Positions and velocities that contradict each other",
        "",
        *targets(rows, "contradictions"),
        "Joints that sway at up to this speed, with errors at their declared limits "
        "(velocities ± 10 mrad/s, positions ± 0.1 mrad), at 1 kHz. What differs by no "
        "more than the declared error and what a joint gains in a period cannot be "
        "told from an error: it is counted into every need.",
        "",
        *table(["what is wrong", "at up to", "in time", "longest", "reasons"], body),
        "",
    ]


def clean(r: Figures) -> list[str]:
    """False alarms."""
    rows = [("false alarms in clean cycles", "0", zero(r["alarms"], r["cycles"]))]
    return [
        "## No false alarm",
        "",
        *targets(rows, "clean"),
        "Six joints that speed up and slow down as hard as they may; errors of "
        "positions at their limit with alternating sign, those of velocities at their "
        "limit for a while, velocities up to half a period off their positions, ages "
        "drawn anew in every cycle.",
        "",
    ]


def zero(count: int, of: int) -> str:
    """So many of something of which there is to be none."""
    return marked(f"{count:,} of {of:,}", count == 0)


def stop_row(name: str, f: Figures) -> list[str]:
    """A class of stops."""
    none = f["median_ms"] is None
    return [
        name,
        str(f["stops"]),
        str(f["escalated"]),
        "-" if none else f"{f['median_ms']:.0f} ms",
        "-" if none else f"{f['longest_ms']:.0f} ms",
    ]
