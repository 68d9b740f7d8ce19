"""What many episodes of gripping came to, in figures and on a page."""

from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

from armguard.scene import Grasp
from episodes.records import TOLD, joined
from gripping.gantry import FIGURES
from gripping.pick_and_place import UNNAMED

Figures = dict[str, Any]

# Joints miss what they are told, so a contact may be as much faster than creep: two of
# the gantry, or those of a Panda, by their levers and that of a finger; and the judge's
# rounding on top [m/s].
LEVERS = {"panda": 4.5}
CREEP = {
    kind: Grasp().creep + LEVERS.get(kind, 2.0) * FIGURES["tracking_error"] + 1e-6
    for kind in ("placing", "changing", "panda")
}

# How far a contact that is meant may go, where what is held is as well known as a
# measured position [m].
DEPTH = Grasp().depth + 1e-4

# How far fingers may move that hold something: what the plant misses its commands by in
# a few cycles [m].
SLIPPED = 5e-4

# Figures that are no sums: how two of one name are put together.
EXTREME: Mapping[str, Callable[[float, float], float]] = {
    "least_not_meant_mm": min,
    "deepest_mm": max,
    "fastest_contact_mm_s": max,
    "fingers_moved_most_mm": max,
}


def summed_up(kind: str, episodes: list[Figures]) -> Figures:
    """Figures of episodes of a kind, all of which but extremes are sums."""
    stops = Counter(s.split(":")[0] for e in episodes for s in e["stops"])
    touched = [e for e in episodes if e["touched"]]
    found: Figures = {
        "episodes": len(episodes),
        "seeds": joined([[e["seed"], e["seed"] + 1] for e in episodes]),
        "touched_not_meant": len(touched),
        "touched_seeds": [e["seed"] for e in touched[:TOLD]],
        "least_not_meant_mm": 1e3 * min(e["least"] for e in episodes),
        "deepest_mm": 1e3 * max(e["depth"] for e in episodes),
        "too_deep": sum(e["depth"] > DEPTH for e in episodes),
        "fastest_contact_mm_s": 1e3 * max(e["speed"] for e in episodes),
        "too_fast": sum(e["speed"] > CREEP[kind] for e in episodes),
        "stops": dict(stops),
        "episodes_with_a_stop": sum(bool(e["stops"]) for e in episodes),
        "simulated_s": sum(e["simulated_s"] for e in episodes),
        "worked_s": sum(e["worked_s"] for e in episodes),
    }
    if kind != "changing":
        slipped = [e for e in episodes if e["slipped"] > SLIPPED]
        failed = [e for e in episodes if not e["placed"]]
        found |= {
            "certified": sum(e["certified"] for e in episodes),
            "grasps_done": sum(e["grasped"] for e in episodes),
            "placements_meant": sum(e["grasped"] for e in episodes),
            "placements_done": sum(e["placed"] for e in episodes),
            "tried_again": sum(e["tries_again"] > 0 for e in episodes),
            "fingers_moved_while_holding": len(slipped),
            "fingers_moved_most_mm": 1e3 * max(e["slipped"] for e in episodes),
            "fingers_moved_seeds": [e["seed"] for e in slipped[:TOLD]],
            "failed": [[e["seed"], e["failed"]] for e in failed[:TOLD]],
            "failed_without_a_reason": sum(
                e["failed"].endswith(UNNAMED) for e in failed
            ),
        }
    else:
        found |= {
            "changes_of_mind": sum(e["changes"] for e in episodes),
            "things_touched_as_meant": sum(e["meant"] for e in episodes),
        }
    return found


def is_broken(figures: Figures) -> bool:
    """Whether a promise is broken."""
    keys = (
        "touched_not_meant",
        "too_deep",
        "too_fast",
        "failed_without_a_reason",
        "fingers_moved_while_holding",
    )
    return any(figures.get(key, 0) > 0 for key in keys)


def sentence(kind: str, figures: Figures) -> str:
    """The figures that matter."""
    text = (
        f"{kind}: {figures['episodes']} episodes, "
        f"{figures['touched_not_meant']} touched what was not meant (least distance "
        f"{figures['least_not_meant_mm']:.1f} mm), deepest "
        f"{figures['deepest_mm']:.2f} mm, fastest contact "
        f"{figures['fastest_contact_mm_s']:.1f} mm/s, "
        f"{figures['episodes_with_a_stop']} with a stop"
    )
    if kind != "changing":
        text += (
            f", {figures['grasps_done']} grasps and {figures['placements_done']} "
            "placements done"
        )
    return text


def page(results: Figures) -> str:
    """docs/gripping_campaign.md."""
    head = f"| {' | '.join(COLUMNS)} |\n|{' --- |' * len(COLUMNS)}"
    return PAGE.format(
        head=head,
        rows="\n".join(row(*item) for item in results.items()),
        more="\n".join(more(*item) for item in results.items()),
    )


