"""Branch and bound over the joint box of a pair of links."""

from collections import deque
from dataclasses import replace
from math import inf
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.prove.pair_proof import TOUCHING, PairProof, Verdict
from armguard.prove.pair_tables import PairTables
from armguard.prove.sampling import KEPT, first_samples, least_found

Floats = NDArray[np.float64]

# Boxes bounded in one call.
CHUNK = 2048

# While fewer boxes than this wait, the oldest and largest come first, so that the share
# that is left shrinks fast; beyond, the newest, so that memory has an end.
WAITING = 100_000

# How much farther apart another model must see a near pair to be worth its time [m].
WORTH = 1e-4


class PairSearch:
    """What is known of the distance of two links, and the boxes that are left.

    A few thousand configurations are looked at first. A pair seen both touching and
    apart is decided by that. One seen only apart is searched for a proof that it always
    is; one seen only touching, for a proof that it always touches.

    Args:
        tables: The two links.
        solid: A search that saw the pair apart, where the tables hold surfaces rather
            than what these enclose. If the surfaces never meet, the two stay as they
            are, inside or outside each other, since the joint box is connected; and
            once they were seen outside.
        seed: Of the configurations.

    Attributes:
        tables: The two links, by those models that help a proof that they are apart.
        nearest: Configuration with the least distance found.
        least: That distance, the best of all models [m].
        farthest: Configuration with the greatest distance found.
        greatest: That distance, the best of all models [m].
        boxes: Boxes bounded so far.
        seconds: Time spent so far [s].
        proven: Least bound of the distance in the boxes done with [m].
    """

    def __init__(
        self, tables: PairTables, *, solid: "PairSearch | None" = None, seed: int = 0
    ) -> None:
        start = monotonic()
        self.tables = self._every = tables
        lower, upper = tables.lower, tables.upper
        self._bounded = bool(np.isfinite(upper - lower).all())
        if not self._bounded:
            lower, upper = np.maximum(lower, -np.pi), np.minimum(upper, np.pi)
        rng = np.random.default_rng(seed)
        samples = first_samples(lower, upper, rng)
        self.nearest, self.least = least_found(
            lambda q: self._at(q)["distance"], samples, lower, upper, rng
        )
        self.farthest: Floats
        self.greatest: float
        if solid is not None:
            self.farthest, self.greatest = solid.farthest, solid.greatest
        else:
            self.farthest, away = least_found(
                lambda q: -self._at(q)["distance"], samples, lower, upper, rng
            )
            self.greatest = -away
        self.boxes = 0
        self.proven = np.inf
        self._touches = self.least <= TOUCHING
        self._parts = self.greatest > TOUCHING
        near = np.argsort(self._at(samples)["exact_distance"])[: 2 * KEPT]
        if not self._touches:
            self.tables = worthy_models(
                tables, np.concatenate([[self.nearest], samples[near]])
            )
        half = (upper - lower) / 2.0
        self._volume = max(float(np.prod(half[half > 0.0])), np.finfo(float).tiny)
        self._moving = half > 0.0
        self._waiting: deque[tuple[Floats, Floats, Floats]] = deque(
            [((lower + half)[None], half[None], np.full(1, -np.inf))]
        )
        self._count = 1
        self.seconds = monotonic() - start
        if solid is not None:
            self.seconds += solid.seconds
            self.boxes = solid.boxes

    @property
    def verdict(self) -> Verdict:
        """What is decided."""
        if self._touches and self._parts:
            return "sometimes"
        if self._count or not self._bounded:
            return "open"
        return "always" if self._touches else "never"

    @property
    def is_over(self) -> bool:
        """Whether searching further would find nothing more."""
        return self.verdict != "open" or not self._bounded

    @property
    def bound(self) -> float:
        """Proven bound over the whole joint box [m].

        No distance is less than this.
        """
        if self._touches:
            return -inf
        left = [float(block[2].min()) for block in self._waiting]
        return min([self.proven, *left])

    @property
    def share_left(self) -> float:
        """Share of the joint box that is neither proven nor decided [-]."""
        if self.verdict == "sometimes":
            return 0.0
        left = sum(
            float(np.prod(block[1][:, self._moving], axis=1).sum())
            for block in self._waiting
        )
        return left / self._volume

    def proof(self, link_a: str, link_b: str) -> PairProof:
        """What is known now."""
        joints = self.tables.joints
        return PairProof(
            link_a=link_a,
            link_b=link_b,
            verdict=self.verdict,
            least=self.least,
            nearest=dict(zip(joints, self.nearest.tolist(), strict=True)),
            greatest=self.greatest,
            farthest=dict(zip(joints, self.farthest.tolist(), strict=True)),
            bound=self.bound,
            boxes=self.boxes,
            share_left=self.share_left,
            seconds=self.seconds,
        )

    def run(self, seconds: float, boxes: int) -> None:
        """Search on until decided, or for this long or this many boxes."""
        start = monotonic()
        end, most = start + seconds, self.boxes + boxes
        while not self.is_over and self.boxes < most and monotonic() < end:
            self._step()
        self.seconds += monotonic() - start

    def _at(self, q: Floats) -> Any:
        """Bounds at configurations, boxes without width, by every model."""
        return self._every.bounds(q, np.zeros_like(q), full=True)

    def _take(self) -> tuple[Floats, Floats, Floats]:
        """The boxes that come next: middles, half widths, bounds known."""
        if self._count < WAITING:
            block, back = self._waiting.popleft(), self._waiting.appendleft
        else:
            block, back = self._waiting.pop(), self._waiting.append
        if len(block[0]) > CHUNK:
            back((block[0][CHUNK:], block[1][CHUNK:], block[2][CHUNK:]))
            block = (block[0][:CHUNK], block[1][:CHUNK], block[2][:CHUNK])
        self._count -= len(block[0])
        return block

    def _step(self) -> None:
        """Bound some boxes, and halve those that are left."""
        centre, half, known = self._take()
        found = self.tables.bounds(centre, half, full=self._touches)
        self.boxes += len(centre)
        self._see(centre, found)
        bound = np.maximum(known, -found["upper"] if self._touches else found["lower"])
        done = bound >= -TOUCHING if self._touches else bound > TOUCHING
        if done.any() and not self._touches:
            self.proven = min(self.proven, float(bound[done].min()))
        left = np.flatnonzero(~done)
        if not len(left):
            return
        centre, half, bound = centre[left], half[left], bound[left]
        if not self.tables.joints:
            # Nothing moves and there is nothing to halve: the distance is no number.
            self._bounded = False
            return
        each = np.arange(len(left))
        split = found[left]["split"].astype(np.intp)
        half = half.copy()
        half[each, split] /= 2.0
        low, high = centre.copy(), centre.copy()
        low[each, split] -= half[each, split]
        high[each, split] += half[each, split]
        self._push(
            np.concatenate([low, high]),
            np.concatenate([half, half]),
            np.concatenate([bound, bound]),
        )

    def _push(self, centre: Floats, half: Floats, bound: Floats) -> None:
        """Boxes that wait; the most promising, those with the least bound, in front."""
        order = np.argsort(bound, kind="stable")
        self._waiting.append((centre[order], half[order], bound[order]))
        self._count += len(order)

    def _turn_to_contact(self) -> None:
        """Search for "always" from now on: what was known bounds something else."""
        self._touches = True
        self.tables = self._every
        self._waiting = deque(
            (centre, half, np.full(len(known), -np.inf))
            for centre, half, known in self._waiting
        )

    def _see(self, q: Floats, found: NDArray[Any]) -> None:
        """Remember the nearest and the farthest met on the way."""
        low, high = int(np.argmin(found["distance"])), int(np.argmax(found["distance"]))
        if found[low]["distance"] < self.least:
            # The distance of the models was not measured.
            real = float(self._at(q[low : low + 1])[0]["distance"])
            if real < self.least:
                self.nearest, self.least = q[low], real
                if real <= TOUCHING and not self._touches:
                    self._turn_to_contact()
        if found[high]["distance"] > self.greatest:
            self.farthest, self.greatest = q[high], float(found[high]["distance"])
            self._parts = self._parts or self.greatest > TOUCHING


def worthy_models(tables: PairTables, q: Floats) -> PairTables:
    """The tables with those models alone that see a near pair farther apart.

    Args:
        tables: The two links.
        q: Configurations in which they are near, shape (k, n).
    """
    surfaces = tables.surfaces
    pairs, models = surfaces["pairs"], surfaces["models"]
    still = np.zeros_like(q)
    kept, sizes, exact = [], [], np.zeros(0)
    for m in range(len(models) - 1):
        own = pairs[models[m] : models[m + 1]]
        ends = np.array([0, len(own)], dtype=np.int32)
        alone = replace(tables, surfaces={**surfaces, "pairs": own, "models": ends})
        gaps = alone.bounds(q, still, full=True)["exact_distance"]
        if m == 0:
            exact = gaps
        elif not (gaps > exact + WORTH).any():
            continue
        kept.append(own)
        sizes.append(len(own))
    starts = np.cumsum([0, *sizes]).astype(np.int32)
    chosen = {"pairs": np.concatenate(kept), "models": starts}
    return replace(tables, surfaces={**surfaces, **chosen})
