"""Random sensors about a link: the blind patches of the coverage against MuJoCo's rays.

make coverage                                              200 of each kind
make coverage ARGS="--kind plate --first 3 --episodes 1 --show"    one of them

It resumes: episodes that were run with the same code are known from docs/coverage.json.
A plate is below one or two depth cameras and three to six discs that hide parts of it;
a capsule carries two to four rings of arrays of zones.
"""

import ast
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from hashlib import sha256
from pathlib import Path

import numpy as np

import blind_spots
from armguard.scene import Scene
from armguard.sense import coverage as covering
from armguard.sense import eye, patches
from armguard.sense.coverage import EDGE, LEAST, Patch, coverage
from blind_spots import (
    PLATE_STANDOFF,
    STANDOFF,
    Spot,
    random_capsule,
    random_plate,
    spots,
)
from episodes.campaign import Campaign, Episode
from episodes.records import Digest, Figures
from pages import DOCS

KINDS: Mapping[str, tuple[Callable[[np.random.Generator], Scene], float]] = {
    "plate": (random_plate, PLATE_STANDOFF),
    "capsule": (random_capsule, STANDOFF),
}

# Error of the sizes of both [m].
ERROR = 0.001

# Distance within which patches may count as one [m].
APART = 0.014

BEGIN, END = "<!-- campaign -->\n", "<!-- end of campaign -->"


def is_named(spot: Spot, named: Sequence[Patch]) -> bool:
    """Whether patches hold all of a spot but its rim; of a narrow one a part."""
    narrow = not len(spot.core)
    points = spot.points if narrow else spot.core
    points = points[:: max(len(points) // 400, 1)]
    near = np.zeros(len(points), dtype=np.bool_)
    for one in named:
        gaps = points[:, None] - one.points[:: max(len(one.points) // 8000, 1)]
        near |= (gaps * gaps).sum(axis=2).min(axis=1) <= (2.0 * EDGE) ** 2
    return bool(near.any() if narrow else near.all())


def is_real(patch: Patch, found: list[Spot]) -> bool:
    """Whether the spots at a patch's place, together, are not smaller."""
    if not found:
        return False
    points = np.concatenate([one.points for one in found])
    near = points[
        np.linalg.norm(points - patch.centre, axis=1) <= 0.5 * patch.size + APART
    ]
    if not len(near):
        return False
    ends = near[:: max(len(near) // 500, 1)]
    most = np.linalg.norm(ends[:, None] - ends, axis=2).max()
    return bool(most >= patch.size - 2.0 * ERROR)


def episode(kind: str, seed: int) -> Episode:
    """One set of sensors: which of its blind spots are named."""
    make, standoff = KINDS[kind]
    scene = make(np.random.default_rng(seed))
    found, named = spots(scene), coverage(scene, standoff=standoff).patches
    large = [one for one in found if one.size > LEAST + ERROR]
    wide = [one for one in large if len(one.core)]
    narrow = [one for one in large if not len(one.core)]
    missed = [one for one in wide if not is_named(one, named)]
    # On the plate's upper side, within the surface that is looked at.
    inner = [
        one
        for one in named
        if kind == "plate" and one.facing[2] > 0.99
        and np.abs(one.centre[:2]).max() < 0.15 - 0.5 * one.size
    ]  # fmt: skip
    return {
        "seed": seed,
        "spots": len(wide),
        "missed": len(missed),
        "narrow": len(narrow),
        "narrow_missed": sum(not is_named(one, named) for one in narrow),
        "least_mm": 1e3 * min((one.size for one in wide), default=1.0),
        "small": sum(one.size <= LEAST - ERROR for one in found),
        "patches": len(inner),
        "false": sum(not is_real(one, found) for one in inner),
    }


def summed_up(_: str, episodes: list[Episode]) -> Figures:
    """Figures of episodes, all of which but the least size are sums."""
    names = (
        "spots", "missed", "narrow", "narrow_missed", "small", "patches", "false",
    )  # fmt: skip
    return {
        "episodes": len(episodes),
        **{name: sum(e[name] for e in episodes) for name in names},
        "least_mm": min(e["least_mm"] for e in episodes),
    }


@cache
def version(kind: str) -> str:
    """Hash of the code of coverage and oracle; comments do not count."""
    whole = sha256(kind.encode())
    for one in (covering, eye, patches, blind_spots):
        text = Path(str(one.__file__)).read_text(encoding="utf-8")
        whole.update(ast.dump(ast.parse(text)).encode())
    return whole.hexdigest()[:16]


def page(results: Mapping[str, Figures]) -> str:
    """The page, with a table of what is known."""
    rows = [
        "| link | sets of sensors | spots of more than 20 mm | least [mm] | not named "
        "| narrower than 8 mm | not named | patches on the upper side "
        "| with no such spot |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
        *(
            f"| {kind} | {f['episodes']} | {f['spots']} | {f['least_mm']:.1f} "
            f"| {f['missed']} | {f['narrow']} | {f['narrow_missed']} "
            f"| {f['patches'] or '-'} "
            f"| {f['false'] if f['patches'] else '-'} |"
            for kind, f in results.items()
        ),
        "",
    ]
    text = (DOCS / "coverage.md").read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    return f"{before}{BEGIN}{chr(10).join(rows)}{END}{rest.partition(END)[2]}"


CAMPAIGN = Campaign(
    results=DOCS / "coverage.json",
    kinds={kind: partial(episode, kind) for kind in KINDS},
    version=version,
    extreme={"least_mm": min},
    summed_up=summed_up,
    digest=lambda e: Digest(
        e["seed"], "missed" if e["missed"] else "", e["least_mm"],
        {"spots": e["spots"], "false": e["false"]},
    ),
    is_broken=lambda figures: figures["missed"] > 0,
    is_notable=lambda e: e["missed"] > 0 or e["false"] > 0,
    count=200,
    written=50,
    page=page,
)  # fmt: skip


if __name__ == "__main__":
    sys.exit(CAMPAIGN.main(__doc__))
