"""Arms at a belt, beside guard and Coal; writes docs/coordinate.json and its page.

make coordinate-campaign                                  1,000 job pairs, and more
make coordinate-campaign ARGS="--kind 'every 10 s' --episodes 5"   some of one kind
make coordinate-campaign ARGS=--page                      the page from what is known

It resumes: an episode is a stream of items, and those that were judged with the same
code are known from docs/coordinate.json.
"""

import sys
from functools import partial
from hashlib import sha256
from pathlib import Path

import armguard.maps
from coordinating.judge import Kind, judged
from episodes.campaign import Campaign, Episode
from episodes.records import Digest, Figures, version_of
from pages import DOCS

KINDS = {
    "every 10 s": Kind(10.0),
    "every 7 s": Kind(7.0),
    "no hysteresis": Kind(7.0, left_out="hysteresis"),
    "no speed error": Kind(7.0, left_out="speed error"),
    "side by side": Kind(7.0, "side by side"),
    "side by side, alternatives": Kind(7.0, "side by side", alternatives=2),
    "three robots": Kind(10.0, "three"),
    "three robots, every 4 s": Kind(4.0, "three"),
    "three robots, each pair by itself": Kind(4.0, "three", "circles"),
}

# Counts that break a promise, in words.
BROKEN = {
    "contacts": "contact",
    "deadlocks": "deadlock",
    "both_yield": "both yield",
    "interventions": "guard intervened",
    "faults": "fault",
}


def version(kind: str) -> str:
    """Hash of all that decides an episode; decisions are no kernels."""
    digest = sha256(version_of("coordinating.judge")(kind).encode())
    for folder in armguard.maps.__path__:
        for path in sorted(Path(folder).glob("*.py")):
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def coordinated(kind: str, seed: int) -> Episode:
    """An episode, judged; what comes of something left out is expected."""
    found = judged(seed, KINDS[kind])
    if KINDS[kind].left_out:
        found |= {f"expected_{key}": found.pop(key) for key in BROKEN}
    return {"seed": seed, **found}


def summed_up(kind: str, episodes: list[Episode]) -> Figures:
    """Figures of episodes: sums, and the greatest of some."""
    found: Figures = {"episodes": len(episodes)}
    greatest = ("apart", "p999")
    for key in sorted({key for one in episodes for key in one} - {"seed"}):
        values = [one.get(key, 0) for one in episodes]
        found[key] = max(values) if key in greatest else sum(values)
    return found


def derived(kind: str, figures: Figures) -> Figures:
    """Share of the throughput without the other robot, in %."""
    if not figures.get("could"):
        return {}
    rate = figures["picked"] / figures["seconds"]
    return {"throughput": 100.0 * rate * figures["alone"] / figures["could"]}


def digest(episode: Episode) -> Digest:
    """What came of an episode, in short."""
    outcome = ""
    for key, words in BROKEN.items():
        if episode.get(key):
            outcome = words
    counts = {key: episode[key] for key in ("picked", "could", "yields")}
    return Digest(episode["seed"], outcome, None, counts)


def is_broken(figures: Figures) -> bool:
    """Whether a promise is broken."""
    return any(figures.get(key, 0) > 0 for key in BROKEN)


CAMPAIGN = Campaign(
    results=DOCS / "coordinate.json",
    kinds={kind: partial(coordinated, kind) for kind in KINDS},
    version=version,
    extreme={"apart": max, "p999": max},
    summed_up=summed_up,
    digest=digest,
    is_broken=is_broken,
    is_notable=lambda episode: bool(digest(episode).outcome),
    count=100,
    shares={
        "every 7 s": 0.2,
        "no hysteresis": 0.05,
        "no speed error": 0.05,
        "three robots": 0.05,
        "three robots, every 4 s": 0.05,
        "three robots, each pair by itself": 0.03,
    },
    written=1,
    derived=derived,
)


if __name__ == "__main__":
    sys.exit(CAMPAIGN.main(__doc__))