def row(kind: str, figures: Figures) -> str:
    """A row of the table."""
    time = figures["simulated_s"] / figures["episodes"]
    return (
        f"| {kind} | {figures['episodes']:,} | {figures['touched_not_meant']} | "
        f"{figures['least_not_meant_mm']:.1f} | {figures['deepest_mm']:.2f} | "
        f"{figures['fastest_contact_mm_s']:.1f} | "
        f"{figures['episodes_with_a_stop']} | {time:.1f} | "
        f"{figures['version']} |"
    )


def more(kind: str, figures: Figures) -> str:
    """What a kind of episodes has beside the table."""
    stops = ", ".join(f"{n} {name}" for name, n in figures["stops"].items()) or "none"
    cost = figures["worked_s"] / figures["episodes"]
    lines = [f"**{kind}**: {cost:.1f} s of a core each. Stops: {stops}."]
    if kind != "changing":
        lines.append(
            f"Certified ways: {figures['certified']}; grasps meant "
            f"{figures['episodes']}, done {figures['grasps_done']}; placements meant "
            f"{figures['placements_meant']}, done {figures['placements_done']}; "
            f"{figures['tried_again']} operators had to try again."
        )
        if figures["fingers_moved_while_holding"]:
            seeds = ", ".join(map(str, figures["fingers_moved_seeds"]))
            lines.append(
                "The guard moved fingers that held something in "
                f"{figures['fingers_moved_while_holding']} episodes, by up to "
                f"{figures['fingers_moved_most_mm']:.1f} mm: seeds {seeds}."
            )
        lines += [f"Seed {seed} failed: {why}." for seed, why in figures["failed"]]
    else:
        lines.append(
            f"He changed his mind {figures['changes_of_mind']:,} times, and touched "
            f"{figures['things_touched_as_meant']:,} things he meant."
        )
    if figures["touched_seeds"]:
        seeds = ", ".join(map(str, figures["touched_seeds"]))
        lines.append(f"Seeds in which something was touched: {seeds}.")
    return " ".join(lines) + "\n"


COLUMNS = (
    "kind",
    "episodes",
    "touched what was not meant",
    "least distance of it [mm]",
    "deepest [mm]",
    "fastest contact [mm/s]",
    "with a stop",
    "time [s]",
    "version",
)

PAGE = """# Gripping: many episodes

`make gripping` writes this page, and goes on where it was left: episodes of one version
of kernels, plant, operators and judge are added up. An operator drives a gantry of
three axes with a gripper of two fingers through `Guard.filter`, among blocks and cups
that may be [gripped](gripping.md). The plant is late, is measured late, and misses what
it is told by all that the scene declares: 4 ms, 4 ms, 2 mm/s each joint, the same for
up to 0.3 s.

- **placing**: one of up to six things on a table with walls, posts and boards is
  gripped, lifted, carried to a free place at up to 0.8 m/s and let go. Half of the
  operators go sideways before they are high enough. It is drawn such that `check_path`
  proves the way at rest, without what is carried, and nothing else is nearer than 12 mm
  where it is gripped and put down. An operator who is stopped lets go, goes where the
  cues lead, and tries again, up to three times.
- **changing**: two to eight things stand 20 mm beside each other. Every 0.1 to 5 s the
  operator turns to another one, or drives another way: slowly to grip, straight at it
  at up to 0.8 m/s, with the back of the hand, with closed fingers, at random. He means
  the thing he turned to, and the one he turned from until his fingers have been 8 mm
  from it. A stick at random means what the middle between the fingers is slowly, at up
  to 0.1 m/s, and straight led to within 10 mm of, which is what the scene declares.
- **panda**: the same as placing, with a Panda that is led by its hand, and stops, is
  late and misses what it is told by the same numbers, its joints in rad/s. Its arm, but
  for hand and fingers, is 25 mm off everything on the way that is proven. An operator
  whose hand slides while he pushes brings it back.

A quarter of the robots respond with `slow`, all others with `deflect`.

True states are judged, every cycle, by closed forms for upright boxes and cylinders
that share nothing with the guard's distances; those of the Panda by MuJoCo, by the
convex hulls of its own meshes, up to 30 mm. Whatever touches is one of: fingers and
the thing that is meant; what is held and the table, while it is lifted or put down. All
else is not meant. A contact may be 2 mm deep and begin at 20 mm/s, beside what joints
miss their commands by (4 mm/s for two of the gantry, 9 mm/s for those of the Panda).
The arm's own links are not judged against each other. Fingers that hold something are
to stay where they are.

{head}
{rows}

{more}"""
