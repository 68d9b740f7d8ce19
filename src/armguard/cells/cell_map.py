"""A map of cells that depth sensors fill."""

from collections.abc import Iterable
from math import inf, tan
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.cells.carve import carve
from armguard.cells.clearing import pass_occupied, pass_only_occupied
from armguard.cells.given import (
    Shot,
    camera_of,
    check_frame,
    check_size,
    checked_pose,
    depths_of,
    pair_of,
    rays_of,
    reaches_of,
)
from armguard.cells.hits import hit_pixels
from armguard.cells.masks import clear_masks, mask_kept, mask_shapes
from armguard.cells.octomap_words import tree_words
from armguard.cells.pyramid import Pyramid, empty_pyramid, fill_pyramid
from armguard.cells.rays import cast_rays
from armguard.cells.settled import SettledCells
from armguard.cells.state import (
    NO_SENSOR,
    Words,
)
from armguard.errors import CellMapError
from armguard.geometry.pose import Pose
from armguard.geometry.shapes import HalfSpace, Shape, shape_row
from armguard.table import IntVector, Ledger

Floats = NDArray[np.float64]

# Sizes of images for which room is kept.
MOST_IMAGE_SIZES = 8


class CellMap(SettledCells):
    """Cells of a cube, filled by depth images, zones and points.

    A cell is known free once a sensor has looked through all of it: every pixel that it
    may cover lies behind it. A measured point in a cell is a hit. A hit adds 2 to the
    evidence of a cell, a pass takes off 1, within 0 and 7; a cell with at least 2 is
    occupied. What no sensor has seen is unknown: a map that was never fed frees
    nothing.

    Attributes:
        intruder_speed: Speed at which something unknown may move [m/s]; None for maps
            without arrival times.
        settles: Time after which cells that appeared in free space are still [s].
        evidence: State: see `armguard.cells.state.Evidence`.

    Args:
        centre: Middle of the cube, world [m].
        cell: Edge of a cell [m].
        size: Cells along an edge of the cube: 64, 128, 256 or 512.
        intruder_speed: See above; 0 for an intruder that does not move.
        settles: See above.

    Raises:
        CellMapError: A number is out of its range.

    Example:
        >>> import numpy as np
        >>> import armguard as ag
        >>> cells = ag.CellMap(centre=(0, 0, 1), cell=0.02, size=64)
        >>> wall = np.full((120, 160), 1.2)
        >>> cells.depth(wall, np.eye(4), focal=130, centre=(79.5, 59.5), stamp=0.0)
        >>> ball = ag.Sphere(radius=0.1)
        >>> round(cells.distance(ball, ag.Pose(xyz=(0, 0, 0.9)), limit=0.5).distance, 2)
        0.2
    """

    def __init__(
        self, centre: ArrayLike, cell: float, size: int = 256, *,
        intruder_speed: float | None = None, settles: float = 0.5,
    ) -> None:  # fmt: skip
        super().__init__(
            centre, cell, size, intruder_speed=intruder_speed, settles=settles
        )
        self._images: dict[tuple[int, int], tuple[Pyramid, Ledger]] = {}

    def depth(
        self, image: ArrayLike, T_world_camera: Pose | ArrayLike,
        focal: float | tuple[float, float], centre: tuple[float, float], stamp: float,
        *, reach: float = inf, error: float = 0.0, single: bool = False,
        freeing: ArrayLike | None = None, clearing: ArrayLike | None = None,
        source: int = NO_SENSOR,
    ) -> None:  # fmt: skip
        """Take a depth image of a pinhole camera.

        Depths are perpendicular to the image's plane. A pixel that is not a positive
        finite number is invalid: it frees nothing and hits nothing.

        Args:
            image: Depths, shape (rows, columns): floats [m] or integers [mm].
            T_world_camera: Frame of the camera in the world: x along the columns, y
                along the rows, z along the line of sight.
            focal: Focal lengths along columns and rows, or one for both [pixels].
            centre: Column and row of the principal point; pixels have their middles at
                whole numbers [pixels].
            stamp: Time of the image [s].
            reach: Depth up to which space is freed [m].
            error: Greatest error of the pose, for the claims that follow [m].
            single: Whether one pixel in a cell is a hit. Otherwise two are needed,
                where a cell is at least two pixels wide.
            freeing: Depths by which space is freed, where they differ from those that
                hit: of the same view, with any count of rows and columns.
            clearing: Depths by which occupied cells are passed whose middle is seen,
                also where the view of them is not whole: an image of the same shape.
            source: Number of the sensor, 1 to 254, for `withdraw` and `forget`.

        Raises:
            PoseError: The transform is not rigid.
            CellMapError: An image or a number is not as above.
        """
        T = checked_pose("T_world_camera", T_world_camera)
        focals, middle = camera_of(focal, centre)
        check_frame(stamp, reach, error)
        shot = Shot(
            T[:3, :3], T[:3, 3], focals, middle, reach, depths_of(image),
            None if freeing is None else depths_of(freeing),
            None if clearing is None else depths_of(clearing),
        )  # fmt: skip
        self.take(shot, float(stamp), single=single, error=error, source=source)

    def take(
        self, shot: Shot, stamp: float, *, single: bool, error: float, source: int
    ) -> None:
        """Take a depth image as `depth` does; no argument is checked.

        Args:
            shot: The image with its camera.
            stamp: See `depth`, from here on.
            single: Whether one pixel in a cell is a hit.
            error: Greatest error of the pose [m].
            source: Number of the sensor.
        """
        hits, lines = shot.hits, self._frame.lines
        free = hits if shot.freeing is None else shot.freeing
        camera: Any = self._look.camera
        camera["axes"], camera["origin"] = shot.R.T, shot.origin
        camera["reach"] = shot.reach
        # Middles of pixels have whole numbers, so the image's corner is at -0.5.
        scale = np.array(free.shape[::-1]) / np.array(hits.shape[::-1])
        camera["focal"] = scale * shot.focal
        camera["centre"] = scale * (np.array(shot.centre) + 0.5) - 0.5
        pyramid = self._room_for(free.shape)
        fill_pyramid(free.reshape(-1), pyramid.lines)
        carve(pyramid.lines, lines)
        camera["focal"], camera["centre"] = shot.focal, shot.centre
        pyramid = self._room_for(hits.shape)
        hit_pixels(hits.reshape(-1), single, pyramid.lines, lines)
        if shot.clearing is not None:
            past = shot.clearing
            pass_occupied(len(past), past.reshape(-1), self._claims.lines, lines)
        self._settle(stamp, error, source)

    def zones(
        self, distance: ArrayLike, T_world_sensor: Pose | ArrayLike,
        view: float | tuple[float, float], stamp: float, *,
        reach: float = inf, error: float = 0.0, freeing: ArrayLike | None = None,
    ) -> None:  # fmt: skip
        """Take a frame of a sensor with a few zones, such as 8 × 8 of time of flight.

        A zone is a wide pixel: it hits the cells of its whole area at its distance, by
        points that are no farther apart than a cell. It frees a cell only if all zones
        that the cell may be in lie behind it.

        Args:
            distance: Perpendicular distances of the zones, shape (rows, columns):
                floats [m] or integers [mm]; NaN or 0 where a zone is not valid.
            T_world_sensor: Frame of the sensor in the world, as for `depth`.
            view: Angles of view along columns and rows, or one for both [rad].
            stamp: Time of the frame [s].
            reach: Distance up to which space is freed [m].
            error: Greatest error of the pose [m].
            freeing: See `depth`.

        Raises:
            PoseError: The transform is not rigid.
            CellMapError: The frame or a number is not as above.
        """
        angles = pair_of("view", view)
        if not all(0.0 < angle < np.pi for angle in angles):
            raise CellMapError(f"view is {view}; it must be within 0 and pi [rad]")
        depths = depths_of(distance)
        rows, columns = depths.shape
        focal = (0.5 * columns / tan(angles[0] / 2), 0.5 * rows / tan(angles[1] / 2))
        middle = (0.5 * (columns - 1), 0.5 * (rows - 1))
        self.depth(
            depths, T_world_sensor, focal, middle, stamp,
            reach=reach, error=error, single=True, freeing=freeing,
        )  # fmt: skip

    def points(
        self, points: ArrayLike, origin: ArrayLike, stamp: float, *,
        reach: float | ArrayLike = inf, clearing: ArrayLike | None = None,
        error: float = 0.0, source: int = NO_SENSOR,
    ) -> None:  # fmt: skip
        """Take sparse points, each with a ray from the sensor.

        A cell that a ray crosses is passed, though the ray fills little of it. Limit
        `reach` to where rays are as dense as cells, or free nothing by 0.

        Args:
            points: Measured points, world, shape (n, 3) [m]; one that is not finite is
                left out.
            origin: Place of the sensor, world, shape (3,) [m].
            stamp: Time of the points [s].
            reach: Distance from the origin up to which space is freed: one, or one for
                each ray, shape (n,) [m].
            clearing: Distance up to which each ray passes occupied cells, also beyond
                `reach`, shape (n,) [m].
            error: Greatest error of the points' frame [m].
            source: Number of the sensor, see `depth`.

        Raises:
            CellMapError: The points or a number are not as above.
        """
        rows, start = rays_of(points, origin)
        check_frame(stamp, inf, error)
        reaches = reaches_of("reach", reach, len(rows))
        if clearing is not None:
            ways = reaches_of("clearing", clearing, len(rows))
            cast_rays(rows, start, ways, self._frame.lines)
            pass_only_occupied(self._claims.lines, self._frame.lines)
        cast_rays(rows, start, reaches, self._frame.lines)
        self._settle(stamp, error, source)

    def own(
        self, placed: Iterable[tuple[Shape, Pose | ArrayLike]], *,
        error: float = 0.0, shell: float = 0.0,
    ) -> None:  # fmt: skip
        """Set the shapes of own links for the frames that follow.

        Cells surely inside them are passed by every frame: no other body is there.
        Other cells that they may touch keep what they have. Sensors decide on the rest.

        Args:
            placed: Shapes, each with its frame in the world; none to set nothing.
            error: How far a link's surface may be within its shape [m].
            shell: How far it may be outside it [m].

        Raises:
            PoseError: A transform is not rigid.
            CellMapError: A length is negative or not finite, or a shape has no end.
        """
        for name, value in (("error", error), ("shell", shell)):
            check_size(name, value, "m")
        rows = []
        for shape, pose in placed:
            if isinstance(shape, HalfSpace):
                raise CellMapError("a half-space is no link")
            rows.append((int(shape.kind), shape_row(shape, checked_pose("pose", pose))))
        self.mask((kind, row, error, shell) for kind, row in rows)

    def mask(
        self, rows: Iterable[tuple[int, Floats, float, float]],
        kept: tuple[IntVector, Words] | None = None,
    ) -> None:  # fmt: skip
        """Set own links by rows, see `own`, and cells that keep what they have.

        No argument is checked.

        Args:
            rows: Of each shape its kind, its row in the world, shape (16,), how far a
                surface may be within it, infinite where no cell is to be passed, and
                how far outside it [m].
            kept: Result of `masked` of a map of the same place and size: no cell of it
                is hit or passed.
        """
        found = list(rows)
        self.mask_near(
            np.array([kind for kind, *_ in found], dtype=np.int32),
            np.array([row for _, row, *_ in found]).reshape(-1, 16),
            np.array([slacks for _, _, *slacks in found]).reshape(-1, 2), kept,
        )  # fmt: skip

    def mask_near(
        self, kinds: IntVector, rows: Floats, slacks: Floats,
        kept: tuple[IntVector, Words] | None, middle: ArrayLike = (0, 0, 0),
        reach: float = inf,
    ) -> None:  # fmt: skip
        """As `mask`, for a frame that touches no word farther from a sensor.

        Args:
            kinds: ShapeKind of each shape, shape (n,).
            rows: Their rows in the world, shape (n, 16).
            slacks: How far the surface of each may be within and outside it, shape
                (n, 2) [m].
            kept: See `mask`.
            middle: Where the sensor is, world, shape (3,) [m].
            reach: Distance from there beyond which `kept` is left out [m].
        """
        lines = self._frame.lines
        clear_masks(lines)
        if kept is not None:
            mask_kept(*kept, np.asarray(middle, dtype=np.float64), float(reach), lines)
        mask_shapes(kinds, rows, slacks, lines)

    def masked(self) -> tuple[IntVector, Words]:
        """Words with cells of own links, in rising order, and these cells."""
        look = self._look
        notes: Any = look.notes
        words = np.sort(look.masked[: int(notes["masked"])])
        return words, look.inside[words] | look.shell[words]

    def own_cells(self) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
        """Words of the cells inside own links, and of those that they may touch."""
        return self._look.inside.copy(), self._look.shell.copy()

    def read_octomap(self, path: str | Path, stamp: float) -> None:
        """Take the leaves of a tree of OctoMap, a `.bt` file, as one frame.

        A cell that an occupied leaf meets is hit; one that free leaves fill is passed.

        Args:
            path: The file; its frame is the world.
            stamp: Time of its claims [s].

        Raises:
            CellMapError: It cannot be read, or is no such tree.
        """
        check_frame(stamp, inf, 0.0)
        hits, passes = tree_words(Path(path), self.centre, self.cell, self.size)
        look = self._look
        look.hits[:] = look.sure[:] = hits
        look.passes[:] = passes
        touched = np.flatnonzero(look.hits | look.passes)
        look.touched[: len(touched)] = touched
        notes: Any = look.notes
        notes["touched"] = len(touched)
        self._settle(stamp, 0.0)

    def _room_for(self, shape: tuple[int, int]) -> Ledger:
        """Room for an image of this shape."""
        if shape not in self._images:
            if len(self._images) == MOST_IMAGE_SIZES:
                self._images.clear()
            pyramid = empty_pyramid(*shape)
            self._images[shape] = pyramid, Ledger(pyramid)
        return self._images[shape][1]
