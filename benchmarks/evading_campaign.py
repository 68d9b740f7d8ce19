"""Evading: objects are thrown and pushed at arms, which get out of the way if they can.

make evading                              500 episodes each of the bay and two Pandas
make evading ARGS="--episodes 100 --seconds 600"   some of them, for so long at most
make evading ARGS="--kind bay --first 17 --episodes 1 --show"   one of them
make evading ARGS="--kind sensed-bay"   objects that only cameras see

It resumes: seeds that were run with the same kernels, plant, throws and judge are known
from docs/evading.json, which is written every twenty episodes.

A ball or a box comes straight at a link of an arm that rests or works. The guard is
given its place and its velocity, or simulated cameras see it. The plant is late and
misses its commands, by all that the scene declares. MuJoCo judges true states; an
off-line search says whether there was a way out at all.
"""

import sys
from collections.abc import Iterable
from functools import partial, reduce

from closed_loop.judge_model import SIGHT
from episodes.campaign import Campaign
from episodes.classes import counted
from episodes.records import LISTED, Digest, Extreme, Figures, merged, version_of
from evading.episode import run_episode
from pages import DOCS

PLACES = ("bay", "pandas")

# Least share to be evaded of the objects that can be evaded [-].
SHARE = 0.95

# How two figures of one name are put together that are no sums.
EXTREME: Extreme = {
    "nearest_evaded_mm": min,
    "nearest_else_mm": min,
    "slowest_cycle_us": max,
}

# Ends of classes of speeds [m/s], and of closest distances [mm].
SPEEDS = (0.4, 0.7, 1.0)
DISTANCES = (5, 20, 60)

# From this share on, the way of what was hit counts as along that of the object [-].
ALONG = 0.7


def summed_up(episodes: list[Figures]) -> Figures:
    """Figures of episodes, all of which but extremes are sums."""
    can = [e for e in episodes if e["evadable"]]
    out = [e for e in can if e["evaded"]]
    hit = [e for e in can if not e["evaded"]]
    times = reduce(lambda a, b: merged(a, b, {}), (e["cycle_us"] for e in episodes))
    secondary = [e for e in episodes if e["touched"]]
    return {
        "episodes": len(episodes),
        "evadable": len(can),
        "evaded": len(out),
        "evadable_hit": len(hit),
        "other_evaded": sum(e["evaded"] and not e["evadable"] for e in episodes),
        "other_hit": sum(not (e["evaded"] or e["evadable"]) for e in episodes),
        "secondary": len(secondary),
        "secondary_seeds": [[e["seed"], *e["touched"][0]] for e in secondary[:LISTED]],
        "evadable_by": counted(sorts(can)),
        "evaded_by": counted(sorts(out)),
        "why": counted(e["why"] for e in hit),
        "went_along": sum((e["along"] or 0.0) >= ALONG for e in hit),
        "hit_seeds": [[e["seed"], e["why"], e["hit"]] for e in hit[:LISTED]],
        "stops": counted(reason for e in episodes for reason in e["stops"]),
        "episodes_with_a_stop": sum(bool(e["stops"]) for e in episodes),
        "closest": counted(near(e["mover_least"]) for e in out),
        "nearest_evaded_mm": 1e3 * min((e["mover_least"] for e in out), default=SIGHT),
        "nearest_else_mm": 1e3 * min(e["others_least"] for e in episodes),
        "cycle_us": dict(sorted(times.items())),
        "slowest_cycle_us": max(e["slowest_cycle_us"] for e in episodes),
        "ways_tried": sum(e["ways_tried"] for e in episodes),
        "simulated_s": sum(e["simulated_s"] for e in episodes),
        "worked_s": sum(e["worked_s"] for e in episodes),
    }


def digest(episode: Figures) -> Digest:
    """What came of an episode, in short."""
    if episode["touched"]:
        outcome = "secondary contact"
    else:
        evadable = "" if episode["evadable"] else ", not evadable"
        outcome = ("evaded" if episode["evaded"] else "hit") + evadable
    least = 1e3 * min(episode["mover_least"], episode["others_least"])
    return Digest(episode["seed"], outcome, least, {"stops": len(episode["stops"])})


def sorts(episodes: list[Figures]) -> Iterable[str]:
    """What each episode is counted as: by speed, and by what the arm does."""
    for episode in episodes:
        end = next(s for s in SPEEDS if episode["speed"] <= s)
        yield f"up to {end} m/s"
        yield "at work" if episode["works"] else "at rest"


def near(distance: float) -> str:
    """The class of a closest distance [m]."""
    end = next((d for d in DISTANCES if 1e3 * distance < d), None)
    return f"{DISTANCES[-1]} mm or more" if end is None else f"less than {end} mm"


def share(figures: Figures) -> float:
    """Share evaded of the objects that could be [-]."""
    return float(figures["evaded"] / max(figures["evadable"], 1))


def is_broken(figures: Figures) -> bool:
    """Whether a promise is broken."""
    return figures["secondary"] > 0 or share(figures) < SHARE


def is_notable(episode: Figures) -> bool:
    """Whether something is to be looked at in an episode."""
    return bool(episode["touched"] or (episode["evadable"] and not episode["evaded"]))


CAMPAIGN = Campaign(
    results=DOCS / "evading.json",
    kinds={
        **{place: partial(run_episode, place) for place in PLACES},
        **{f"sensed-{p}": partial(run_episode, p, sensed=True) for p in PLACES},
    },
    version=version_of("evading.episode"),
    extreme=EXTREME,
    summed_up=lambda _, episodes: summed_up(episodes),
    digest=digest,
    is_broken=is_broken,
    is_notable=is_notable,
    count=500,
    written=20,
)


if __name__ == "__main__":
    sys.exit(CAMPAIGN.main(__doc__))
