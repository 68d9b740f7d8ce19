"""Shapes in the scene file's grammar."""

from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from armguard.scene.file_numbers import (
    NotNegative,
    Positive,
    PositiveTriple,
    Strict,
    Triple,
)
from armguard.scene.meshes.pieces import CONCAVITIES, CONCAVITY
from armguard.scene.meshes.source import MAX_TRIANGLES, MAX_TRIANGLES_OF_FILE


class SphereModel(Strict):
    """`sphere: {radius: 0.1}`."""

    radius: Positive
    rounding: NotNegative = 0.0


class CapsuleModel(Strict):
    """`capsule: {from: [..], to: [..], radius: r}` or `{length: l, radius: r}`."""

    start: Triple | None = Field(None, alias="from")
    end: Triple | None = Field(None, alias="to")
    length: NotNegative | None = None
    radius: Positive
    rounding: NotNegative = 0.0

    @model_validator(mode="after")
    def _one_axis(self) -> Self:
        ends = self.start is not None and self.end is not None
        either = self.start is not None or self.end is not None
        if (ends and self.length is None) or (not either and self.length is not None):
            return self
        raise ValueError("needs `from` and `to`, or `length` along z, not both")


class SizedBox(Strict):
    """`box: {size: [x, y, z], rounding: r}`."""

    size: PositiveTriple
    rounding: NotNegative = 0.0


class CylinderModel(Strict):
    """`cylinder: {radius: r, height: h}`; `length` is another word for height."""

    radius: Positive
    height: Positive | None = None
    length: Positive | None = None
    rounding: NotNegative = 0.0

    @model_validator(mode="after")
    def _one_height(self) -> Self:
        if (self.height is None) == (self.length is None):
            raise ValueError("needs `height`, or `length`, its other name, not both")
        return self


class ConeModel(Strict):
    """`cone: {radius: r, height: h, top_radius: t}`; with a top radius, truncated."""

    radius: Positive
    height: Positive
    top_radius: NotNegative = 0.0
    rounding: NotNegative = 0.0


class EllipsoidModel(Strict):
    """`ellipsoid: {semi_axes: [a, b, c]}`."""

    semi_axes: PositiveTriple
    rounding: NotNegative = 0.0


class HalfSpaceModel(Strict):
    """`half_space: {}` or `plane: {}`: the frame's z points out of the solid."""

    rounding: NotNegative = 0.0


def as_triple(value: Any) -> Any:
    """One factor for all axes, as three."""
    return value if isinstance(value, list) else [value] * 3


def not_zero(values: list[float]) -> list[float]:
    """Refuse a factor of zero."""
    if 0.0 in values:
        raise ValueError(f"is {values}; a mesh cannot be scaled by 0")
    return values


Scale = Annotated[Triple, BeforeValidator(as_triple), AfterValidator(not_zero)]
Concavity = Annotated[
    float, Field(allow_inf_nan=False, ge=CONCAVITIES[0], le=CONCAVITIES[1])
]
File = Annotated[str, Field(min_length=1)]


class HullModel(Strict):
    """`hull: {points: [[x, y, z], ...]}` or `hull: {mesh: FILE, scale: s}`."""

    points: Annotated[list[Triple], Field(min_length=1)] | None = None
    mesh: File | None = None
    scale: Scale | None = None
    rounding: NotNegative = 0.0

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.points is None) == (self.mesh is None):
            raise ValueError("needs `points` or `mesh`, not both")
        if self.scale is not None and self.mesh is None:
            raise ValueError("has `scale`, which is that of a mesh; leave it out")
        return self


class MeshModel(Strict):
    """`mesh: {file: FILE, scale: s, as: triangles | hull | pieces}`."""

    file: File
    scale: Scale = Field(default=[1.0, 1.0, 1.0])
    form: Literal["triangles", "hull", "pieces"] = Field("triangles", alias="as")
    rounding: NotNegative = 0.0
    max_triangles: Annotated[int, Field(ge=1, le=MAX_TRIANGLES)] = MAX_TRIANGLES_OF_FILE
    concavity: Concavity = CONCAVITY
    max_pieces: Annotated[int, Field(ge=1)] | None = None

    @model_validator(mode="after")
    def _settings_of_pieces(self) -> Self:
        for key in ("concavity", "max_pieces"):
            if key in self.model_fields_set and self.form != "pieces":
                raise ValueError(f"has `{key}`, which is for `as: pieces`")
        return self


class ShapeKeys(Strict):
    """One key for each shape."""

    sphere: SphereModel | None = None
    capsule: CapsuleModel | None = None
    box: PositiveTriple | SizedBox | None = None
    cylinder: CylinderModel | None = None
    cone: ConeModel | None = None
    ellipsoid: EllipsoidModel | None = None
    half_space: HalfSpaceModel | None = None
    plane: HalfSpaceModel | None = None
    hull: HullModel | None = None
    mesh: MeshModel | None = None


SHAPE_KEYS = tuple(ShapeKeys.model_fields)
