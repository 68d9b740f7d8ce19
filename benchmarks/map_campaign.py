"""Maps and schedules of two arms against Coal; writes docs/map.json and docs/map.md.

make map-campaign                            schedules, samples of maps, reservations
make map-campaign ARGS="--kind schedules --episodes 50"   some of one kind
make map-campaign ARGS=--page                          the page from what is known

It resumes: an episode is a pair of plans, and those that were judged with the same
kernels are known from docs/map.json.
"""

import sys
from functools import partial

from episodes.campaign import Campaign, Episode
from episodes.records import Digest, Figures, version_of
from mapping.judge import judged_map, judged_schedule, look_up_time
from mapping.reserved import judged_reservation
from pages import DOCS

# Distances of the arms [m], and what a map of them is to keep to [s, -].
APART = {"map, 1.0 m apart": 1.0, "map, 1.2 m apart": 1.2}
MOST_SECONDS, MOST_UNKNOWN = 0.25, 0.02

SCHEDULES = "schedules"
LEFT_OUT = {"no following error known": "following error", "no skew known": "skew"}

LOOK_UP = "look-up"

RESERVATIONS = "reservations"

JUDGED, RESERVED = version_of("mapping.judge"), version_of("mapping.reserved")

# Counts that break a promise, in words.
BROKEN = {"false_free": "false free", "contacts": "contact", "deadlocks": "deadlock"}


def mapped(kind: str, seed: int) -> Episode:
    """A map, judged."""
    return {"seed": seed, **judged_map(APART[kind], seed)}


def scheduled(left_out: str, seed: int) -> Episode:
    """A schedule, executed and judged; contacts by an error left out are expected."""
    apart = 1.2 if seed % 2 and not left_out else 1.0
    found = judged_schedule(apart, seed, left_out)
    if left_out and "contacts" in found:
        found["expected"] = found.pop("contacts")
    return {"seed": seed, **found}


def reserved(seed: int) -> Episode:
    """Reservations, executed and judged."""
    return {"seed": seed, **judged_reservation(1.2 if seed % 2 else 1.0, seed)}


def look_up(seed: int) -> Episode:
    """Time of a look-up [ns]."""
    return {"seed": seed, "nanoseconds": look_up_time(seed)}


def summed_up(kind: str, episodes: list[Episode]) -> Figures:
    """Figures of episodes: sums, and the greatest of some."""
    found: Figures = {"episodes": len(episodes)}
    keys = sorted({key for one in episodes for key in one} - {"seed"})
    for key in keys:
        found[key] = sum(one.get(key, 0) for one in episodes)
    if kind in APART:
        found["most_seconds"] = max(one["seconds"] for one in episodes)
        found["most_unknown"] = max(one["unknown"] for one in episodes)
        found["slow"] = sum(one["seconds"] > MOST_SECONDS for one in episodes)
        found["vague"] = sum(one["unknown"] > MOST_UNKNOWN for one in episodes)
    elif kind == RESERVATIONS:
        found["most_reserving"] = max(one.get("reserving", 0.0) for one in episodes)
        found["touched"] = sum(one.get("contacts", 0) > 0 for one in episodes)
    elif kind != LOOK_UP:
        touched = [one.get("contacts", 0) + one.get("expected", 0) for one in episodes]
        found["touched"] = sum(count > 0 for count in touched)
    return found


def digest(episode: Episode) -> Digest:
    """What came of an episode, in short."""
    outcome = "no way" * episode.get("no_way", 0)
    for key, words in BROKEN.items():
        if episode.get(key):
            outcome = words
    keys = ("touching", "interlocks", "expected")
    counts = {key: episode[key] for key in keys if key in episode}
    return Digest(episode["seed"], outcome, None, counts)


def is_broken(figures: Figures) -> bool:
    """Whether a promise is broken."""
    return any(figures.get(key, 0) > 0 for key in BROKEN)


CAMPAIGN = Campaign(
    results=DOCS / "map.json",
    kinds={
        **{kind: partial(mapped, kind) for kind in APART},
        SCHEDULES: partial(scheduled, ""),
        **{kind: partial(scheduled, error) for kind, error in LEFT_OUT.items()},
        RESERVATIONS: reserved,
        LOOK_UP: look_up,
    },
    version=lambda kind: (RESERVED if kind == RESERVATIONS else JUDGED)(kind),
    extreme={"most_seconds": max, "most_unknown": max, "most_reserving": max},
    summed_up=summed_up,
    digest=digest,
    is_broken=is_broken,
    is_notable=lambda episode: digest(episode).outcome in BROKEN.values(),
    count=1000,
    shares={
        **dict.fromkeys(APART, 0.056),
        **dict.fromkeys(LEFT_OUT, 0.05),
        RESERVATIONS: 0.2,
        LOOK_UP: 0.001,
    },
    written=10,
)


if __name__ == "__main__":
    sys.exit(CAMPAIGN.main(__doc__))
