"""Proofs of plans against dense samples; writes docs/verify.json and docs/verify.md.

make verify-campaign                                 100,000 plans
make verify-campaign ARGS="--kind cubic --episodes 200"   some of one kind
make verify-campaign ARGS=--page                     the page from what is known

It resumes: an episode is a plan, and those that were judged with the same kernels are
known from docs/verify.json.
"""

import sys
from collections import Counter
from functools import partial
from statistics import median
from time import process_time
from typing import Any

import numpy as np

import armguard as ag
from armguard.prove.paving import Paver
from armguard.prove.tube import Tube
from arrays import Floats
from episodes.campaign import Campaign, Episode
from episodes.records import Digest, Figures, version_of
from pages import DOCS
from timing import quiet
from verifying.ahead import LEADS, MOST_AHEAD, announced, summed_leads
from verifying.judge import RESOLUTION, judged
from verifying.one_engine import EXTREME, asked, disagreements, summed_answers
from verifying.plans import KINDS, PATHS
from verifying.states import SCENES

# Rows of the plan that is timed, its duration [s], and rounds.
ROWS, DURATION, ROUNDS = 2000, 10.0, 30

# How far its joints swing about home: clear, and with contacts [rad].
SWINGS = {"clear": 0.1, "with contacts": 0.5}

RATES = "rates"

# Announced plans; and states of a scene, each asked in several ways.
AHEAD = "announced"
ASKED = {f"one engine, {name}": name for name in SCENES}

# Shares of the plans by kind; of the public data set, every path once.
SHARES = {
    **{"straight": 0.4, "thin": 0.3, "cubic": 0.25, "skewed": 0.05},
    **{"public": 2 * PATHS / 100_000, RATES: 1 / 100_000, AHEAD: 0.003},
    # Of each 1,000 states.
    **dict.fromkeys(ASKED, 0.0004),
}


def version(kind: str) -> str:
    """Hash of all that decides an episode of a kind."""
    modules = {RATES: "verify_campaign", AHEAD: "verifying.ahead"}
    modules |= dict.fromkeys(ASKED, "verifying.one_engine")
    return version_of(modules.get(kind, "verifying.judge"))(kind)


def run_episode(kind: str, seed: int) -> Episode:
    """A plan, proven and judged; of the rates, their times."""
    if kind == RATES:
        return {"seed": seed, **rates()}
    if kind == AHEAD:
        return {"seed": seed, **announced(seed)}
    if kind in ASKED:
        return {"seed": seed, **asked(ASKED[kind], seed)}
    return {"seed": seed, **judged(KINDS[kind](seed), seed)}


def timed_plan(home: Floats, swing: float, seed: int = 0) -> Tube:
    """Arms swing about home, in straight lines between rows."""
    rng = np.random.default_rng(seed)
    times = np.linspace(0.0, DURATION, ROWS)
    size = rng.uniform(0.3 * swing, swing, (3, len(home)))
    phase = rng.uniform(0.0, 2.0 * np.pi, (3, len(home)))
    q = np.tile(home, (ROWS, 1))
    for k in range(3):
        turn = 0.6 * (k + 1) * times[:, None] + phase[k]
        q += size[k] * (np.sin(turn) - np.sin(phase[k]))
    return Tube.straight(times, q)


def rates() -> dict[str, Any]:
    """Processor times of a proof, all intervals and the least distance [ms]."""
    scene = ag.bay_scene()
    paver, found = Paver(ag.Checker(scene)), {}
    for name, swing in SWINGS.items():
        tube, times = timed_plan(scene.home, swing), []
        with quiet():
            for _ in range(ROUNDS):
                start = process_time()
                paving = paver.pave(tube, RESOLUTION)
                proven = process_time()
                intervals = paver.intervals(paving, tube, RESOLUTION)
                listed = process_time()
                paver.least(tube)
                end = process_time()
                times.append((proven - start, listed - start, end - listed))
        proof, every, least = (1e3 * median(one) for one in zip(*times, strict=True))
        found[name] = {
            "intervals": len(intervals),
            "proof_ms": proof,
            "intervals_ms": every,
            "least_ms": least,
        }
    return {"plans": found, "again_s": again()}


def again() -> float:
    """Processor time of 1,000 plans of one arm, after a table has moved [s]."""
    scene = ag.Scene(mode="fixed")
    scene.add_robot(ag.bay_scene().robots["left"].model, name="arm")
    table, low = ag.Box(size=(1.5, 1.5, 0.05)), (0.0, 0.0, -0.3)
    scene.add(table, name="table", pose=ag.Pose(xyz=low))
    for k in range(6):
        x, y = 0.75 * np.cos(k), 0.75 * np.sin(k)
        place = ag.Pose(xyz=(x, y, 0.0))
        scene.add(ag.Box(size=(0.1, 0.1, 0.3)), name=f"box{k}", pose=place)
    checker = ag.Checker(scene)
    paver = Paver(checker)
    tubes = [timed_plan(checker.tables.home, 0.3, seed) for seed in range(100)]
    for tube in tubes:
        paver.pave(tube, RESOLUTION)
    checker.place("table", ag.Pose(xyz=(0.0, 0.0, -0.25)))
    with quiet():
        start = process_time()
        for tube in 10 * tubes:
            paver.intervals(paver.pave(tube, RESOLUTION), tube, RESOLUTION)
        return process_time() - start


def summed_up(kind: str, episodes: list[Episode]) -> Figures:
    """Figures of episodes; all but those of rates are sums."""
    if kind == RATES:
        last = episodes[-1]
        return {"episodes": 1, "plans": last["plans"], "again_s": last["again_s"]}
    if kind == AHEAD:
        return summed_leads(episodes)
    if kind in ASKED:
        return summed_answers(episodes)
    without: Counter[str] = Counter()
    for episode in episodes:
        without.update(episode["without"])
    keys = ("intervals", "missed", "ends", "ends_off", "firsts", "first_off")
    sums = {key: sum(e[key] for e in episodes) for key in (*keys, "samples", "unseen")}
    return {
        "episodes": len(episodes),
        **sums,
        "sampled_wrong": sum(e["unseen"] > 0 for e in episodes),
        "seconds": sum(e["seconds"] for e in episodes),
        "without": dict(without),
    }


def digest(episode: Episode) -> Digest:
    """What came of an episode, in short."""
    outcome = "missed" if episode.get("missed") else ""
    if disagreements(episode):
        outcome = "answers differ"
    if any(episode.get(key) for key in LEADS):
        outcome = "a lead is off"
    if episode.get("ends_off") or episode.get("first_off"):
        outcome = "a time is off"
    keys = ("intervals", "unseen", "cycles", "states")
    return Digest(
        episode["seed"], outcome, None, {k: episode[k] for k in keys if k in episode}
    )


def is_broken(figures: Figures) -> bool:
    """Whether a promise is broken."""
    keys = ("missed", "ends_off", "first_off", *LEADS)
    return disagreements(figures) > 0 or any(figures.get(key, 0) > 0 for key in keys)


CAMPAIGN = Campaign(
    results=DOCS / "verify.json",
    kinds={kind: partial(run_episode, kind) for kind in (*KINDS, AHEAD, *ASKED, RATES)},
    version=version,
    extreme=EXTREME | dict.fromkeys(MOST_AHEAD, max),
    summed_up=summed_up,
    digest=digest,
    is_broken=is_broken,
    is_notable=lambda episode: bool(digest(episode).outcome),
    count=100_000,
    shares=SHARES,
    written=50,
)


if __name__ == "__main__":
    sys.exit(CAMPAIGN.main(__doc__))
