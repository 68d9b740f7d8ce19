"""Evading: things are thrown and pushed at arms, and those that can get out of the way.

make evading                              500 episodes each of the bay and two Pandas
make evading ARGS="--episodes 100 --seconds 600"   some of them, for so long at most
make evading ARGS="--kind bay --first 17 --episodes 1 --show"   one of them

It resumes: seeds that were run with the same kernels, plant, throws and judge are known
from docs/evading.json, which is written every twenty episodes.

A ball or a box comes straight at a link of an arm that rests or works. The guard is
told where it is and how fast it comes; the plant is late and misses what it is told, by
all that the scene declares. MuJoCo judges true states; an off-line search says whether
there was a way out at all.
"""

import sys
from functools import cache, partial
from pathlib import Path

from episodes import records
from episodes.campaign import Campaign, Episode
from evading.episode import run_episode
from evading.summary import EXTREME, digest, is_broken, summed_up

HERE = Path(__file__).parent

PLACES = ("bay", "pandas")

# Files that change no episode; and those of others that do.
REPORTING = ("summary.py",)
SHARED = ("judge.py", "judge_model.py", "scenes.py", "truth.py")


@cache
def version(place: str) -> str:
    """Hash of all that decides what comes of an episode."""
    own = sorted((HERE / "evading").glob("*.py"))
    others = [HERE / "closed_loop" / name for name in SHARED]
    others.append(HERE / "episodes" / "follower.py")
    files = [path for path in [*own, *others] if path.name not in REPORTING]
    return records.version(place, files)


def is_told(episode: Episode) -> bool:
    """Whether something is to be looked at in an episode."""
    return bool(episode["touched"] or (episode["evadable"] and not episode["evaded"]))


CAMPAIGN = Campaign(
    results=HERE.parent / "docs" / "evading.json",
    kinds={place: partial(run_episode, place) for place in PLACES},
    version=version,
    extreme=EXTREME,
    summed_up=lambda _, episodes: summed_up(episodes),
    digest=digest,
    is_broken=is_broken,
    is_told=is_told,
    count=500,
    written=20,
)


if __name__ == "__main__":
    sys.exit(CAMPAIGN.main(__doc__))
