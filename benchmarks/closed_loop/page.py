"""docs/closed_loop.md, from the figures."""

from collections.abc import Mapping
from typing import Any

from closed_loop.judge_model import SIGHT
from episodes import kernels
from episodes.records import rows_of

Results = Mapping[str, dict[str, Any]]

# Columns of the table of what the guard promises.
KEPT = (
    "scene",
    "mode",
    "episodes",
    "contacts",
    "met at rest as well",
    "< at 95 %",
    "least [mm]",
    "below the floor",
    "stops a second",
    "false brakes",
    "share of desired motion",
    "kernels",
)


INTRODUCTION = (
    "Written by `make closed-loop`. Two arms start at a random configuration, and "
    "operators drive them: most of them at full speed at the other arm, a fixture or a "
    "moving object. The guard gets measurements that are old and wrong by up to the "
    "declared errors. MuJoCo's collision detection judges contacts on the true "
    "states; no state is skipped in which anything could have moved by more than a "
    "tenth of its distance.",
    "",
    "The plant is a double integrator in each joint. Its true figures lie anywhere "
    "inside the declared ones, in a third of the episodes at their worst corner. In "
    "rows *limited torque* it generates set-points only: a servo of each joint follows "
    "them in MuJoCo, with limited torque, against gravity, friction, the coupling of "
    "the joints and a payload of which it knows the mass to 15 %. Every such episode "
    "checks that the arms kept the declared velocity, acceleration, deceleration, "
    "ramp, settling and tracking error; an episode in which they did not is left out "
    "and counted with the figure. In rows *swing both ways* joints may also swing back "
    "before their rest.",
)

LEGEND = (
    "*least*: least distance of a pair while an arm of it moves. *false brakes*: arms "
    "that were ordered to brake; no plant here gives a reason to. *share of desired "
    "motion*: way of the joints under their operator, divided by the way without a "
    "guard. *filtered*: commands go through `Guard.filter`, response `deflect`. The "
    "arms follow them as late as `command` and with errors as large as "
    "`tracking_error`, towards the nearest pair; a stopped arm is engaged again at "
    "once. There an arm may move away from an approaching object, which may meet it: "
    "nothing is proven for such a pair. That is no contact but *met at rest as well*, "
    "if the same object, on the way it took, touches the arm where it rested last, "
    "before it or within 0.1 s; else it is a contact. *least* leaves out such pairs.",
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
    rows = [row for found in results.values() for row in rows_of(found)]
    kept = [r for r in rows if promise(r["plan"])]
    slow = [r for r in rows if r["plan"]["guard"] == "reference"]
    teeth = [r for r in rows if r["plan"]["zero"] or r["plan"]["large"]]
    weak = [r for r in rows if r["plan"]["weak_brake"] != 1.0]
    lines = [
        "# The closed loop",
        "",
        *INTRODUCTION,
        "",
        "## The plant keeps its declared figures",
        "",
        *table(
            list(KEPT),
            [kept_row(r) for r in kept],
        ),
        "",
        kernels.note(),
        "",
        *LEGEND,
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
    """Whether the plant keeps the figures that are declared to the guard."""
    honest = not plan["zero"] and not plan["large"] and plan["weak_brake"] == 1.0
    return honest and plan["guard"] in ("armguard", "filter")


def where(plan: dict[str, Any]) -> str:
    """The scene, the plant, and whether commands go through the guard."""
    words = [plan["scene"]]
    words += ["limited torque"] if plan.get("plant") == "torque" else []
    words += ["swing both ways"] if plan.get("swing") == "both" else []
    words += ["filtered"] if plan["guard"] == "filter" else []
    return ", ".join(words)


def kept_row(r: dict[str, Any]) -> list[str]:
    """A row of the first table."""
    limit = r["contacts_below_at_95_percent"]
    return [
        where(r["plan"]),
        r["plan"]["mode"],
        f"{r['episodes']:,}",
        str(r["contacts"]),
        str(r.get("met_at_rest_as_well", "-")),
        "-" if limit is None else f"{limit:.1e}",
        f"{r['least_distance_mm']:.2f}",
        str(r["breaches_of_floor"]),
        f"{r['stops_a_second']:.2f}",
        str(r.get("brakes", "not recorded")),
        f"{r['share_of_wish']:.0%}",
        kernels.told(r),
    ]


def detail(r: dict[str, Any]) -> list[str]:
    """Further figures of a plan."""
    plan, cycle = r["plan"], r["cycle_us"]
    reasons = ", ".join(f"{name} {count}" for name, count in r["reasons"].items())
    levels = sum(r["levels"].values()) or 1
    shares = ", ".join(f"{k} {n / levels:.1%}" for k, n in r["levels"].items())
    lines = [
        f"### {where(plan)}, mode {plan['mode']}",
        "",
        f"- Kernels {kernels.told(r)}.",
        f"- {r['worst_corner']:,} of {r['episodes']:,} episodes at the worst corner; "
        f"{r['seconds_of_motion']:,.0f} s of motion, {r['cycles']:,} cycles, "
        f"{r['states_judged']:,} states judged.",
        f"- {r['stops']:,} stops in {r['episodes_with_a_stop']:,} episodes "
        f"({reasons or 'none'}); {r['releases']:,} releases after a stop.",
        f"- Levels, share of all cycles of all arms: {shares}.",
        "- Distance of the nearest pair when a stop was ordered, least, quartiles and "
        f"greatest: {in_mm(r['clearance_at_order_mm'])}; at the end: "
        f"{in_mm(r['clearance_at_rest_mm'])}; the judge measures up to "
        f"{1e3 * SIGHT:.0f} mm.",
        f"- Motion in a second: joints {r['joint_way_a_second']:.2f} rad, tools "
        f"{r['tool_way_a_second']:.2f} m.",
        *jerk_of_stops(r),
        f"- A cycle of the guard: median {cycle['median']:.0f} µs, p99 "
        f"{cycle['p99']:.0f} µs (medians over episodes), longest {cycle['max']:.0f} "
        "µs.",
    ]
    if r.get("saturated_s"):
        share = r["saturated_s"] / r["seconds_of_motion"]
        lines.append(f"- A motor gave all its torque in {share:.1%} of the time.")
    if r["stops_asked_whether_needless"]:
        share = r["needless_stops"] / r["stops_asked_whether_needless"]
        lines.append(
            f"- Of {r['stops_asked_whether_needless']:,} stops searched, "
            f"{r['needless_stops']:,} ({share:.0%}) were needless: no admissible "
            "continuation was found that comes nearer than the floor."
        )
    for reason, count in r.get("left_out", {}).items():
        lines.append(f"- Left out, and not counted above: {count}: {reason}.")
    lines += [f"- CONTACT {told_case(c)}" for c in r["contact_cases"]]
    return [*lines, ""]


def jerk_of_stops(r: dict[str, Any]) -> list[str]:
    """The greatest jerk of commands that stop an arm; nothing where it is not known."""
    jerk = r.get("stop_jerk", 0.0)
    if not jerk:
        return []
    return [
        f"- Greatest jerk of commands to an arm that is to stop: {jerk:,.0f} rad/s³; "
        "nothing bounds it."
    ]


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
    """How much motion a guard that only samples futures permits."""
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
                    kernels.told(r),
                ]
            )
    return [
        "## Freedom",
        "",
        "The reference is a slow guard without a proof: every cycle it samples "
        "admissible motions and stops, on exact geometry, and stops as soon as one "
        "sample comes nearer than the floor. The same episodes, mode path:",
        "",
        *table(
            [
                "scene",
                "guard",
                "episodes",
                "contacts",
                "stops a second",
                "share of desired motion",
                "tools [m/s]",
                "cycle [µs]",
                "kernels",
            ],
            rows,
        ),
        "",
    ]


