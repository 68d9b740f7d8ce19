"""A tube: where all joints may be over time, as curves plus or minus a width."""

from dataclasses import dataclass
from math import comb
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armguard.prove.tube_tiles import MOST_CONTROL, TubeTable

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Tube:
    """Curves of all joints, in segments of time, and how far a joint may leave its own.

    In a segment each joint's curve is a polynomial of the share of the segment that has
    passed, given by its Bernstein control points.

    Attributes:
        times: Where segments begin, and the end of the last, shape (s + 1,) [s].
        control: Control points, shape (s, degree + 1, n) [rad or m].
        wide: Greatest deviation of each joint from its curve in each segment, of any
            sign and independent of the others, shape (s, n) [rad or m].
    """

    times: Floats
    control: Floats
    wide: Floats

    @classmethod
    def straight(cls, times: Floats, rows: Floats) -> Self:
        """Straight lines between rows, without a width.

        Args:
            times: Rising, shape (k,) [s].
            rows: Joint positions, shape (k, n), two or more [rad or m].
        """
        control = np.stack((rows[:-1], rows[1:]), axis=1)
        return cls(times, control, np.zeros_like(control[:, 0]))

    @property
    def degree(self) -> int:
        """Degree of the polynomials."""
        return int(self.control.shape[1]) - 1

    def without_width(self) -> "Tube":
        """The curves alone."""
        return Tube(self.times, self.control, np.zeros_like(self.wide))

    def widened(self, wide: Floats) -> "Tube":
        """The same with more width, of shape (s, n) or what broadcasts to it."""
        return Tube(self.times, self.control, np.ascontiguousarray(self.wide + wide))

    def place(self, times: Floats) -> tuple[NDArray[np.intp], Floats]:
        """Segment of each time, and the share of it that has passed then."""
        segment = np.searchsorted(self.times, times, side="right") - 1
        segment = np.clip(segment, 0, len(self.control) - 1)
        start = self.times[segment]
        share = (times - start) / (self.times[segment + 1] - start)
        return segment, np.clip(share, 0.0, 1.0)

    def time(self, segment: NDArray[np.intp], share: Floats) -> Floats:
        """Time at a share of each segment [s]; exact at its ends."""
        start, end = self.times[segment], self.times[segment + 1]
        return np.where(share == 1.0, end, start + share * (end - start))

    def at(self, times: Floats) -> Floats:
        """Joint positions on the curves at some times, shape (k, n) [rad or m]."""
        segment, share = self.place(times)
        k, u = np.arange(self.degree + 1), share[:, None]
        chosen = np.array([comb(self.degree, int(one)) for one in k])
        basis = chosen * u**k * (1.0 - u) ** (self.degree - k)
        return np.asarray(np.einsum("sk,skn->sn", basis, self.control[segment]))

    def velocities(self, times: Floats) -> Floats:
        """Joint velocities on the curves at some times, (k, n) [rad/s or m/s]."""
        steps = self.degree * np.diff(self.control, axis=1)
        rates = steps / np.diff(self.times)[:, None, None]
        return Tube(self.times, rates, self.wide).at(times)

    def top_speeds(self) -> Floats:
        """Bound of each joint's speed in each segment, shape (s, n) [rad/s or m/s]."""
        steps = np.abs(np.diff(self.control, axis=1)).max(axis=1)
        return np.asarray(self.degree * steps / np.diff(self.times)[:, None])

    def table(self, resolution: float) -> TubeTable:
        """The tube as kernels read it.

        Args:
            resolution: Time below which a tile is not halved [s].
        """
        assert self.degree < MOST_CONTROL
        return TubeTable(
            control=np.ascontiguousarray(
                self.control.reshape(-1, self.control.shape[2])
            ),
            wide=np.ascontiguousarray(self.wide),
            smallest=resolution / np.diff(self.times),
        )

    def tiles(self, turn: float) -> Floats:
        """Segments, cut where their joints turn more than `turn` in all.

        Returns:
            Segment, and shares of it where each tile begins and ends, shape (k, 3).
        """
        turned = np.abs(np.diff(self.control, axis=1)).sum(axis=(1, 2))
        parts = np.maximum(np.ceil(turned / turn), 1.0).astype(np.intp)
        segment = np.repeat(np.arange(len(parts)), parts)
        number = np.arange(len(segment)) - np.repeat(np.cumsum(parts) - parts, parts)
        count = parts[segment]
        return np.column_stack((segment, number / count, (number + 1) / count))
