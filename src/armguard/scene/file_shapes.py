"""Poses and shapes in the scene file's grammar, and what they are in a scene."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, ClassVar, Self

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

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
from armguard.scene.meshes import MeshForm, Progress, Surface, mesh_parts
from armguard.scene.meshes.pieces import CONCAVITIES, CONCAVITY
from armguard.scene.meshes.source import MAX_TRIANGLES, MAX_TRIANGLES_OF_FILE
from armguard.scene.schema import (
    CLOSED,
    Angles,
    ByForm,
    Name,
    NotNegative,
    Positive,
    PositiveTriple,
    Quaternion,
    Strict,
    Triple,
)


@dataclass(frozen=True, slots=True)
class Place:
    """Where the files of a scene may be.

    Attributes:
        folder: The scene file's folder; relative paths count from there.
        packages: Folders the scene file declares, by name.
        reads: Whether meshes are read; if not, a point takes the place of each.
    """

    folder: Path
    packages: Mapping[str, Path]
    reads: bool = True


class PoseModel(Strict):
    """A frame: `xyz`, and one way to give the orientation."""

    xyz: Triple = (0.0, 0.0, 0.0)
    rpy: Angles | None = None
    quat_wxyz: Quaternion | None = None
    quat_xyzw: Quaternion | None = None

    @model_validator(mode="after")
    def _is_a_pose(self) -> Self:
        self.pose()
        return self

    def pose(self) -> Pose:
        """The pose; `Pose` checks the orientation."""
        return Pose(**self.model_dump())


ORIGIN = PoseModel()

# Takes the place of a mesh that is not read.
UNREAD = Sphere(radius=1e-6)


class Rounded(Strict):
    """A shape that may be grown outwards [m]."""

    made: ClassVar[Callable[..., Shape]]
    rounding: NotNegative = 0.0

    def shape(self) -> Shape:
        """The shape, by default that of the same attributes."""
        return self.made(**self.model_dump(exclude_none=True))


class SphereModel(Rounded):
    """`sphere: {radius: 0.1}`."""

    made = Sphere
    radius: Positive


class CapsuleModel(Rounded):
    """`capsule: {from: [..], to: [..], radius: r}` or `{length: l, radius: r}`."""

    start: Triple | None = Field(None, alias="from")
    end: Triple | None = Field(None, alias="to")
    length: NotNegative | None = None
    radius: Positive

    @model_validator(mode="after")
    def _one_axis(self) -> Self:
        given = [x is not None for x in (self.start, self.end, self.length)]
        if given not in ([True, True, False], [False, False, True]):
            raise ValueError("needs `from` and `to`, or `length` along z, not both")
        return self

    def shape(self) -> Shape:
        """The shape, by its ends, or along z by its length."""
        half = (self.length or 0.0) / 2
        return Capsule(
            start=self.start or (0.0, 0.0, -half),
            end=self.end or (0.0, 0.0, half),
            radius=self.radius,
            rounding=self.rounding,
        )


class BoxModel(Rounded):
    """`box: {size: [x, y, z], rounding: r}` or `box: [x, y, z]`."""

    made = Box
    size: PositiveTriple


class CylinderModel(Rounded):
    """`cylinder: {radius: r, height: h}`; `length` is another word for height."""

    radius: Positive
    height: Positive | None = None
    length: Positive | None = None

    @model_validator(mode="after")
    def _one_height(self) -> Self:
        if (self.height is None) == (self.length is None):
            raise ValueError("needs `height`, or `length`, its other name, not both")
        return self

    def shape(self) -> Shape:
        """The shape; one of height and length is given."""
        height = self.height or self.length or 0.0
        return Cylinder(radius=self.radius, height=height, rounding=self.rounding)


class ConeModel(Rounded):
    """`cone: {radius: r, height: h, top_radius: t}`; with a top radius, truncated."""

    made = Cone
    radius: Positive
    height: Positive
    top_radius: NotNegative = 0.0


class EllipsoidModel(Rounded):
    """`ellipsoid: {semi_axes: [a, b, c]}`."""

    made = Ellipsoid
    semi_axes: PositiveTriple


class HalfSpaceModel(Rounded):
    """`half_space: {}` or `plane: {}`: the frame's z points out of the solid."""

    made = HalfSpace


def not_zero(values: tuple[float, ...]) -> tuple[float, ...]:
    """Refuse a factor of zero."""
    if 0.0 in values:
        raise ValueError(f"is {list(values)}; a mesh cannot be scaled by 0")
    return values


