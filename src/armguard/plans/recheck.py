"""Rechecking a certificate with nothing that the proof used.

Positions are those of Coal on Pinocchio's kinematics. The bound is the simplest there
is: over a part of a tile no point moves farther than its joints can move, times how far
it can ever be from their axes. Where that does not suffice the part is halved.
"""

from dataclasses import dataclass
from math import comb

import numpy as np
from numpy.typing import NDArray

from armguard.plans.certificate import Certificate, CertificateError, scene_hash
from armguard.plans.coal_world import CoalWorld, checked_pairs, shared_joints
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]

# What a distance may lack of its buffer, for rounding and Coal's accuracy [m].
ACCURACY = 1e-6

# Parts of a tile that are not halved further [-].
SMALLEST = 2.0**-40


@dataclass(frozen=True, slots=True)
class Recheck:
    """What was confirmed.

    Attributes:
        tiles: Tiles whose other pairs were all confirmed to keep their buffers.
        leaves: Leaves that were confirmed to keep theirs.
        measured: Distances that were measured.
        open: Leaves that the certificate does not claim to be free.
    """

    tiles: int
    leaves: int
    measured: int
    open: int


def recheck(certificate: Certificate, tables: SceneTables) -> Recheck:
    """Confirm all that a certificate claims.

    Args:
        certificate: The certificate.
        tables: The scene as it is now.

    Raises:
        CertificateError: The scene is another one, a part of the plan or of a pair's
            tiles is missing, or a claim cannot be confirmed.
        TrajectoryError: Pinocchio or Coal is missing, or does not know a shape.
    """
    if certificate.scene != scene_hash(tables):
        raise CertificateError(
            "the scene has changed since the certificate was made; prove the plan again"
        )
    judge = Judge(certificate, tables)
    judge.check_coverage()
    for tile in range(len(certificate.tiles)):
        judge.confirm_tile(tile)
    free = certificate.leaves[certificate.leaves[:, 4] == 0.0]
    for leaf in free:
        judge.confirm_leaf(leaf)
    count = len(certificate.leaves) - len(free)
    return Recheck(len(certificate.tiles), len(free), judge.measured, count)


