"""Answers of the checker: arrays with one entry for each row, motion or pair."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armguard.batch.settle import CODE, SHIFT

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class NearestPairs:
    """The nearest checked pair of each configuration.

    Attributes:
        distance: Least signed distance of the checked pairs; infinite where none is
            nearer than the margin, NaN where the row cannot be judged, (rows,) [m].
        a: Primitive of each row's pair, a place in `Checker.labels`; -1 where there is
            none, shape (rows,).
        b: The other primitive, shape (rows,).
    """

    distance: Floats
    a: NDArray[np.intp]
    b: NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Witnesses:
    """Witness points of pairs of primitives, and the gradient of their distance.

    A row with NaN in `distance` has NaN in all the others.

    Attributes:
        row: Configuration of each pair, a place in the batch, shape (k,).
        a: Primitive A, a place in `Checker.labels`; -1 for no pair, shape (k,).
        b: Primitive B, shape (k,).
        distance: Signed distance; NaN for no pair, shape (k,) [m].
        point_a: Point of A nearest to B, in the world, shape (k, 3) [m].
        point_b: Point of B nearest to A, shape (k, 3) [m].
        normal: Unit normal from A to B, shape (k, 3).
        gradient: Derivative of the distance by each joint position, shape (k, joints)
            [m/rad, or 1 for a prismatic joint].
    """

    row: NDArray[np.intp]
    a: NDArray[np.intp]
    b: NDArray[np.intp]
    distance: Floats
    point_a: Floats
    point_b: Floats
    normal: Floats
    gradient: Floats


@dataclass(frozen=True, slots=True)
class ProvenMotions:
    """How far straight joint motions are proven to keep every buffer.

    Attributes:
        proven: Whether every checked pair keeps its buffer all the way, shape (n,).
        share: Share of the motion, from its start, up to which that is proven: 1 where
            all of it is, 0 where nothing is or the row cannot be judged, shape (n,).
        a: Primitive of the pair with the least distance above its buffer where the
            proof ends, a place in `Checker.labels`; -1 where the motion is proven or
            cannot be judged, shape (n,).
        b: The other primitive, shape (n,).
    """

    proven: NDArray[np.bool_]
    share: Floats
    a: NDArray[np.intp]
    b: NDArray[np.intp]


def witnesses_of(
    pairs: NDArray[np.int64], witness: Floats, gradient: Floats
) -> Witnesses:
    """The arrays of a `Listing` by name."""
    row, a, b = pairs.astype(np.intp).T
    parts = witness[:, 0], witness[:, 1:4], witness[:, 4:7], witness[:, 7:10]
    return Witnesses(row, a, b, *parts, gradient)


def primitives_of(pairs: Floats) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Both primitives of pairs as in `Place.pair`, -1 for none."""
    code = pairs.astype(np.intp)
    return np.maximum(code >> SHIFT, -1), np.where(code < 0, -1, code & (CODE - 1))
