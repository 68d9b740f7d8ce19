"""Many configurations of a scene: clear or not, and how far from what."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.batch.check import LONGEST, check_rows
from armguard.batch.lanes import WIDTH
from armguard.batch.plan import plan_of
from armguard.batch.pose import Place
from armguard.batch.search import ROOM, SETTINGS, Scratch
from armguard.errors import SceneError
from armguard.geometry.shapes import ROW_WIDTH
from armguard.kernel import check_cache
from armguard.scene.compile import compile_scene
from armguard.scene.scene import Scene
from armguard.table import Ledger

Floats = NDArray[np.float64]

# Scratch of a call, its place for spans and its place for rows.
Room = tuple[Ledger, Ledger, Ledger]

# The sine in lanes is exact up to this angle [rad].
LARGEST_ANGLE = 1e5


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

    def _found(self, q: ArrayLike, margin: float, strict: float, drop: float) -> Floats:
        """Distance and pair of each row, shape (rows, 3); see `check_rows`."""
        given, joints = np.asarray(q), len(self.q_names)
        if given.ndim != 2 or given.shape[1] != joints:
            raise SceneError(
                f"q has shape {given.shape}; it must be (rows, {joints}), one column "
                f"for each of: {', '.join(self.q_names)}"
            )
        if given.dtype.kind not in "fiu":
            raise SceneError(f"q holds {given.dtype}; it must hold numbers")
        rows = np.ascontiguousarray(given, dtype=np.float64)
        settings = np.array([margin, strict, drop, self._limit])
        assert len(settings) == SETTINGS
        found = np.zeros((len(rows), 3))
        block = LONGEST * WIDTH
        share = -(-len(rows) // (self._threads * block)) * block
        starts = range(share, len(rows), share) if share else ()
        if len(starts) == 0:
            self._check(rows, settings, found)
            return found
        parts = zip(np.split(rows, starts), np.split(found, starts), strict=True)
        with ThreadPoolExecutor(self._threads) as pool:
            calls = [pool.submit(self._check, q, settings, out) for q, out in parts]
        for call in calls:
            call.result()
        return found

    def _check(self, rows: Floats, settings: Floats, found: Floats) -> None:
        """Answer for some rows; see `check_rows`."""
        room = self._room()
        scratch, spans, places = room
        scratch.arrays[0][:] = settings
        check_rows(
            rows, self._plan.lines, spans.lines, places.lines, scratch.lines, found
        )
        self._spare.append(room)

    def _room(self) -> Room:
        """What one call writes; that of an earlier call where there is one."""
        try:
            return self._spare.pop()
        except IndexError:
            return self._scratch(), self._place(exact=0), self._place(exact=1)

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

    def _place(self, exact: int) -> Ledger:
        """Room for eight configurations."""
        bodies, shapes, moving = self._sizes
        slots = moving * (1 + bodies)
        return Ledger(
            Place(
                exact=np.array([exact]),
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
