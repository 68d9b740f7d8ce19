"""A tube: where all joints may be over time, as curves plus or minus a width."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
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
        bow: How far each joint's curve may leave that polynomial, shape (s, n); None
            if it is that polynomial [rad or m].
    """

    times: Floats
    control: Floats
    wide: Floats
    bow: Floats | None = None

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
        return replace(self, wide=np.zeros_like(self.wide))

    def widened(self, wide: Floats) -> "Tube":
        """The same with more width, of shape (s, n) or what broadcasts to it."""
        return replace(self, wide=np.ascontiguousarray(self.wide + wide))

    def thinned(self, tolerance: float) -> "Tube":
        """The same with chords in place of several segments, where these are near.

        Args:
            tolerance: How far curves may leave such a chord, which is then their bow
                [rad or m].
        """
        count, degree = len(self.control), self.degree
        knots, control, bow = [0], [], []
        while knots[-1] < count:
            start, step = knots[-1], 1
            while start + step < count:
                longer = min(2 * step, count - start)
                if self._chord_error(start, start + longer).max() > tolerance:
                    break
                step = longer
            knots.append(start + step)
            if step == 1:
                own = self.bow
                bow.append(np.zeros_like(self.wide[0]) if own is None else own[start])
                control.append(self.control[start])
                continue
            bow.append(self._chord_error(start, start + step))
            ends = self.control[start, 0], self.control[start + step - 1, -1]
            control.append(elevated(np.array([ends]), degree)[0])
        return Tube(
            times=self.times[knots],
            control=np.array(control),
            wide=np.maximum.reduceat(self.wide, np.array(knots[:-1]), axis=0),
            bow=np.array(bow),
        )

    def _chord_error(self, first: int, end: int) -> Floats:
        """How far each joint's curve leaves the chord of some segments, shape (n,)."""
        part, times = self.control[first:end], self.times[first : end + 1]
        share = np.arange(self.degree + 1) / self.degree
        places = times[:-1, None] + share * np.diff(times)[:, None]
        places = (places - times[0]) / (times[-1] - times[0])
        start, end_point = part[0, 0], part[-1, -1]
        chord = start + places[:, :, None] * (end_point - start)
        error: Floats = np.abs(part - chord).max(axis=(0, 1))
        return error if self.bow is None else error + self.bow[first:end].max(axis=0)

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

    def tiles(self, turn: float) -> Floats:
        """Segments, cut where their joints turn more than `turn` in all.

        Returns:
            Segment, and shares of it where each tile begins and ends, shape (k, SPAN).
        """
        turned = np.abs(np.diff(self.control, axis=1)).sum(axis=(1, 2))
        parts = np.maximum(np.ceil(turned / turn), 1.0).astype(np.intp)
        segment = np.repeat(np.arange(len(parts)), parts)
        number = np.arange(len(segment)) - np.repeat(np.cumsum(parts) - parts, parts)
        count = parts[segment]
        return np.column_stack((segment, number / count, (number + 1) / count))


def elevated(control: Floats, degree: int) -> Floats:
    """The same curves with control points of a higher degree, (s, degree + 1, n)."""
    while control.shape[1] <= degree:
        count = control.shape[1]
        share = (np.arange(1, count) / count)[:, None]
        inner = share * control[:, :-1] + (1.0 - share) * control[:, 1:]
        control = np.concatenate((control[:, :1], inner, control[:, -1:]), axis=1)
    return control


def tube_table(
    tubes: Sequence[Tube], resolution: float, owner: NDArray[np.intp] | None = None
) -> TubeTable:
    """Tubes as kernels read them, the segments of each behind those of the last.

    Args:
        tubes: One for each parameter.
        resolution: Time below which a tile is not halved [s].
        owner: Parameter that each joint follows, shape (n,); the first by default.
    """
    degree = max(tube.degree for tube in tubes)
    assert degree < MOST_CONTROL
    control = np.concatenate([elevated(tube.control, degree) for tube in tubes])
    count, joints = len(control), control.shape[2]
    bows = [np.zeros_like(t.wide) if t.bow is None else t.bow for t in tubes]
    durations = np.concatenate([np.diff(tube.times) for tube in tubes])
    if owner is None:
        owner = np.zeros(joints, dtype=np.intp)
    return TubeTable(
        control=np.ascontiguousarray(control.reshape(count * (degree + 1), joints)),
        bow=np.ascontiguousarray(np.concatenate(bows)),
        wide=np.ascontiguousarray(np.concatenate([tube.wide for tube in tubes])),
        smallest=resolution / durations,
        owner=owner.astype(np.int32),
    )
