"""Freedom: the motion of arms by how they know what is near them.

make freedom                                    all of it, an hour of a core
make freedom ARGS="--episodes 10 --seconds 600" some of it
make freedom ARGS="--kind '25 mm' --first 3 --episodes 1 --show"   one of them
make freedom ARGS="--page"                      the page, from known figures

It resumes: seeds that were run with the same kernels, worlds and plant are known from
docs/freedom.json.

In each world the operator desires the same velocities three times: the scene has the
boxes and rods; sensors alone know them; OctoMap has them, and a distance threshold
scales the velocities. The plant is late and misses its commands by what the scene
declares. MuJoCo judges true states.
"""

import sys
from collections import Counter
from functools import partial
from typing import Any

from closed_loop.judge_model import SIGHT
from episodes.campaign import Campaign, Episode
from episodes.records import Digest, Extreme, Figures, version_of
from freedom.octomap_gate import OctomapGate
from freedom.runs import Sensing, known, run
from freedom.worlds import SIZES, drawn_world
from pages import DOCS

# Thresholds of the peer [m].
THRESHOLDS = (0.02, 0.05, 0.1, 0.15, 0.2)

PEER, MOVERS = "OctoMap", "25 mm, 1.6 m/s"

EXTREME: Extreme = {"least_mm": min, "modelled_least_mm": min}


def sensed_episode(cell: float, speed: float, seed: int) -> Episode:
    """A world, modelled and known by sensors.

    Args:
        cell: Edge of a cell [m].
        speed: Declared speed of an intruder [m/s].
        seed: Seed of the world, of the plant and of the noise.
    """
    world = drawn_world(seed)
    found = {"sensors": run(world, Sensing(world, cell, speed, seed), seed)}
    return {"seed": seed, "modelled": run(world, known(world), seed), "runs": found}


def peer_episode(seed: int) -> Episode:
    """A world, modelled and known by OctoMap, with each threshold."""
    world = drawn_world(seed)
    found = {
        f"{1e3 * threshold:g} mm": run(world, OctomapGate(world, threshold, seed), seed)
        for threshold in THRESHOLDS
    }
    return {"seed": seed, "modelled": run(world, known(world), seed), "runs": found}


def summed_up(episodes: list[Episode]) -> Figures:
    """Figures of episodes, all of which but extremes are sums."""
    names = episodes[0]["runs"]
    every = [found for e in episodes for found in e["runs"].values()]
    return {
        "episodes": len(episodes),
        "wanted": sum(e["modelled"]["wanted"] for e in episodes),
        "modelled": sum(e["modelled"]["done"] for e in episodes),
        "modelled_contacts": sum(is_contact(e["modelled"]) for e in episodes),
        "modelled_least_mm": 1e3 * min(e["modelled"]["least"] for e in episodes),
        "modelled_lost": added(e["modelled"]["lost"] for e in episodes),
        "done": {n: sum(e["runs"][n]["done"] for e in episodes) for n in names},
        "contacts": {n: sum(is_contact(e["runs"][n]) for e in episodes) for n in names},
        "least_mm": 1e3 * min((found["least"] for found in every), default=SIGHT),
        "lost": added(found["lost"] for found in every),
        "cells": added(found["cells"] for found in every),
        "stops": added(found["stops"] for found in every),
        "needless": added(found["needless"] for found in every),
        "modelled_stops": added(e["modelled"]["stops"] for e in episodes),
        "worked_s": sum(found["worked_s"] for found in every),
    }


def added(parts: Any) -> Figures:
    """Sum of figures by name."""
    total: Counter[str] = Counter()
    for part in parts:
        total.update(part)
    return dict(total)


def is_contact(found: Figures) -> bool:
    """Whether an arm that moved touched a foreign object."""
    return bool(found["least"] < 0.0)


def derived(_: str, figures: Figures) -> Figures:
    """Shares that follow from the sums."""
    modelled = figures["modelled"]
    return {"shares": {n: d / modelled for n, d in figures["done"].items()}}


def digest(episode: Episode) -> Digest:
    """What came of an episode, in short."""
    runs = episode["runs"].values()
    outcome = "contact" if any(map(is_contact, runs)) else ""
    counts = {"modelled": round(episode["modelled"]["done"], 3)}
    counts |= {n: round(found["done"], 3) for n, found in episode["runs"].items()}
    return Digest(episode["seed"], outcome, 1e3 * min(r["least"] for r in runs), counts)


def is_broken(figures: Figures) -> bool:
    """Whether an arm that a guard moved touched a foreign object."""
    return bool(figures["modelled_contacts"] or figures["contacts"].get("sensors"))


CAMPAIGN = Campaign(
    results=DOCS / "freedom.json",
    kinds={
        **{f"{1e3 * cell:g} mm": partial(sensed_episode, cell, 0.0) for cell in SIZES},
        MOVERS: partial(sensed_episode, 0.025, 1.6),
        PEER: peer_episode,
    },
    version=version_of("freedom.runs"),
    extreme=EXTREME,
    summed_up=lambda _, episodes: summed_up(episodes),
    digest=digest,
    is_broken=is_broken,
    is_notable=lambda episode: digest(episode).outcome != "",
    count=60,
    shares={"10 mm": 0.2, MOVERS: 0.2},
    derived=derived,
    written=4,
)


if __name__ == "__main__":
    sys.exit(CAMPAIGN.main(__doc__))
