"""Many configurations of a scene: clear or not, and how far from what."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.batch.check import LONGEST, check_rows
from armguard.batch.lanes import WIDTH
from armguard.batch.plan import plan_of
from armguard.batch.pose import MOTIONS, ROWS, SPANS, Place
from armguard.batch.prove import WAITING, WHOLE, Walk, prove_motions
from armguard.batch.search import ROOM, SETTINGS, Scratch
from armguard.errors import SceneError
from armguard.geometry.shapes import ROW_WIDTH
from armguard.kernel import check_cache
from armguard.scene.compile import compile_scene
from armguard.scene.scene import Scene
from armguard.table import Ledger

Floats = NDArray[np.float64]


# The sine in lanes is exact up to this angle [rad].
LARGEST_ANGLE = 1e5


class Room(NamedTuple):
    """What one call writes.

    Attributes:
        scratch: See `Scratch`.
        spans: Place for spans of rows.
        rows: Place for rows.
        motions: Place for spans of motions.
    """

    scratch: Ledger
    spans: Ledger
    rows: Ledger
    motions: Ledger


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


class Checker:
    """Answers for arrays of joint configurations of a scene.

    It checks the pairs of primitives that a `Guard` of the scene checks, in the scene
    as it is now: nothing is gripped, every object stands where the scene has it, and a
    gripper is measured by its links. The exact hulls of links, by which a guard may
    accept a pair whose primitives are too near, are not measured. A changed scene needs
    a new checker. Calls from several threads at once are allowed.

    Attributes:
        q_names: 'robot/joint' of each place of a configuration.
        labels: Name of each primitive, as in `NearPair.primitive_a`.

    Args:
        scene: The scene.
        threads: How many threads answer a call; results do not depend on it.

    Raises:
        SceneError: The scene contradicts itself, or `threads` is below 1.

    Example:
        >>> import armguard as ag
        >>> scene = ag.bay_scene()
        >>> ag.Checker(scene).clear([scene.home]).tolist()
        [True]
    """

    def __init__(self, scene: Scene, threads: int = 1) -> None:
        if threads < 1:
            raise SceneError(f"threads is {threads}; it must be at least 1")
        check_cache()
        self._threads = threads
        self._tables = compile_scene(scene)
        self._plan = Ledger(plan := plan_of(self._tables))
        self.q_names = self._tables.q_names
        self.labels = self._tables.labels
        self._spare: list[Room] = []
        self._sizes = len(plan.parent), len(plan.kinds), len(plan.pair_at)
        factor, offset = np.abs(plan.gain).max(axis=0, initial=1.0)
        self._limit = (LARGEST_ANGLE - offset) / factor

    def clear(self, q: ArrayLike) -> NDArray[np.bool_]:
        """Whether every checked pair keeps its buffer, in each configuration.

        A pair keeps its buffer where its signed distance is at least the distance that
        the scene requires of its two bodies at rest. A row with a number that is not
        finite, or beyond about 1e5 rad or m, is not clear. Joint limits do not count.

        Args:
            q: Joint positions in the order of `q_names`, shape (rows, joints)
                [rad or m].

        Returns:
            Shape (rows,).

        Raises:
            SceneError: `q` is no array of numbers of that shape.
        """
        return np.asarray(self._found(q, 0.0, 1.0, inf)[:, 0] >= 0.0)

    def distances(self, q: ArrayLike, margin: float = inf) -> NearestPairs:
        """The least signed distance of the checked pairs, in each configuration.

        Args:
            q: Joint positions in the order of `q_names`, shape (rows, joints)
                [rad or m].
            margin: Distances from this on are not looked for: such a row gets infinity
                and no pair. A small margin is answered faster [m].

        Raises:
            SceneError: `q` is no array of numbers of that shape, or `margin` is NaN.
        """
        if not margin > -inf:
            raise SceneError(f"margin is {margin} m; it must be a number")
        found = self._found(q, margin, 0.0, 0.0)
        pair = found[:, 1:].astype(np.intp)
        distance = np.where((pair[:, 0] < 0) & ~np.isnan(found[:, 0]), inf, found[:, 0])
        return NearestPairs(distance, pair[:, 0], pair[:, 1])

    def prove(self, starts: ArrayLike, ends: ArrayLike) -> ProvenMotions:
        """Prove that straight joint motions keep every buffer all the way.

        The joints move from start to end in the same proportion. A proven motion keeps
        the buffer of every checked pair at every instant, and not only at samples. One
        that is not proven may still keep them: if a pair comes nearer to its buffer
        than about 0.1 mm, or runs along beside it. A row with a number that is not
        finite, or beyond about 1e5 rad or m, is not proven.

        Args:
            starts: Joint positions in the order of `q_names`, shape (n, joints)
                [rad or m].
            ends: Joint positions of that shape.

        Returns:
            Arrays of shape (n,). They depend on the motion alone: not on other rows,
            nor on the number of threads.

        Raises:
            SceneError: An array is no array of numbers of that shape, or they differ
                in length.

        Example:
            >>> import armguard as ag
            >>> scene = ag.bay_scene()
            >>> ag.Checker(scene).prove([scene.home], [scene.home + 0.01]).proven
            array([ True])
        """
        start, end = self._rows(starts, "starts"), self._rows(ends, "ends")
        if len(start) != len(end):
            raise SceneError(f"there are {len(start)} starts and {len(end)} ends")
        reached = np.zeros(len(start), dtype=np.int64)
        self._divide(
            lambda part: self._prove(start[part], end[part], reached[part]),
            len(start),
            WIDTH,
        )
        share = np.maximum(reached, 0) / WHOLE
        pair = np.full((len(start), 2), -1, dtype=np.intp)
        open_ends = (reached >= 0) & (reached < WHOLE)
        last = share[open_ends, None]
        places = start[open_ends] + last * (end[open_ends] - start[open_ends])
        pair[open_ends] = self._found(places, inf, 1.0, 0.0)[:, 1:]
        return ProvenMotions(reached == WHOLE, share, pair[:, 0], pair[:, 1])

    def _rows(self, given: ArrayLike, name: str) -> Floats:
        """Joint positions as a contiguous array, shape (rows, joints).

        Raises:
            SceneError: It is no array of numbers of that shape.
        """
        rows, joints = np.asarray(given), len(self.q_names)
        if rows.ndim != 2 or rows.shape[1] != joints:
            raise SceneError(
                f"{name} has shape {rows.shape}; it must be (rows, {joints}), one "
                f"column for each of: {', '.join(self.q_names)}"
            )
        if rows.dtype.kind not in "fiu":
            raise SceneError(f"{name} holds {rows.dtype}; it must hold numbers")
        return np.ascontiguousarray(rows, dtype=np.float64)

    def _found(self, q: ArrayLike, margin: float, strict: float, drop: float) -> Floats:
        """Distance and pair of each row, shape (rows, 3); see `check_rows`."""
        rows = self._rows(q, "q")
        settings = np.array([margin, strict, drop, self._limit])
        found = np.zeros((len(rows), 3))
        self._divide(
            lambda part: self._check(rows[part], settings, found[part]),
            len(rows),
            LONGEST * WIDTH,
        )
        return found

    def _divide(self, answer: Callable[[slice], None], count: int, block: int) -> None:
        """Answer for rows in as many parts as there are threads, each whole blocks."""
        share = -(-count // (self._threads * block)) * block
        parts = [slice(at, at + share) for at in range(0, count, max(share, 1))]
        if len(parts) < 2:
            answer(slice(count))
            return
        with ThreadPoolExecutor(self._threads) as pool:
            list(pool.map(answer, parts))

    def _check(self, rows: Floats, settings: Floats, found: Floats) -> None:
        """Answer for some rows; see `check_rows`."""
        room = self._room()
        room.scratch.arrays[0][:] = settings
        check_rows(
            rows,
            self._plan.lines,
            room.spans.lines,
            room.rows.lines,
            room.scratch.lines,
            found,
        )
        self._spare.append(room)

    def _prove(self, starts: Floats, ends: Floats, reached: NDArray[np.int64]) -> None:
        """Prove some motions; see `prove_motions`."""
        room = self._room()
        room.scratch.arrays[0][:] = 0.0, 1.0, inf, self._limit
        walk = Ledger(
            Walk(
                waiting=np.zeros((WAITING, 4), dtype=np.int64),
                now=np.zeros((WIDTH, 4), dtype=np.int64),
                size=np.zeros(1, dtype=np.int64),
                reached=reached,
            )
        )
        prove_motions(
            starts,
            ends,
            self._plan.lines,
            room.motions.lines,
            room.scratch.lines,
            walk.lines,
        )
        self._spare.append(room)

    def _room(self) -> Room:
        """What one call writes; that of an earlier call where there is one."""
        try:
            return self._spare.pop()
        except IndexError:
            return Room(self._scratch(), *map(self._place, (SPANS, ROWS, MOTIONS)))

    def _scratch(self) -> Ledger:
        """Room beside the places."""
        return Ledger(
            Scratch(
                settings=np.zeros(SETTINGS),
                block=np.zeros(WIDTH * LONGEST * len(self.q_names) + WIDTH),
                sides=np.zeros(3 * WIDTH),
                kept=np.zeros(WIDTH, dtype=np.int64),
                pairs=np.zeros((WIDTH * ROOM, 2), dtype=np.int32),
                low=np.zeros((WIDTH * ROOM, 2)),
                single=np.zeros((3, ROW_WIDTH)),
            )
        )

    def _place(self, mode: int) -> Ledger:
        """Room for eight configurations."""
        bodies, shapes, moving = self._sizes
        slots = moving * (1 + bodies)
        return Ledger(
            Place(
                mode=np.array([mode]),
                q=np.zeros(WIDTH * len(self.q_names)),
                half=np.zeros(WIDTH * len(self.q_names)),
                T=np.zeros(WIDTH * 12 * bodies),
                rows=np.zeros(WIDTH * ROW_WIDTH * shapes),
                stamp=np.zeros(shapes, dtype=np.int64),
                turn=np.zeros(1, dtype=np.int64),
                shift=np.zeros(WIDTH * slots),
                swing=np.zeros(WIDTH * slots),
                best=np.zeros(WIDTH),
                who=np.zeros(WIDTH),
                lead=np.full(WIDTH, -1.0),
                bound=np.zeros(WIDTH),
            )
        )
