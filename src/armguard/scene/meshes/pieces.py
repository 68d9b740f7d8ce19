"""The forms of a mesh in a scene: its triangles, its convex hull, convex pieces."""

from collections.abc import Sequence
from math import isfinite
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from armguard.errors import MeshError
from armguard.geometry.pose import Pose
from armguard.geometry.shapes import Hull, PlacedShape
from armguard.scene.meshes.cutting import coacd_version, cut_into_pieces
from armguard.scene.meshes.enclosure import growths, overreach
from armguard.scene.meshes.source import (
    MAX_TRIANGLES,
    MeshInput,
    Progress,
    TriangleSource,
    open_mesh,
)
from armguard.scene.meshes.store import Piece, piece_key, read_pieces, write_pieces
from armguard.scene.meshes.surface import Surface

Floats = NDArray[np.float64]

MeshForm = Literal["triangles", "hull", "pieces"]

# How deep a hollow a piece may close, in the measure of coacd: a share of the mesh's
# size [-].
CONCAVITY = 0.05

# coacd takes thresholds in this range [-].
CONCAVITIES = (0.01, 1.0)

# Below this share of their extent, points count as lying in a plane [-].
FLAT = 1e-9


def mesh_parts(
    mesh: MeshInput,
    *,
    form: MeshForm = "triangles",
    pose: Pose | None = None,
    scale: float | Sequence[float] = 1.0,
    rounding: float = 0.0,
    max_triangles: int = MAX_TRIANGLES,
    concavity: float = CONCAVITY,
    max_pieces: int | None = None,
    progress: Progress | None = None,
) -> list[Surface | PlacedShape]:
    """A mesh as parts of an object; see `Scene.add_mesh`.

    Args:
        mesh: A file, or vertices and faces.
        form: "triangles", "hull" or "pieces".
        pose: Frame of the mesh in the object's.
        scale: Factor to metres, or one for each axis [-].
        rounding: Growth outwards on all sides [m].
        max_triangles: More than this many are refused.
        concavity: See `convex_pieces`.
        max_pieces: See `convex_pieces`.
        progress: Called with the step, its number and their count.

    Raises:
        MeshError: The mesh cannot be read, or not be brought into this form.
    """
    if form not in get_args(MeshForm):
        raise MeshError(
            f"a mesh cannot be {form!r}; it can be 'triangles', 'hull' or 'pieces'"
        )
    source = open_mesh(mesh, scale=scale, max_triangles=max_triangles)
    if not (isfinite(rounding) and rounding >= 0.0):
        raise MeshError(
            f"mesh '{source.name}' rounding is {rounding} m; it must be finite and >= 0"
        )
    if form == "triangles":
        return [Surface.read(source, pose=pose, rounding=rounding, progress=progress)]
    if form == "hull":
        shapes = mesh_hull(source, rounding=rounding, progress=progress)
    else:
        shapes = convex_pieces(
            source,
            concavity=concavity,
            max_pieces=max_pieces,
            rounding=rounding,
            progress=progress,
        )
    place = Pose() if pose is None else pose
    return [PlacedShape(s.shape, place, s.model_error) for s in shapes]


def mesh_hull(
    mesh: MeshInput | TriangleSource,
    *,
    rounding: float = 0.0,
    progress: Progress | None = None,
) -> tuple[PlacedShape, ...]:
    """The convex hull of a mesh; its model error is how far it closes hollows.

    Flat meshes have flat hulls, which are legal.

    Args:
        mesh: A file, vertices and faces, or an open mesh.
        rounding: Growth outwards [m].
        progress: Called with the step, its number and their count.

    Raises:
        MeshError: The mesh cannot be read.
    """
    source = opened(mesh)
    triangles = source.triangles(progress)
    key = piece_key(triangles, ("hull",))
    pieces = read_pieces(key)
    if pieces is None:
        if progress is not None:
            progress(f"measuring the hull of {source.name}", 1, 1)
        pieces = enclosed(triangles, [triangles.reshape(-1, 3)])
        write_pieces(key, pieces)
    return as_shapes(pieces, rounding)


