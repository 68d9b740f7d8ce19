"""Many configurations of a scene: clear or not, and how far from what."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from math import inf

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.batch.check import LONGEST, check_rows
from armguard.batch.near import list_near, measure_pairs
from armguard.batch.objects import place_object, place_rows, remove_object
from armguard.batch.plan import plan_of
from armguard.batch.pose import NEAR
from armguard.batch.prove import WHOLE, prove_motions
from armguard.batch.results import (
    NearestPairs,
    ProvenMotions,
    Witnesses,
    primitives_of,
    witnesses_of,
)
from armguard.batch.room import (
    FIRST_ROOM,
    REACHED,
    Room,
    Settings,
    limit_of,
    listing_of,
    place_of,
    room_of,
    scratch_of,
    settings_of,
    sizes_of,
)
from armguard.batch.rows import order_of, rows_of
from armguard.errors import SceneError
from armguard.geometry.pose import Pose, transform_of
from armguard.geometry.shapes import Shape
from armguard.kernel import check_cache
from armguard.lanes import WIDTH
from armguard.scene.compile import compile_scene
from armguard.scene.scene import Scene
from armguard.scene.standing import object_named
from armguard.scene.tables import SceneTables
from armguard.table import Ledger

Floats = NDArray[np.float64]


class Checker:
    """Answers for arrays of joint configurations of a scene.

    It checks the pairs of primitives that a `Guard` of the scene checks: nothing is
    held (but see `Guard.checker`), and a gripper is measured by its links. An object
    has the pose of the scene until `place` or `remove`. Where two links' primitives are
    too near, `clear` and `prove` measure their exact shapes, as a guard does; distances
    are those of the primitives. Other changes of the scene need a new checker. Calls
    from several threads at once are allowed, but for `place` and `remove`.

    Attributes:
        q_names: 'robot/joint' of each place of a configuration.
        lower: Least joint positions, shape (joints,) [rad or m].
        upper: Greatest joint positions, of that shape.
        labels: Name of each primitive, as in `NearPair.primitive_a`.
        tables: The scene; its objects are where they are at first.
        world: What kernels read, with objects where they are now.

    Args:
        scene: The scene, or its tables.
        threads: How many threads answer a call; results do not depend on it.

    Raises:
        SceneError: The scene contradicts itself, or `threads` is below 1.

    Example:
        >>> import armguard as ag
        >>> scene = ag.bay_scene()
        >>> ag.Checker(scene).clear([scene.home]).tolist()
        [True]
    """

    def __init__(self, scene: Scene | SceneTables, threads: int = 1) -> None:
        if threads < 1:
            raise SceneError(f"threads is {threads}; it must be at least 1")
        check_cache()
        self._threads = threads
        tables = compile_scene(scene) if isinstance(scene, Scene) else scene
        self.q_names, self.labels = tables.q_names, tables.labels
        self.lower, self.upper = tables.lower.copy(), tables.upper.copy()
        # Rows of hulls lead to numbers that these shapes hold.
        self._shapes, self._objects = tables.shapes, dict(tables.standing)
        self.tables, self.world = tables, plan_of(tables)
        self._plan = Ledger(self.world)
        self._spare: list[Room] = []
        self._sizes = sizes_of(self.world)
        self._limit = limit_of(self.world)
        for name, item in self._objects.items():
            if not item.present:
                self.remove(name)

    def place(
        self, name: str, pose: Pose | ArrayLike, *, shape: Shape | None = None
    ) -> None:
        """Set the pose of an object, and add it to the world if it was absent.

        Args:
            name: An object of the scene that is attached to no link.
            pose: Its frame in the world, a `Pose` or a transform of shape (4, 4).
            shape: New shape, of the same kind; see `Guard.place`.

        Raises:
            UnknownNameError: There is no such object.
            PoseError: The transform is not rigid, or a number is not finite.
            SceneError: The object cannot have that shape.
        """
        item = object_named(name, self._objects)
        if shape is not None:
            item = item.reshaped(name, shape)
        place_object(self.world, item, transform_of(pose))
        self._objects[name] = item
        self._spare.clear()

    def place_rows(self, name: str, rows: Floats, frame: Floats) -> None:
        """Place an object as the tables of a guard have it; see `batch.objects`.

        Raises:
            UnknownNameError: There is no such object.
        """
        place_rows(self.world, object_named(name, self._objects), rows, frame)
        self._spare.clear()

    def remove(self, name: str) -> None:
        """Remove an object from the world; `place` brings it back.

        Raises:
            UnknownNameError: There is no such object.
        """
        remove_object(self.world, object_named(name, self._objects))
        # These begin with the pair that was nearest last, which may be gone.
        self._spare.clear()

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
        return np.asarray(self._found(q, 0.0, 1, inf)[0] >= 0.0)

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
        nearest, pairs = self._found(q, margin, 0, 0.0)
        nearest[pairs == -1.0] = inf
        return NearestPairs(nearest, *primitives_of(pairs))

    def near(self, q: ArrayLike, margin: float) -> Witnesses:
        """Every checked pair nearer than the margin, with witness points and gradient.

        Args:
            q: Joint positions in the order of `q_names`, shape (rows, joints)
                [rad or m].
            margin: Signed distance below which a pair is reported [m].

        Returns:
            The pairs in ascending order of row, `a` and `b`. A row that cannot be
            judged has one entry, without a pair and with NaN.

        Raises:
            SceneError: `q` is no array of numbers of that shape, or `margin` is NaN.

        Example:
            >>> import armguard as ag
            >>> scene = ag.bay_scene()
            >>> bool((ag.Checker(scene).near([scene.home], 0.2).distance < 0.2).all())
            True
        """
        rows = rows_of(q, self.q_names, "q")
        settings, parts = settings_of(margin, 0, 0.0, self._limit), {}

        def answer(part: slice) -> None:
            parts[part.start] = self._list(rows[part], settings)

        self._divide(answer, len(rows), WIDTH)
        for start in parts:
            parts[start][0][:, 0] += start
        pairs, witness, gradient = map(
            np.concatenate, zip(*parts.values(), strict=True)
        )
        order = np.lexsort(pairs.T[::-1])
        return witnesses_of(pairs[order], witness[order], gradient[order])

    def witnesses(self, q: ArrayLike, pairs: NearestPairs) -> Witnesses:
        """Witness points and gradient of one pair in each configuration.

        Args:
            q: Joint positions in the order of `q_names`, shape (rows, joints)
                [rad or m].
            pairs: A pair for each row, as `distances` returns them.

        Raises:
            SceneError: `q` is no array of numbers of that shape, or there is not one
                pair for each row.

        Example:
            >>> import armguard as ag
            >>> scene = ag.bay_scene()
            >>> checker = ag.Checker(scene)
            >>> found = checker.witnesses([scene.home], checker.distances([scene.home]))
            >>> found.gradient.shape
            (1, 14)
        """
        rows = rows_of(q, self.q_names, "q")
        given = np.column_stack((np.arange(len(pairs.a)), pairs.a, pairs.b))
        if len(given) != len(rows):
            raise SceneError(f"there are {len(rows)} rows and {len(given)} pairs")
        listing = listing_of(len(rows), self._sizes)
        listing.arrays[1][:] = given
        room = self._room(settings_of(inf, 0, 0.0, self._limit))
        measure_pairs(
            rows,
            self._plan.lines,
            room.rows.lines,
            room.scratch.lines,
            listing.lines,
        )
        self._spare.append(room)
        return witnesses_of(*listing.arrays[1:])

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
        start = rows_of(starts, self.q_names, "starts")
        end = rows_of(ends, self.q_names, "ends")
        if len(start) != len(end):
            raise SceneError(f"there are {len(start)} starts and {len(end)} ends")
        reached = np.zeros(len(start), dtype=np.int64)
        self._divide(
            lambda part: self._prove(start[part], end[part], reached[part]),
            len(start),
            WIDTH,
        )
        share = np.maximum(reached, 0) / WHOLE
        a, b = np.full((2, len(start)), -1, dtype=np.intp)
        open_ends = (reached >= 0) & (reached < WHOLE)
        if open_ends.any():
            last = share[open_ends, None]
            places = start[open_ends] + last * (end[open_ends] - start[open_ends])
            pairs = self._found(places, inf, 1, 0.0)[1]
            a[open_ends], b[open_ends] = primitives_of(pairs)
        return ProvenMotions(reached == WHOLE, share, a, b)

    def _found(
        self, q: ArrayLike, margin: float, strict: int, drop: float
    ) -> tuple[Floats, Floats]:
        """Distance and pair of each row, shape (rows,); see `check_rows`."""
        rows = rows_of(q, self.q_names, "q")
        order = order_of(rows, self.lower, self.upper)
        settings = settings_of(margin, strict, drop, self._limit)
        count = len(rows)
        nearest, pairs = np.empty((2, count + WIDTH))
        given = rows if order is None else rows[order]

        def answer(part: slice) -> None:
            end = min(part.stop, count)
            places = slice(part.start, end + WIDTH)
            self._check(
                given[part.start : end], settings, nearest[places], pairs[places]
            )

        self._divide(answer, count, LONGEST * WIDTH)
        if order is None:
            return nearest[:count], pairs[:count]
        found = np.empty((2, count))
        found[0, order], found[1, order] = nearest[:count], pairs[:count]
        return found[0], found[1]

    def _list(self, rows: Floats, settings: Settings) -> tuple[Floats, ...]:
        """Near pairs of some rows: arrays of a `Listing`, without its total."""
        place, found, at = place_of(NEAR, self._sizes), [], 0
        room, pairs = FIRST_ROOM, FIRST_ROOM // WIDTH
        while True:
            scratch = scratch_of(pairs, self._sizes)
            listing = listing_of(room, self._sizes)
            scratch.arrays[0][...] = settings
            at = list_near(
                rows,
                at,
                self._plan.lines,
                place.lines,
                scratch.lines,
                listing.lines,
            )
            count = int(listing.arrays[0][0])
            found.append(tuple(array[:count] for array in listing.arrays[1:]))
            if at == len(rows):
                return tuple(map(np.concatenate, zip(*found, strict=True)))
            room, pairs = 2 * room, 2 * pairs

    def _divide(self, answer: Callable[[slice], None], count: int, block: int) -> None:
        """Answer for rows in as many parts as there are threads, each whole blocks."""
        share = -(-count // (self._threads * block)) * block
        parts = [slice(at, at + share) for at in range(0, count, max(share, 1))]
        if len(parts) < 2:
            answer(slice(0, count))
            return
        with ThreadPoolExecutor(self._threads) as pool:
            list(pool.map(answer, parts))

    def _check(
        self, rows: Floats, settings: Settings, nearest: Floats, pairs: Floats
    ) -> None:
        """Answer for some rows; see `check_rows`."""
        room = self._room(settings)
        check_rows(
            rows,
            self._plan.lines,
            room.spans.lines,
            room.rows.lines,
            room.scratch.lines,
            nearest,
            pairs,
        )
        self._spare.append(room)

    def _prove(self, starts: Floats, ends: Floats, reached: NDArray[np.int64]) -> None:
        """Prove some motions; see `prove_motions`."""
        room = self._room((0.0, 1, inf, self._limit))
        room.walk.put(REACHED, reached)
        prove_motions(
            starts,
            ends,
            self._plan.lines,
            room.motions.lines,
            room.scratch.lines,
            room.walk.lines,
        )
        self._spare.append(room)

    def _room(self, settings: Settings) -> Room:
        """What one call writes; that of an earlier call where there is one."""
        try:
            room = self._spare.pop()
        except IndexError:
            room = room_of(self._sizes)
        room.scratch.arrays[0][...] = settings
        return room
