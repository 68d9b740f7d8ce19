"""The forms a mesh may take in a scene."""

from collections.abc import Sequence
from math import isfinite
from typing import Literal, get_args

from armguard.errors import MeshError
from armguard.geometry.pose import Pose
from armguard.geometry.shapes import PlacedShape
from armguard.scene.meshes.pieces import CONCAVITY, convex_pieces, mesh_hull
from armguard.scene.meshes.source import (
    MAX_TRIANGLES,
    MeshInput,
    Progress,
    open_mesh,
)
from armguard.scene.meshes.surface import Surface

MeshForm = Literal["triangles", "hull", "pieces"]


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
        progress: Called with what is done, its number and their count.

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
