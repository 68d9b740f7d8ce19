"""Gripping: what is intended succeeds, what is not intended is never touched.

make gripping                              10,000 episodes each, 500 of a Panda
make gripping ARGS="--episodes 500 --seconds 600"   some of them, for so long at most
make gripping ARGS="--kind changing --first 17 --episodes 1 --show"   one of them

It resumes: seeds that were run with the same kernels, plant, operators and judge are
known from docs/gripping_campaign.json, which is written every hundred episodes.

An operator drives a gantry with a gripper through `Guard.filter`. Its plant is late and
misses what it is told, by all that the scene declares. In `placing` he picks one of
several things up among clutter and puts it down where it is free, on a way that is
proven at rest. In `changing` he is among things 20 mm apart, and changes his mind.
In `panda` he places with a Panda. In `unintended` he does what nobody means. Judged are
true states, by closed forms that share nothing with the guard's distances, and those of
the Panda's own meshes by MuJoCo.
"""

import sys
from functools import cache
from pathlib import Path

from episodes import records
from episodes.campaign import Campaign, Episode
from gripping import changing_intent, panda, pick_and_place, unintended
from gripping.summary import EXTREME, digest, is_broken, summed_up

HERE = Path(__file__).parent

# Files that change no episode; and kinds with files of their own.
REPORTING = ("summary.py",)
OF_ONE_KIND = ("panda", "unintended")


@cache
def version(kind: str) -> str:
    """Hash of all that decides what comes of an episode of a kind.

    Files whose names begin with a robot's are of the kind with its name only.
    """
    files = [
        path
        for path in sorted((HERE / "gripping").glob("*.py"))
        if path.name not in REPORTING
        and (path.name.startswith(kind) or not path.name.startswith(OF_ONE_KIND))
    ]
    shared = [HERE / "episodes" / "follower.py", HERE / "closed_loop" / "truth.py"]
    return records.version(kind, [*files, *shared])


def is_told(episode: Episode) -> bool:
    """Whether something is to be looked at in an episode."""
    return bool(episode["touched"] or episode["stops"] or episode.get("failed"))


CAMPAIGN = Campaign(
    results=HERE.parent / "docs" / "gripping_campaign.json",
    kinds={
        "placing": pick_and_place.run_episode,
        "changing": changing_intent.run_episode,
        "panda": panda.run_episode,
        "unintended": unintended.run_episode,
    },
    version=version,
    extreme=EXTREME,
    summed_up=summed_up,
    digest=digest,
    is_broken=is_broken,
    is_told=is_told,
    shares={"panda": 0.05, "unintended": 0.1},
)


if __name__ == "__main__":
    sys.exit(CAMPAIGN.main(__doc__))