def teeth_section(results: list[dict[str, Any]]) -> list[str]:
    """Contacts with one term of the budget declared as zero."""
    rows = []
    for r in sorted(results, key=lambda r: r["plan"]["zero"] or r["plan"]["large"]):
        plan = r["plan"]
        rows.append(
            [
                plan["zero"] or plan["large"],
                "zero" if plan["zero"] else "true",
                plan["scene"],
                plan["mode"],
                f"{r['episodes']:,}",
                str(r["contacts"]),
                f"{r['least_distance_mm']:.2f}",
                ", ".join(f"{name} {n}" for name, n in list(r["reasons"].items())[:3]),
                kernels.told(r),
            ]
        )
    return [
        "## Does the test notice a missing term?",
        "",
        "One figure of the plant is large. It is declared as zero to the guard or, to "
        "compare, as it is. The floor is 0, plant and operator are at the worst "
        "corner. Contacts may appear in the first case only.",
        "",
        *table(
            [
                "term",
                "declared",
                "scene",
                "mode",
                "episodes",
                "contacts",
                "least [mm]",
                "reasons of stops",
                "kernels",
            ],
            rows,
        ),
        "",
        "`period` gives no contact: a guard with a shorter period than its cycles come "
        "at stops every arm at once (CYCLE_LATE), before any other term matters. The "
        "tracking error is used up only within 15 mm of the nearest pair, with a drive "
        "of 40 rad/s²: used all the time it would be a stop (NOT_FOLLOWED) far away.",
        "",
    ]


def weak_section(results: list[dict[str, Any]]) -> list[str]:
    """Contacts and brakes of a plant that stops too slowly."""
    rows = [
        [
            f"{r['plan']['weak_brake']:g}",
            r["plan"]["scene"],
            r["plan"]["mode"],
            f"{r['episodes']:,}",
            str(r["contacts"]),
            str(r["braked_before_contact"]),
            kernels.told(r),
        ]
        for r in results
    ]
    return [
        "## The plant breaks its declared figures",
        "",
        "The plant stops with this share of the declared deceleration. Contacts are "
        "possible; the guard must have ordered the brake before.",
        "",
        *table(
            [
                *("share", "scene", "mode", "episodes", "contacts"),
                *("brake ordered before", "kernels"),
            ],
            rows,
        ),
        "",
    ]
