"""docs/closed_loop.md, from the figures."""

from collections.abc import Mapping
from typing import Any

from closed_loop.judge_model import SIGHT

Results = Mapping[str, dict[str, Any]]

# Columns of the table of what the guard promises.
KEPT = (
    "scene",
    "mode",
    "episodes",
    "contacts",
    "< at 95 %",
    "least [mm]",
    "below the floor",
    "stops a second",
    "share of the wish",
)


def table(head: list[str], rows: list[list[str]]) -> list[str]:
    """A table in Markdown."""
    lines = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
    return lines + ["| " + " | ".join(row) + " |" for row in rows]


def page(results: Results) -> str:
    """The whole page.

    Args:
        results: Figures by the name of their plan, of the real guard.
    """
    kept = [r for r in results.values() if promise(r["plan"])]
    slow = [r for r in results.values() if r["plan"]["guard"] == "reference"]
    teeth = [r for r in results.values() if r["plan"]["zero"] or r["plan"]["large"]]
    weak = [r for r in results.values() if r["plan"]["weak_brake"] != 1.0]
    lines = [
        "# The closed loop",
        "",
        "Written by `make closed-loop`. Each episode starts two arms somewhere at "
        "random, gives them to an operator who means no good, and lets a guard watch "
        "measurements that are old and a little wrong. The plant is a double "
        "integrator in every joint, its true figures anywhere inside the declared "
        "ones, in every third episode at their worst corner. Contacts are judged by "
        "MuJoCo on the true states, never by armguard; no state is skipped in which "
        "things could have moved by more than a tenth of their distance.",
        "",
        "## While the plant keeps its word",
        "",
        *table(
            list(KEPT),
            [kept_row(r) for r in kept],
        ),
        "",
        "*least*: least distance of any pair of which an arm moved. *share of the "
        "wish*: way the joints made under their operator, by what they would have made "
        "had the operator had his way. *filtered*: what arms are told goes through "
        "`Guard.filter`, response `deflect`. They follow as late as `command` and miss "
        "it by as much as `tracking_error` allow, towards what is near; one that is "
        "stopped for that is engaged again at once. There arms may leave what comes "
        "at them: of such a pair an arm counts that would be farther away had it "
        "stayed where it rested, unless the object has run into it before.",
        "",
        *(line for r in kept for line in detail(r)),
    ]
    if slow:
        lines += freedom_section(slow)
    if teeth:
        lines += teeth_section(teeth)
    if weak:
        lines += weak_section(weak)
    return "\n".join(lines)


def promise(plan: dict[str, Any]) -> bool:
    """Whether the plant keeps its word and the guard was told the truth."""
    honest = not plan["zero"] and not plan["large"] and plan["weak_brake"] == 1.0
    return honest and plan["guard"] in ("armguard", "filter")


def where(plan: dict[str, Any]) -> str:
    """The scene, and whether commands go through the guard."""
    return plan["scene"] + (", filtered" if plan["guard"] == "filter" else "")


def kept_row(r: dict[str, Any]) -> list[str]:
    """A row of the first table."""
    limit = r["contacts_below_at_95_percent"]
    return [
        where(r["plan"]),
        r["plan"]["mode"],
        f"{r['episodes']:,}",
        str(r["contacts"]),
        "-" if limit is None else f"{limit:.1e}",
        f"{r['least_distance_mm']:.2f}",
        str(r["breaches_of_floor"]),
        f"{r['stops_a_second']:.2f}",
        f"{r['share_of_wish']:.0%}",
    ]


def detail(r: dict[str, Any]) -> list[str]:
    """What else is known of a plan."""
    plan, cycle = r["plan"], r["cycle_us"]
    reasons = ", ".join(f"{name} {count}" for name, count in r["reasons"].items())
    levels = sum(r["levels"].values()) or 1
    shares = ", ".join(f"{k} {n / levels:.1%}" for k, n in r["levels"].items())
    lines = [
        f"### {where(plan)}, mode {plan['mode']}",
        "",
        f"- {r['worst_corner']:,} of {r['episodes']:,} episodes at the worst corner; "
        f"{r['seconds_of_motion']:,.0f} s of motion, {r['cycles']:,} cycles, "
        f"{r['states_judged']:,} states judged.",
        f"- {r['stops']:,} stops in {r['episodes_with_a_stop']:,} episodes "
        f"({reasons or 'none'}); {r['releases']:,} times an arm was given back.",
        f"- Levels, in cycles of arms: {shares}.",
        "- Clearance when a stop was ordered, least, quartiles and greatest: "
        f"{in_mm(r['clearance_at_order_mm'])}; where all came to rest: "
        f"{in_mm(r['clearance_at_rest_mm'])}; the judge sees no farther than "
        f"{1e3 * SIGHT:.0f} mm.",
        f"- Motion done a second: joints {r['joint_way_a_second']:.2f} rad, tools "
        f"{r['tool_way_a_second']:.2f} m.",
        f"- A cycle of the guard: median {cycle['median']:.0f} µs, p99 "
        f"{cycle['p99']:.0f} µs (medians over episodes), longest {cycle['max']:.0f} "
        "µs.",
    ]
    if r["stops_asked_whether_needless"]:
        share = r["needless_stops"] / r["stops_asked_whether_needless"]
        lines.append(
            f"- Of {r['stops_asked_whether_needless']:,} stops searched, "
            f"{r['needless_stops']:,} ({share:.0%}) were needless: no admissible "
            "continuation was found that breaks the floor."
        )
    lines += [f"- CONTACT {told_case(c)}" for c in r["contact_cases"]]
    return [*lines, ""]