class Judge:
    """Confirms parts of a certificate.

    Attributes:
        measured: Distances that were measured.

    Args:
        certificate: The certificate.
        tables: The scene.
    """

    def __init__(self, certificate: Certificate, tables: SceneTables) -> None:
        self._c, self._world = certificate, CoalWorld(tables)
        self.measured = 0
        self._pairs, groups = checked_pairs(tables), tables.groups
        a, b = self._pairs.T
        self._buffers = tables.buffers[groups[a], groups[b]]
        names = [certificate.links.index(name) for name in tables.body_names]
        self._links = np.sort(np.array(names)[self._pairs], axis=1)
        levers = self._world.levers
        # A joint that carries both alike does not change their distance.
        alike = shared_joints(tables)
        self._levers = np.where(alike[a, b], 0.0, levers[a] + levers[b])
        steps = np.abs(np.diff(certificate.control, axis=1)).max(axis=1)
        self._rates = (certificate.control.shape[1] - 1) * steps

    def check_coverage(self) -> None:
        """Tiles hold every segment, and leaves every open pair of each tile.

        Raises:
            CertificateError: A part is missing.
        """
        c = self._c
        for segment in range(len(c.control)):
            own = c.tiles[c.tiles[:, 0] == segment, 1:]
            if gap_of(own, 0.0, 1.0):
                raise CertificateError(
                    f"a tile of segment {segment + 1} is missing or changed"
                )
        known = {tuple(pair): k for k, pair in enumerate(c.pairs.tolist())}
        parts: dict[tuple[int, int], list[Floats]] = {}
        for leaf in c.leaves:
            parts.setdefault((int(leaf[0]), int(leaf[1])), []).append(leaf[2:4])
        for tile, a, b in c.open.tolist():
            segment, low, high = c.tiles[tile]
            own = np.array(parts.get((known.get((a, b), -1), int(segment)), []))
            own = own.reshape(-1, 2)
            if gap_of(own[(own[:, 0] < high) & (own[:, 1] > low)], low, high):
                raise CertificateError(
                    f"a leaf of {c.links[a]} and {c.links[b]} is missing or changed, "
                    f"between {self._time(segment, low):.4f} s and "
                    f"{self._time(segment, high):.4f} s"
                )

    def confirm_tile(self, tile: int) -> None:
        """All pairs that a tile does not leave open keep their buffer in it."""
        segment, low, high = self._c.tiles[tile]
        left = self._c.open[self._c.open[:, 0] == tile, 1:]
        every = np.ones(len(self._pairs), dtype=bool)
        for a, b in left:
            every &= (self._links != sorted((a, b))).any(axis=1)
        self._confirm(np.flatnonzero(every), int(segment), float(low), float(high))

    def confirm_leaf(self, leaf: Floats) -> None:
        """The pair of a leaf keeps its buffer in it, and its bound is no higher.

        Raises:
            CertificateError: It does not, or its bound is above what is measured.
        """
        a, b = np.sort(self._c.pairs[int(leaf[0])])
        own = np.flatnonzero((self._links == (a, b)).all(axis=1))
        segment, low, high = int(leaf[1]), float(leaf[2]), float(leaf[3])
        self._confirm(own, segment, low, high)
        self._world.place(self._at(segment, 0.5 * (low + high)))
        measured = min(self._measure(int(k)) for k in own)
        if not leaf[5] <= measured + ACCURACY or leaf[5] < self._buffers[own].min():
            raise CertificateError(
                f"the bound of {self._c.links[a]} and {self._c.links[b]} at "
                f"{self._time(segment, low):.4f} s is {leaf[5]:.6g} m, but "
                f"{measured:.6g} m are measured there"
            )

    def _confirm(
        self, pairs: NDArray[np.intp], segment: int, low: float, high: float
    ) -> None:
        """Pairs of primitives keep their buffers in a part of a segment."""
        waiting = [(pairs, low, high)]
        a, b = self._pairs.T
        while waiting:
            pairs, low, high = waiting.pop()
            if not len(pairs):
                continue
            middle = 0.5 * (low + high)
            origins = self._world.place(self._at(segment, middle))
            way = 0.5 * (high - low) * self._rates[segment]
            needed = self._buffers[pairs] + self._levers[pairs] @ way
            apart = np.linalg.norm(origins[a[pairs]] - origins[b[pairs]], axis=1)
            apart -= self._world.radii[a[pairs]] + self._world.radii[b[pairs]]
            near = np.flatnonzero(~(apart >= needed))
            gaps = np.array([self._measure(int(pairs[k])) for k in near])
            open_still = near[~(gaps >= needed[near] - ACCURACY)]
            left = pairs[open_still]
            if len(left) and high - low <= SMALLEST:
                i, j = self._links[left[0]]
                raise CertificateError(
                    f"it cannot be confirmed that {self._c.links[i]} and "
                    f"{self._c.links[j]} keep their buffer at "
                    f"{self._time(segment, middle):.6f} s"
                )
            waiting += [(left, low, middle), (left, middle, high)]

    def _measure(self, k: int) -> float:
        """Distance of a pair of primitives where they were placed [m]."""
        self.measured += 1
        i, j = self._pairs[k]
        return self._world.distance(int(i), int(j))

    def _at(self, segment: int, share: float) -> Floats:
        """Joint positions on a curve, shape (n,)."""
        control = self._c.control[segment]
        degree = len(control) - 1
        weights = [
            comb(degree, k) * share**k * (1.0 - share) ** (degree - k)
            for k in range(degree + 1)
        ]
        return np.asarray(np.array(weights) @ control)

    def _time(self, segment: float, share: float) -> float:
        """Time at a share of a segment [s]."""
        start, end = self._c.times[int(segment) : int(segment) + 2]
        return float(start + share * (end - start))


def gap_of(parts: Floats, low: float, high: float) -> bool:
    """Whether parts leave a gap between two places, or one of them is no part."""
    at = low
    for start, end in sorted(parts.tolist()):
        if not (start <= at and end > start):
            return True
        at = max(at, end)
    return not at >= high
