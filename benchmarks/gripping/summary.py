"""What many episodes of gripping came to, in figures and on a page."""

from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

from armguard.scene import Grasp
from episodes import kernels
from episodes.classes import counted
from episodes.records import TOLD, Digest, rows_of
from gripping.gantry import FIGURES
from gripping.pick_and_place import UNNAMED
from gripping.unintended import WORDS

Figures = dict[str, Any]

# Joints miss what they are told, so a contact may be as much faster than creep: two of
# the gantry, or those of a Panda, by their levers and that of a finger; and the judge's
# rounding on top [m/s].
LEVERS = {"panda": 4.5}
CREEP = {
    kind: Grasp().creep + LEVERS.get(kind, 2.0) * FIGURES["tracking_error"] + 1e-6
    for kind in ("placing", "changing", "panda", "unintended")
}

# Kinds in which nothing is to be picked up and put down.
WITHOUT_PLACES = ("changing", "unintended")

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
    if kind == "unintended":
        found["of_each"] = counted(e["kind"] for e in episodes)
        found["touched_of_each"] = counted(e["kind"] for e in touched)
        found["stopped_of_each"] = counted(e["kind"] for e in episodes if e["stops"])
    elif kind != "changing":
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


def digest(episode: Figures) -> Digest:
    """What came of an episode, in short."""
    outcome = str(episode.get("failed") or "")
    if episode["touched"]:
        outcome = "unintended contact"
    counts = {"stops": len(episode["stops"])}
    return Digest(episode["seed"], outcome, 1e3 * episode["least"], counts)


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
        f"{figures['touched_not_meant']} with an unintended contact (least distance "
        f"{figures['least_not_meant_mm']:.1f} mm), deepest "
        f"{figures['deepest_mm']:.2f} mm, fastest contact "
        f"{figures['fastest_contact_mm_s']:.1f} mm/s, "
        f"{figures['episodes_with_a_stop']} with a stop"
    )
    if kind not in WITHOUT_PLACES:
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
        rows="\n".join(
            row(k, f) for k, found in results.items() for f in rows_of(found)
        ),
        more="\n".join(more(*item) for item in results.items() if item[1]["episodes"]),
        note=kernels.note(),
    )


def row(kind: str, figures: Figures) -> str:
    """A row of the table."""
    time = figures["simulated_s"] / figures["episodes"]
    return (
        f"| {kind} | {figures['episodes']:,} | {figures['touched_not_meant']} | "
        f"{figures['least_not_meant_mm']:.1f} | {figures['deepest_mm']:.2f} | "
        f"{figures['fastest_contact_mm_s']:.1f} | "
        f"{figures['episodes_with_a_stop']} | {time:.1f} | "
        f"{kernels.told(figures)} |"
    )


def more(kind: str, figures: Figures) -> str:
    """Figures of a kind of episodes that are not in the table."""
    stops = ", ".join(f"{n} {name}" for name, n in figures["stops"].items()) or "none"
    cost = figures["worked_s"] / figures["episodes"]
    lines = [f"**{kind}**: {cost:.1f} s of a core each. Stops: {stops}."]
    if kind == "unintended":
        touched, stopped = figures["touched_of_each"], figures["stopped_of_each"]
        lines += [
            f"{count} times {WORDS[name]}: {touched.get(name, 0)} contacts, "
            f"{stopped.get(name, 0)} stops, the others were slowed down."
            for name, count in figures["of_each"].items()
        ]
    elif kind != "changing":
        lines.append(
            f"Certified ways: {figures['certified']}; grasps tried "
            f"{figures['episodes']}, done {figures['grasps_done']}; placements tried "
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
            f"The operators changed their target {figures['changes_of_mind']:,} times "
            f"and touched {figures['things_touched_as_meant']:,} targets."
        )
    if figures.get("left_out"):
        left = "; ".join(f"{n}: {why}" for why, n in figures["left_out"].items())
        lines.append(f"Left out, and not counted above: {left}.")
    if figures["touched_seeds"]:
        seeds = ", ".join(map(str, figures["touched_seeds"]))
        lines.append(f"Seeds in which something was touched: {seeds}.")
    return " ".join(lines) + "\n"


COLUMNS = (
    "kind",
    "episodes",
    "unintended contacts",
    "least unintended distance [mm]",
    "deepest [mm]",
    "fastest contact [mm/s]",
    "with a stop",
    "time [s]",
    "kernels",
)

PAGE = """# Gripping: many episodes

`make gripping` writes this page and resumes: it adds up episodes of one version of
kernels, plant, operators and judge. An operator drives a gantry of three axes with a
gripper of two fingers through `Guard.filter`, among blocks and cups that may be
[gripped](gripping.md). The plant uses up its declared figures: commands take effect
4 ms late, measurements are 4 ms old, each joint misses its command by 2 mm/s for up to
0.3 s.

- **placing**: the operator grips one of up to six objects on a table with walls, posts
  and boards, lifts it, carries it to a free place at up to 0.8 m/s and lets it go. Half
  of the operators move sideways before the object is high enough. Tasks are drawn such
  that `check_path` proves the way at rest, without the carried object, and no other
  object is nearer than 12 mm at the grasp and at the place. A stopped operator releases
  the stick, follows the cues and tries again, up to three times.
- **changing**: two to eight objects stand 20 mm apart. Every 0.1 to 5 s the operator
  chooses another target, or drives in another manner: slowly to grip, straight at it at
  up to 0.8 m/s, with the back of the hand, with closed fingers, at random. Contact is
  intended with the target, and with the target before it until the fingers have been
  8 mm away from it. A random stick intends the object that the middle between the
  fingers is led to slowly, at up to 0.1 m/s, straight and to within 10 mm, as the scene
  declares it.
- **unintended**: six kinds of motion in turns, in none of which a contact is intended.
  Without a guard the same operator and plant touch an object in every episode.
- **panda**: as placing, with a Panda whose hand is led. It stops, lags and misses its
  commands by the same numbers, its joints in rad/s. Its arm, without hand and fingers,
  keeps 25 mm from every object on the proven way. An operator whose hand slips while he
  pushes brings it back.

A quarter of the robots respond with `slow`, all others with `deflect`.

Closed forms for upright boxes and cylinders, which share nothing with the guard's
distances, judge the true states in every cycle; MuJoCo judges those of the Panda, by
the convex hulls of its own meshes, up to 30 mm. Intended contacts are those of the
fingers with the target, and of the held object with the table while it is lifted or put
down. All others are unintended. An intended contact may be 2 mm deep and begin at
20 mm/s, plus the errors of the commanded velocities (4 mm/s for two joints of the
gantry, 9 mm/s for those of the Panda). The links of an arm are not judged against each
other. Fingers that hold an object must not move.

{head}
{rows}

{note}

{more}"""