def convex_pieces(
    mesh: MeshInput | TriangleSource,
    *,
    concavity: float = CONCAVITY,
    max_pieces: int | None = None,
    rounding: float = 0.0,
    progress: Progress | None = None,
) -> tuple[PlacedShape, ...]:
    """Convex hulls whose union follows a mesh.

    The mesh is cut by coacd, always in the same way, which takes seconds to minutes
    and is kept on disk. Each piece is grown until every vertex of the mesh lies in
    one. What the mesh encloses is solid; a mesh with holes is closed, and its walls
    become thicker. Both show in the model errors: how far a piece reaches beyond the
    mesh's triangles, measured on a grid of a hundredth of the mesh's size.

    Args:
        mesh: A file, vertices and faces, or an open mesh.
        concavity: How deep a hollow a piece may close, as a share of the mesh's size,
            0.01 to 1; the smaller the more pieces [-].
        max_pieces: Pieces to stay below, whatever they close; None for as many as it
            takes.
        rounding: Growth outwards, beyond that growth [m].
        progress: Called with the step, its number and their count.

    Raises:
        MeshError: The mesh cannot be read, is flat, or coacd cannot cut it or is not
            installed.
    """
    low, high = CONCAVITIES
    if not (isfinite(concavity) and low <= concavity <= high):
        raise MeshError(
            f"concavity is {concavity}; it must be from {low} to {high:g}, a share of "
            "the mesh's size"
        )
    if max_pieces is not None and max_pieces < 1:
        raise MeshError(f"max_pieces is {max_pieces}; it must be at least 1")
    source = opened(mesh)
    triangles = source.triangles(progress)
    check_volume(source.name, triangles)
    key = piece_key(triangles, ("pieces", concavity, max_pieces, coacd_version()))
    pieces = read_pieces(key)
    if pieces is None:
        if progress is not None:
            progress(f"cutting {source.name} into convex pieces", 1, 1)
        cut = cut_into_pieces(source.name, triangles, concavity, max_pieces)
        pieces = enclosed(triangles, cut)
        write_pieces(key, pieces)
    return as_shapes(pieces, rounding)


def opened(mesh: MeshInput | TriangleSource) -> TriangleSource:
    """A mesh ready to be read."""
    return mesh if isinstance(mesh, TriangleSource) else open_mesh(mesh)


def check_volume(name: str, triangles: Floats) -> None:
    """Refuse a mesh that lies in a plane, a line or a point.

    Raises:
        MeshError: It does.
    """
    points = triangles.reshape(-1, 3)
    centred = points - points.mean(axis=0)
    extent = np.linalg.svd(centred, compute_uv=False)
    if not extent[-1] > FLAT * extent[0]:
        raise MeshError(
            f"mesh '{name}' has no volume: it is flat, so there is nothing to cut; "
            "give it as 'hull' or as 'triangles'"
        )


def enclosed(triangles: Floats, pieces: Sequence[Floats]) -> tuple[Piece, ...]:
    """Pieces with the growth that makes them hold all vertices, and their overreach.

    Args:
        triangles: Corners of the mesh, shape (n, 3, 3) [m].
        pieces: Points of each piece, shape (k, 3) [m].
    """
    hulls = [Hull(points=points) for points in pieces]
    grown = growths(triangles, hulls)
    beyond = overreach(triangles, hulls, grown)
    return tuple(
        Piece(hull.vertices, growth, reach)
        for hull, growth, reach in zip(hulls, grown, beyond, strict=True)
    )


def as_shapes(pieces: Sequence[Piece], rounding: float) -> tuple[PlacedShape, ...]:
    """Pieces as shapes of a scene."""
    return tuple(
        PlacedShape(
            Hull(points=piece.points, rounding=piece.growth + rounding),
            model_error=piece.overreach,
        )
        for piece in pieces
    )
