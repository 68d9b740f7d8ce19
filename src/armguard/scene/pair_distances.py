"""Distances of all checked pairs of a scene, at any configuration."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from armguard.scene.exact import ExactTables
from armguard.scene.hold_tables import COARSE
from armguard.scene.proposal import Tree, sampled_extremes
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


class Distances:
    """Distances of the checked pairs of bodies at any configuration.

    The exact shapes of a link are measured where it has any, as the guard does before
    it stops a robot.

    Args:
        tables: The compiled scene.

    Attributes:
        pairs: Names of the two bodies of each pair.
        buffers: Distance each pair must keep, shape (k,) [m].
    """

    def __init__(self, tables: SceneTables) -> None:
        names = list(tables.body_names)
        real = np.array([not name.endswith(COARSE) for name in names])
        first, second = tables.groups[: tables.moving_count], tables.groups
        checked = tables.checked[first][:, second].astype(bool)
        i, j = np.nonzero(np.triu(checked & real[: len(first), None] & real[None], 1))
        number = {name: k for k, name in enumerate(dict.fromkeys(names))}
        body = np.array([number[name] for name in names])
        codes, owner = np.unique(
            body[i].astype(np.int64) * len(number) + body[j], return_inverse=True
        )
        by_number = list(number)
        self.pairs = [
            (by_number[code // len(number)], by_number[code % len(number)])
            for code in codes.tolist()
        ]
        self.buffers = np.zeros(len(codes))
        np.maximum.at(
            self.buffers, owner, tables.buffers[tables.groups[i], tables.groups[j]]
        )
        exact = tables.exact
        self._shapes = exact.shapes  # rows refer to them
        self._kinds = np.concatenate([tables.kinds, exact.kinds])
        self._rows = np.concatenate([tables.local_rows, exact.rows])
        self._bodies = np.concatenate([tables.bodies, bodies_of(exact, tables.bodies)])
        self._measured = refined(np.stack([i, j, owner], axis=1), exact)
        self._tree = Tree.of(tables)

    def __len__(self) -> int:
        """How many pairs of shapes are measured."""
        return len(self._measured)

    def at(self, q: Floats) -> Floats:
        """Distance of each pair at a configuration, shape (k,) [m].

        Args:
            q: Joint positions, shape (n,) [rad or m].
        """
        return self.extremes(np.asarray(q, dtype=np.float64)[None])[0]

    def extremes(
        self, q: Floats, only: Sequence[int] | None = None
    ) -> tuple[Floats, Floats]:
        """Least and greatest distance of each pair, each shape (k,) [m].

        Args:
            q: Configurations, shape (s, n) [rad or m].
            only: Pairs to measure; all if None. The others are inf and -inf.
        """
        measured = self._measured
        if only is not None:
            measured = measured[np.isin(measured[:, 2], only)]
        return sampled_extremes(
            np.ascontiguousarray(q),
            self._tree,
            self._kinds,
            self._bodies,
            self._rows,
            measured,
            len(self.pairs),
        )


def bodies_of(exact: ExactTables, bodies: Ints) -> Ints:
    """The body of each exact shape, shape (e,).

    Args:
        exact: The exact shapes.
        bodies: The body of each primitive, shape (p,).
    """
    found = np.full(len(exact.kinds), -1, dtype=np.int32)
    for (first, count), body in zip(exact.of_primitive, bodies, strict=True):
        if first >= 0:
            found[first : first + count] = body
    return found


def refined(pairs: NDArray[np.int64], exact: ExactTables) -> Ints:
    """Pairs of primitives as pairs of exact shapes, where a link has any.

    Args:
        pairs: Two primitives and their pair of bodies, shape (k, 3).
        exact: The exact shapes; their numbers follow those of the primitives.

    Returns:
        Two shapes and their pair of bodies, shape (m, 3).
    """
    first, count = exact.of_primitive.astype(np.int64).T
    own = np.arange(len(first))
    start = np.where(first >= 0, len(first) + first, own)
    count = np.where(first >= 0, count, 1)
    number = np.zeros(len(first) + len(exact.kinds), dtype=np.int64)
    number[start] = count
    ends = np.column_stack([start[pairs[:, 0]], start[pairs[:, 1]], pairs[:, 2]])
    a, b, owner = np.unique(ends, axis=0).T
    many = number[a] * number[b]
    k = np.arange(many.sum()) - np.repeat(np.cumsum(many) - many, many)
    a, b, owner, wide = (np.repeat(x, many) for x in (a, b, owner, number[b]))
    return np.column_stack([a + k // wide, b + k % wide, owner]).astype(np.int32)