# Factors of the three axes, or one for all of them.
Scale = Annotated[
    Triple,
    BeforeValidator(
        lambda value: value if isinstance(value, list | tuple) else [value] * 3,
        json_schema_input_type=float | Triple,
    ),
    AfterValidator(not_zero),
]


class MeshModel(Rounded):
    """`mesh: {file: FILE, scale: s, as: triangles | hull | pieces}`."""

    file: Name
    scale: Scale = (1.0, 1.0, 1.0)
    form: MeshForm = Field("triangles", alias="as")
    max_triangles: Annotated[int, Field(ge=1, le=MAX_TRIANGLES)] = MAX_TRIANGLES_OF_FILE
    concavity: Annotated[
        float, Field(allow_inf_nan=False, ge=CONCAVITIES[0], le=CONCAVITIES[1])
    ] = CONCAVITY
    max_pieces: Annotated[int, Field(ge=1)] | None = None

    @model_validator(mode="after")
    def _settings_of_pieces(self) -> Self:
        for key in ("concavity", "max_pieces"):
            if key in self.model_fields_set and self.form != "pieces":
                raise ValueError(f"has `{key}`, which is for `as: pieces`")
        return self

    def parts(
        self, pose: Pose, place: Place, progress: Progress | None
    ) -> list[Surface | PlacedShape]:
        """Parts of the mesh."""
        settings = self.model_dump()
        file = find_in(settings.pop("file"), place.folder, place.packages)
        if not place.reads:
            return [PlacedShape(UNREAD, pose)]
        return mesh_parts(file, pose=pose, progress=progress, **settings)


class HullModel(Rounded):
    """`hull: {points: [[x, y, z], ...]}` or `hull: {mesh: FILE, scale: s}`."""

    made = Hull
    points: Annotated[list[Triple], Field(min_length=1)] | None = None
    mesh: Name | None = None
    scale: Scale | None = None

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.points is None) == (self.mesh is None):
            raise ValueError("needs `points` or `mesh`, not both")
        if self.scale is not None and self.mesh is None:
            raise ValueError("has `scale`, which is that of a mesh; leave it out")
        return self


@dataclass(frozen=True, kw_only=True)
class ShapeKeys:
    """One key for each shape."""

    __pydantic_config__ = CLOSED

    sphere: SphereModel | None = None
    capsule: CapsuleModel | None = None
    box: ByForm[PositiveTriple, BoxModel] | None = None
    cylinder: CylinderModel | None = None
    cone: ConeModel | None = None
    ellipsoid: EllipsoidModel | None = None
    half_space: HalfSpaceModel | None = None
    plane: HalfSpaceModel | None = None
    hull: HullModel | None = None
    mesh: MeshModel | None = None

    def check_one(self, *others: str) -> None:
        """Refuse none or several of the shapes and other keys."""
        kinds = (*SHAPE_KEYS, *others)
        given = [kind for kind in kinds if getattr(self, kind) is not None]
        if len(given) != 1:
            has = " and ".join(given) if given else "no shape"
            raise ValueError(f"has {has}; give exactly one of {', '.join(kinds)}")

    def parts(
        self, pose: Pose, place: Place, progress: Progress | None
    ) -> list[Surface | PlacedShape]:
        """Parts of the shape whose frame is at a pose in the object.

        Args:
            pose: The pose.
            place: Where meshes may be.
            progress: Called with the step, its number and their count.

        Raises:
            ShapeError: A shape cannot be what the file says.
            MeshError: A mesh cannot be read.
        """
        mesh, hull = self.mesh, self.hull
        if hull is not None and hull.mesh is not None:
            mesh = MeshModel.model_validate(
                {"file": hull.mesh, "as": "hull", "rounding": hull.rounding}
                | ({} if hull.scale is None else {"scale": hull.scale})
            )
        if mesh is not None:
            return mesh.parts(pose, place, progress)
        (model,) = filter(None, (getattr(self, key) for key in SHAPE_KEYS))
        if isinstance(model, tuple):
            model = BoxModel(size=model)
        return [PlacedShape(model.shape(), pose)]


SHAPE_KEYS = tuple(field.name for field in fields(ShapeKeys))


@dataclass(frozen=True, kw_only=True)
class ShapeModel(ShapeKeys):
    """Exactly one shape, and its pose."""

    at: PoseModel = ORIGIN

    @model_validator(mode="after")
    def _one_shape(self) -> Self:
        self.check_one()
        return self