def in_mm(values: list[float]) -> str:
    """Distances in one line."""
    return " / ".join(f"{x:.1f}" for x in values) + " mm" if values else "-"


def told_case(case: dict[str, Any]) -> str:
    """A contact in one line."""
    return (
        f"seed {case['seed']}, {case['setting']}, {case['operator']}: "
        f"{case['pair'][0]} and {case['pair'][1]} after {case['time_s']:.3f} s, "
        f"{case['depth_mm']:.2f} mm deep"
    )


def freedom_section(results: list[dict[str, Any]]) -> list[str]:
    """How much a guard that only samples futures lets through."""
    rows = []
    for r in results:
        for name, figures in (("reference", r), ("armguard", r["armguard"])):
            if figures is None:
                continue
            rows.append(
                [
                    r["plan"]["scene"],
                    name,
                    f"{figures['episodes']:,}",
                    str(figures["contacts"]),
                    f"{figures['stops_a_second']:.2f}",
                    f"{figures['share_of_wish']:.1%}",
                    f"{figures['tool_way_a_second']:.3f}",
                    f"{figures['cycle_us']['median']:,.0f}",
                ]
            )
    return [
        "## Freedom",
        "",
        "The reference is a slow guard without a proof: every cycle it samples what "
        "operators and stops may do, on exact geometry, and stops as soon as one "
        "sample breaks the floor. The same episodes, mode path:",
        "",
        *table(
            [
                "scene",
                "guard",
                "episodes",
                "contacts",
                "stops a second",
                "share of the wish",
                "tools [m/s]",
                "cycle [µs]",
            ],
            rows,
        ),
        "",
    ]


def teeth_section(results: list[dict[str, Any]]) -> list[str]:
    """What happens when the guard is told that one term is nothing."""
    rows = []
    for r in sorted(results, key=lambda r: r["plan"]["zero"] or r["plan"]["large"]):
        plan = r["plan"]
        rows.append(
            [
                plan["zero"] or plan["large"],
                "nothing" if plan["zero"] else "the truth",
                plan["scene"],
                plan["mode"],
                f"{r['episodes']:,}",
                str(r["contacts"]),
                f"{r['least_distance_mm']:.2f}",
                ", ".join(f"{name} {n}" for name, n in list(r["reasons"].items())[:3]),
            ]
        )
    return [
        "## Does the test see?",
        "",
        "One term of the budget is made large, and the guard is told that it is "
        "nothing, or, to compare, the truth. The floor is 0, plant and operator are "
        "the worst there are. Contacts may appear in the first case only.",
        "",
        *table(
            [
                "term",
                "told",
                "scene",
                "mode",
                "episodes",
                "contacts",
                "least [mm]",
                "why it stopped",
            ],
            rows,
        ),
        "",
        "Where no contact appears although the term was told as nothing, the guard "
        "noticed that the figure was not true and stopped for that.",
        "",
    ]


def weak_section(results: list[dict[str, Any]]) -> list[str]:
    """What happens when the plant does not stop as declared."""
    rows = [
        [
            f"{r['plan']['weak_brake']:g}",
            r["plan"]["scene"],
            r["plan"]["mode"],
            f"{r['episodes']:,}",
            str(r["contacts"]),
            str(r["braked_before_contact"]),
        ]
        for r in results
    ]
    return [
        "## When the plant breaks its word",
        "",
        "The plant stops with this share of the declared deceleration. Contacts may "
        "happen; the guard has to have ordered the brake before.",
        "",
        *table(
            ["share", "scene", "mode", "episodes", "contacts", "brake ordered before"],
            rows,
        ),
        "",
    ]
