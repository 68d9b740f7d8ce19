"""Continuous collision check of a path of joint positions."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armguard.guard.levels import Reason
from armguard.guard.near_pair import NearPair
from armguard.guard.verdict import Verdict

Floats = NDArray[np.float64]

# A line on which no joint moves more than this is not bisected further [rad or m].
RESOLUTION = 1e-4

# Reasons of a verdict that has not judged all pairs.
INCOMPLETE = (Reason.CAPACITY, Reason.CROWDED)


@dataclass(frozen=True, slots=True)
class Breach:
    """The first place of a path at which a buffer is not kept, or not proven.

    Attributes:
        segment: Index of the segment of the path, from 0.
        share: Position along the segment, in [0, 1]; all before is proven clear [-].
        q: Joint positions there, shape (n,) [rad or m].
        pair: The pair; None where too many pairs are near to judge them all.
        certain: Whether the pair breaks its buffer within the resolution; otherwise
            it is too near for a proof.
    """

    segment: int
    share: float
    q: Floats
    pair: NearPair | None
    certain: bool


@dataclass(frozen=True, slots=True)
class PathCheck:
    """Result of the check of a path.

    Attributes:
        clear: Whether every pair is proven to keep its buffer on the whole path.
        breach: The first place where a pair does not, None if the path is clear.
        lines: Number of straight lines that were judged, halves included; a line that
            the checker proves counts as one.
    """

    clear: bool
    breach: Breach | None
    lines: int

    @property
    def sentence(self) -> str:
        """The result in words and millimetres."""
        if self.breach is None:
            return "between the samples: every pair keeps its buffer, proven"
        at = self.breach
        place = f"between the samples: first at {at.segment} + {at.share:.4f}"
        if at.pair is None:
            return f"{place} too much is near a robot to judge all pairs"
        what = "breaks its buffer" if at.certain else "is too near to decide"
        return f"{place} a pair {what}: {at.pair.why}"

    def to_dict(self, names: Sequence[str]) -> dict[str, object]:
        """The result as plain numbers and strings, ready for JSON.

        Args:
            names: Names of the joints.
        """
        at = self.breach
        found: dict[str, object] = {"clear": self.clear, "lines": self.lines}
        if at is not None:
            pair = at.pair
            found["breach"] = {
                "segment": at.segment,
                "share": at.share,
                "q": dict(zip(names, at.q.tolist(), strict=True)),
                "a": None if pair is None else pair.a,
                "b": None if pair is None else pair.b,
                "distance": None if pair is None else pair.distance,
                "buffer": None if pair is None else pair.buffer,
                "certain": at.certain,
            }
        return found


def check_path(
    rows: Sequence[Floats] | Floats,
    judge_line: Callable[[Floats, Floats], Verdict],
    resolution: float,
    proven: NDArray[np.bool_],
) -> PathCheck:
    """Find the first place of a path at which a pair does not keep its buffer.

    Args:
        rows: Joint positions, joined by straight lines, shape (k, n) [rad or m].
        judge_line: Verdict on a line: whether all pairs provably keep their buffers.
        resolution: A line on which no joint moves more than this is not bisected
            [rad or m].
        proven: Which lines need no verdict, shape (max(k - 1, 1),).
    """
    lines = 0
    for segment in range(max(len(rows) - 1, 1)):
        if proven[segment]:
            lines += 1
            continue
        start = np.asarray(rows[segment], dtype=np.float64)
        end = np.asarray(rows[min(segment + 1, len(rows) - 1)], dtype=np.float64)
        # Stack of halves to be judged, the earliest on top.
        waiting = [(0.0, 1.0)]
        while waiting:
            low, high = waiting.pop()
            one, other = between(start, end, low), between(start, end, high)
            verdict = judge_line(one, other)
            lines += 1
            worst = verdict.nearest
            whole = verdict.reason not in INCOMPLETE
            if whole and (worst is None or worst.headroom >= 0.0):
                continue
            if not float(np.abs(other - one).max()) <= resolution:
                middle = 0.5 * (low + high)
                waiting += [(middle, high), (low, middle)]
                continue
            there = [
                p
                for q in (one, other)
                for p in judge_line(q, q).near
                if not p.headroom >= 0.0
            ]
            pair = min(there, key=lambda p: p.headroom) if there else worst
            found = Breach(segment, low, one, pair, certain=bool(there))
            return PathCheck(False, found, lines)
    return PathCheck(True, None, lines)


def between(start: Floats, end: Floats, share: float) -> Floats:
    """Joint positions at a share of a straight line; exact at its ends."""
    if share in (0.0, 1.0):
        return start if share == 0.0 else end
    return np.asarray(start + share * (end - start))
