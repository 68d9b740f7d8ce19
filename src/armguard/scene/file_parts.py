"""Entries of a scene file to poses, shapes and surfaces."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from armguard.geometry.pose import Pose
from armguard.geometry.shapes import (
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    PlacedShape,
    Shape,
    Sphere,
)
from armguard.robot.packages import find_in
from armguard.scene.file_models import ObjectModel, PoseModel
from armguard.scene.file_shapes import CapsuleModel, MeshModel, ShapeKeys, SizedBox
from armguard.scene.meshes import Progress, Surface, mesh_parts

Part = PlacedShape | Surface


@dataclass(frozen=True, slots=True)
class Place:
    """Where the files of a scene may be.

    Attributes:
        folder: The scene file's folder; relative paths count from there.
        packages: Folders the scene file declares, by name.
    """

    folder: Path
    packages: Mapping[str, Path]


def triple(values: list[float]) -> tuple[float, float, float]:
    """Three numbers as a tuple."""
    x, y, z = values
    return (x, y, z)


def pose_of(model: PoseModel) -> Pose:
    """A pose of the file."""
    xyz = triple(model.xyz)
    if model.quat_wxyz is not None:
        return Pose.from_quat_wxyz(model.quat_wxyz, xyz)
    if model.quat_xyzw is not None:
        x, y, z, w = model.quat_xyzw
        return Pose.from_quat_wxyz((w, x, y, z), xyz)
    return Pose(xyz=xyz, rpy=triple(model.rpy or [0.0, 0.0, 0.0]))


def object_parts(
    model: ObjectModel, place: Place, progress: Progress | None
) -> list[Part]:
    """Parts of an object, in its own frame.

    Args:
        model: The entry.
        place: Where meshes may be.
        progress: Called with what is done, its number and their count.

    Raises:
        ShapeError: A shape cannot be what the file says.
        MeshError: A mesh cannot be read.
    """
    if model.union is not None:
        return [
            part
            for entry in model.union
            for part in parts_of(entry, pose_of(entry.at), place, progress)
        ]
    return parts_of(model, Pose(), place, progress)


def parts_of(
    model: ShapeKeys, pose: Pose, place: Place, progress: Progress | None
) -> list[Part]:
    """Parts of one entry whose frame stands at a pose in the object."""
    if model.mesh is not None:
        return mesh_of(model.mesh, pose, place, progress)
    if model.hull is not None and model.hull.mesh is not None:
        mesh = MeshModel.model_validate(
            {
                "file": model.hull.mesh,
                "scale": model.hull.scale or 1.0,
                "as": "hull",
                "rounding": model.hull.rounding,
            }
        )
        return mesh_of(mesh, pose, place, progress)
    return [PlacedShape(shape_of(model), pose)]


def mesh_of(
    model: MeshModel, pose: Pose, place: Place, progress: Progress | None
) -> list[Part]:
    """Parts of a mesh."""
    return mesh_parts(
        find_in(model.file, place.folder, place.packages),
        form=model.form,
        pose=pose,
        scale=model.scale,
        rounding=model.rounding,
        max_triangles=model.max_triangles,
        concavity=model.concavity,
        max_pieces=model.max_pieces,
        progress=progress,
    )


def shape_of(model: ShapeKeys) -> Shape:
    """The shape of an entry that is no mesh."""
    if model.sphere is not None:
        return Sphere(radius=model.sphere.radius, rounding=model.sphere.rounding)
    if model.capsule is not None:
        return capsule_of(model.capsule)
    if model.box is not None:
        box = model.box
        size, rounding = (
            (box.size, box.rounding) if isinstance(box, SizedBox) else (box, 0.0)
        )
        x, y, z = size
        return Box(half_extents=(x / 2, y / 2, z / 2), rounding=rounding)
    if model.cylinder is not None:
        return Cylinder(
            radius=model.cylinder.radius,
            height=model.cylinder.height or model.cylinder.length or 0.0,
            rounding=model.cylinder.rounding,
        )
    if model.cone is not None:
        return Cone(
            radius=model.cone.radius,
            height=model.cone.height,
            top_radius=model.cone.top_radius,
            rounding=model.cone.rounding,
        )
    if model.ellipsoid is not None:
        return Ellipsoid(
            semi_axes=triple(model.ellipsoid.semi_axes),
            rounding=model.ellipsoid.rounding,
        )
    if model.hull is not None:
        return Hull(points=model.hull.points or [], rounding=model.hull.rounding)
    plane = model.half_space or model.plane
    assert plane is not None, "the grammar allows no entry without a shape"
    return HalfSpace(rounding=plane.rounding)


def capsule_of(model: CapsuleModel) -> Capsule:
    """A capsule by its ends, or along z by its length."""
    half = (model.length or 0.0) / 2
    return Capsule(
        start=triple(model.start or [0.0, 0.0, -half]),
        end=triple(model.end or [0.0, 0.0, half]),
        radius=model.radius,
        rounding=model.rounding,
    )
