"""Closed loops among foreign bodies: operators who try to hit what sensors alone know.

make sensed-loops                                             all of it, hours
make sensed-loops ARGS="--kind 'bay, at rest' --episodes 200" some of it
make sensed-loops ARGS="--kind 'bay, at rest' --first 3 --episodes 1 --show"   one
make sensed-loops ARGS="--page"                               from known figures

It resumes: seeds that were run with the same kernels, bodies, plant and judge are known
from docs/sensed_loops.json.

The guard knows boxes, rods and what moves from simulated sensors alone. Sensors are
mounted as far off as they are declared to be, the plant is late and misses its commands
by all that the scene declares. MuJoCo judges the true states. Where the guard does not
know a term, contacts are to appear.
"""

import sys
from functools import partial

from episodes.campaign import Campaign, Episode
from episodes.classes import counted
from episodes.records import LISTED, Digest, Extreme, Figures, version_of
from pages import DOCS
from sensed_loops.episode import run_episode
from sensed_loops.scenes import LEFT_OUT, Setting

# Kinds in which all is known, and in which the guard does not know something.
KNOWN = {
    "bay, at rest": Setting(),
    "bay, moving": Setting(moves=True),
    "two Pandas, at rest": Setting("pandas"),
    "two Pandas, moving": Setting("pandas", moves=True),
    "bay, error 80 mm": Setting(large="error"),
    "bay, noise 30 mm": Setting(large="noise"),
    "bay, moving, delay 0.4 s": Setting(moves=True, large="delay"),
}
UNKNOWN = {
    "without error": Setting(large="error", left_out="error"),
    "without noise": Setting(large="noise", left_out="noise"),
    "without age": Setting(moves=True, large="delay", left_out="age"),
    "without speed": Setting(moves=True, left_out="speed"),
    "without cell": Setting(left_out="cell"),
    "without shell": Setting(left_out="shell"),
    "without size": Setting(left_out="size"),
}

EVERY = KNOWN | UNKNOWN

# How many of the episodes are run of each kind [-].
SHARES = dict.fromkeys(UNKNOWN, 0.01) | {
    "bay, moving": 0.3,
    "two Pandas, at rest": 0.3,
    "two Pandas, moving": 0.1,
    "bay, error 80 mm": 0.02,
    "bay, noise 30 mm": 0.02,
    "bay, moving, delay 0.4 s": 0.02,
}

# Distance below which an arm came near a body [m].
NEAR = 0.05

EXTREME: Extreme = {"least_mm": min}


def summed_up(_: str, episodes: list[Episode]) -> Figures:
    """Figures of episodes, all of which but the least distance are sums."""
    contacts = [e for e in episodes if e["contact"]]
    return {
        "episodes": len(episodes),
        "contacts": len(contacts),
        "contact_seeds": [[e["seed"], *e["contact"]] for e in contacts[:LISTED]],
        "met_at_rest": sum(e["met_at_rest"] for e in episodes),
        "near": sum(e["least"] < NEAR for e in episodes),
        "least_mm": 1e3 * min(e["least"] for e in episodes),
        "cycles": sum(e["cycles"] for e in episodes),
        "stopped": sum(e["stopped"] for e in episodes),
        "way": sum(e["way"] for e in episodes),
        "stops": counted(reason for e in episodes for reason in e["stops"]),
        "worked_s": sum(e["worked_s"] for e in episodes),
    }


def derived(kind: str, _: Figures) -> Figures:
    """What a kind leaves out, and whether contacts are allowed for that."""
    left_out = EVERY[kind].left_out
    return {"allowed": left_out != "", "by": LEFT_OUT.get(left_out, "")}


def digest(episode: Episode) -> Digest:
    """What came of an episode, in short."""
    outcome = "met at rest" if episode["met_at_rest"] else ""
    return Digest(
        episode["seed"],
        "contact" if episode["contact"] else outcome,
        1e3 * episode["least"],
        {"stopped": episode["stopped"]},
    )


def is_broken(figures: Figures) -> bool:
    """Whether an arm that moved touched a body though the guard knew every term."""
    return bool(figures["contacts"] and not figures["allowed"])


CAMPAIGN = Campaign(
    results=DOCS / "sensed_loops.json",
    kinds={kind: partial(run_episode, s) for kind, s in EVERY.items()},
    version=version_of("sensed_loops.episode"),
    extreme=EXTREME,
    summed_up=summed_up,
    digest=digest,
    is_broken=is_broken,
    is_notable=lambda episode: episode["contact"] is not None,
    count=6000,
    shares=SHARES,
    written=20,
    derived=derived,
)


if __name__ == "__main__":
    sys.exit(CAMPAIGN.main(__doc__))
