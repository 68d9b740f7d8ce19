"""The scene file's grammar: what keys there are, and what they hold."""

from math import pi
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

# More than two turns is no orientation anyone writes in radians [rad].
LOOKS_LIKE_DEGREES = 4 * pi

Number = Annotated[float, Field(allow_inf_nan=False, strict=False)]
Positive = Annotated[float, Field(allow_inf_nan=False, gt=0.0)]
NotNegative = Annotated[float, Field(allow_inf_nan=False, ge=0.0)]
Triple = Annotated[list[Number], Field(min_length=3, max_length=3)]
PositiveTriple = Annotated[list[Positive], Field(min_length=3, max_length=3)]
Quaternion = Annotated[list[Number], Field(min_length=4, max_length=4)]


class Strict(BaseModel):
    """A mapping without unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class PoseModel(Strict):
    """Where a frame stands: `xyz`, and one way to say the orientation."""

    xyz: Triple = [0.0, 0.0, 0.0]
    rpy: Triple | None = None
    quat_wxyz: Quaternion | None = None
    quat_xyzw: Quaternion | None = None

    @model_validator(mode="after")
    def _one_orientation(self) -> Self:
        given = [
            key
            for key in ("rpy", "quat_wxyz", "quat_xyzw")
            if getattr(self, key) is not None
        ]
        if len(given) > 1:
            raise ValueError(f"has {' and '.join(given)}; give one orientation")
        for key in ("quat_wxyz", "quat_xyzw"):
            quat = getattr(self, key)
            if quat is not None:
                norm = sum(v * v for v in quat) ** 0.5
                if abs(norm - 1.0) > 1e-3:
                    raise ValueError(f"{key} has norm {norm:.4g}; it must be 1")
        if self.rpy is not None and max(map(abs, self.rpy)) > LOOKS_LIKE_DEGREES:
            raise ValueError(f"rpy {self.rpy} looks like degrees; give radians")
        return self


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
    """`cylinder: {radius: r, length: l}`, enclosed by primitives."""

    radius: Positive
    length: Positive


class ShapeModel(Strict):
    """Exactly one shape, and where it stands."""

    sphere: SphereModel | None = None
    capsule: CapsuleModel | None = None
    box: PositiveTriple | SizedBox | None = None
    cylinder: CylinderModel | None = None
    at: PoseModel = PoseModel()

    @model_validator(mode="after")
    def _one_shape(self) -> Self:
        kinds = ("sphere", "capsule", "box", "cylinder")
        check_one(self, kinds)
        return self


class ObjectModel(Strict):
    """Exactly one shape or a union of several."""

    sphere: SphereModel | None = None
    capsule: CapsuleModel | None = None
    box: PositiveTriple | SizedBox | None = None
    cylinder: CylinderModel | None = None
    union: Annotated[list[ShapeModel], Field(min_length=1)] | None = None
    at: PoseModel = PoseModel()
    attached_to: str | None = None
    buffer: NotNegative | None = None

    @model_validator(mode="after")
    def _one_shape(self) -> Self:
        check_one(self, ("sphere", "capsule", "box", "cylinder", "union"))
        return self


def check_one(model: BaseModel, kinds: tuple[str, ...]) -> None:
    """Exactly one of several keys is given."""
    given = [kind for kind in kinds if getattr(model, kind) is not None]
    if len(given) != 1:
        has = " and ".join(given) if given else "no shape"
        raise ValueError(f"has {has}; give exactly one of {', '.join(kinds)}")


class RobotEntry(Strict):
    """A robot of the scene."""

    urdf: str
    srdf: str | None = None
    base: PoseModel = PoseModel()
    buffer: NotNegative | None = None
    fit_target: Positive = 0.030
    max_primitives: Annotated[int, Field(ge=1, le=64)] = 8
    home: dict[str, Number] = {}
    packages: dict[str, str] = {}


class AllowEntry(Strict):
    """A pair that may touch."""

    a: str
    b: str
    reason: Annotated[str, Field(min_length=1)]


class BufferEntry(Strict):
    """The distance of a pair."""

    a: str
    b: str
    buffer: NotNegative


class CubeModel(Strict):
    """The octree's root cube."""

    centre: Triple
    edge: Positive


class IndexModel(Strict):
    """How near pairs are found."""

    kind: Literal["octree", "brute_force"] = "octree"
    leaf_capacity: Annotated[int, Field(ge=1)] = 5
    max_depth: Annotated[int, Field(ge=0, le=10)] | None = None
    cube: CubeModel | None = None


class SceneModel(Strict):
    """The whole file."""

    robots: Annotated[dict[str, RobotEntry], Field(min_length=1)]
    objects: dict[str, ObjectModel] = {}
    buffer: NotNegative | None = None
    margin: NotNegative | None = None
    allow: list[AllowEntry] = []
    buffers: list[BufferEntry] = []
    index: IndexModel = IndexModel()
