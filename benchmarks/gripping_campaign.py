"""Gripping: what is intended succeeds, what is not intended is never touched.

make gripping                              10,000 episodes each, 500 of a Panda
make gripping ARGS="--episodes 500 --seconds 600"   some of them, for so long at most
make gripping ARGS="--kind changing --first 17 --episodes 1 --show"   one of them

It resumes: seeds that were run with the same kernels, plant, operators and judge are
known from docs/gripping_campaign.json, which is written every hundred episodes.

An operator drives a gantry with a gripper through `Guard.filter`. Its plant is late and
misses its commands by all that the scene declares. In `placing` one of several objects
is picked up among clutter and put down where it is free, on a way that is proven at
rest. In `changing` the grasp target changes among objects 20 mm apart. In `panda` a
Panda places. In `unintended` no motion is intended to grip. Judged are true states, by
closed forms that share nothing with the guard's distances, and those of the Panda's own
meshes by MuJoCo.
"""

import sys
from collections import Counter

from armguard.scene import Grasp
from episodes.campaign import Campaign
from episodes.classes import counted
from episodes.records import LISTED, Digest, Extreme, Figures, version_of
from gripping import changing_intent, panda, pick_and_place, unintended
from gripping.gantry import FIGURES
from gripping.pick_and_place import UNNAMED
from pages import DOCS

KINDS = {
    "placing": pick_and_place.run_episode,
    "changing": changing_intent.run_episode,
    "panda": panda.run_episode,
    "unintended": unintended.run_episode,
}

# Joints miss commands, so a contact may be as much faster than creep: two of
# the gantry, or those of a Panda, by their levers and that of a finger; and the judge's
# rounding on top [m/s].
LEVERS = {"panda": 4.5}
CREEP = {
    kind: Grasp().creep + LEVERS.get(kind, 2.0) * FIGURES["tracking_error"] + 1e-6
    for kind in KINDS
}

# How far a contact that is intended may go, where what is held is as well known as a
# measured position [m].
DEPTH = Grasp().depth + 1e-4

# How far fingers may move that hold something: what the plant misses its commands by in
# a few cycles [m].
SLIPPED = 5e-4

# Figures that are no sums: how two of one name are put together.
EXTREME: Extreme = {
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
        "touched_seeds": [e["seed"] for e in touched[:LISTED]],
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
            "fingers_moved_seeds": [e["seed"] for e in slipped[:LISTED]],
            "failed": [[e["seed"], e["failed"]] for e in failed[:LISTED]],
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


def is_notable(episode: Figures) -> bool:
    """Whether something is to be looked at in an episode."""
    return bool(episode["touched"] or episode["stops"] or episode.get("failed"))


CAMPAIGN = Campaign(
    results=DOCS / "gripping_campaign.json",
    kinds=KINDS,
    version=lambda kind: version_of(KINDS[kind].__module__)(kind),
    extreme=EXTREME,
    summed_up=summed_up,
    digest=digest,
    is_broken=is_broken,
    is_notable=is_notable,
    shares={"panda": 0.05, "unintended": 0.1},
)


if __name__ == "__main__":
    sys.exit(CAMPAIGN.main(__doc__))
