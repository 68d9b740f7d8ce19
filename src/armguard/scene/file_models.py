"""The scene file's grammar: what keys there are, and what they hold."""

from math import pi
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, Discriminator, Field, Tag, model_validator

from armguard.scene.file_numbers import (
    NotNegative,
    Number,
    Positive,
    Quaternion,
    Strict,
    Triple,
)
from armguard.scene.file_shapes import SHAPE_KEYS, ShapeKeys
from armguard.scene.file_stopping import StoppingModel
from armguard.scene.settings import FarStart, Mode, ResponseName, Sharing

# More than two turns is no orientation anyone writes in radians [rad].
LOOKS_LIKE_DEGREES = 4 * pi

# Most robots and objects of a scene file.
MOST_ROBOTS = 64
MOST_OBJECTS = 5_000


class PoseModel(Strict):
    """Where a frame stands: `xyz`, and one way to say the orientation."""

    xyz: Triple = Field(default=[0.0, 0.0, 0.0])
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


class ShapeModel(ShapeKeys):
    """Exactly one shape, and where it stands."""

    at: PoseModel = PoseModel()

    @model_validator(mode="after")
    def _one_shape(self) -> Self:
        check_one(self, SHAPE_KEYS)
        return self


class GraspModel(Strict):
    """How an object may be gripped."""

    near: Positive = 0.1
    intent_speed: Positive = 0.1
    creep: Positive = 0.02
    depth: NotNegative = 0.002
    aim: NotNegative = 0.01
    touch: NotNegative = 0.005
    lift: NotNegative = 0.010
    expiry: Positive = 30.0


class GripperModel(Strict):
    """A robot's gripper."""

    link: str
    fingers: Annotated[list[str], Field(min_length=1)]
    coarse: bool = True
    swap: NotNegative = 0.05


def flag_or_settings(value: Any) -> str:
    """Which branch of `graspable` a value is meant for."""
    settings = isinstance(value, dict | GraspModel)
    return "constrained-grasp" if settings else "constrained-flag"


GraspableEntry = Annotated[
    Annotated[bool, Tag("constrained-flag")]
    | Annotated[GraspModel, Tag("constrained-grasp")],
    Discriminator(flag_or_settings),
]


class ObjectModel(ShapeKeys):
    """Exactly one shape or a union of several."""

    union: Annotated[list[ShapeModel], Field(min_length=1)] | None = None
    at: PoseModel = PoseModel()
    attached_to: str | None = None
    buffer: NotNegative | None = None
    present: bool = True
    top_speed: NotNegative = 0.0
    error: NotNegative = 0.0
    stale: Positive | None = None
    person: bool = False
    graspable: GraspableEntry = False
    rests_on: str | list[str] | None = None

    @model_validator(mode="after")
    def _one_shape(self) -> Self:
        check_one(self, (*SHAPE_KEYS, "union"))
        return self


def check_one(model: BaseModel, kinds: tuple[str, ...]) -> None:
    """Exactly one of several keys is given."""
    given = [kind for kind in kinds if getattr(model, kind) is not None]
    if len(given) != 1:
        has = " and ".join(given) if given else "no shape"
        raise ValueError(f"has {has}; give exactly one of {', '.join(kinds)}")


class ResponseModel(Strict):
    """What a robot does about what is near."""

    kind: ResponseName = "deflect"
    sharing: Sharing = "contribution"
    priority: Number = 0.0
    recover_speed: Positive = 0.1
    resume_speed: Positive = 0.1
    far: Positive = 0.2
    far_start: FarStart = "ramp"
    evade: bool = False
    evade_speed: Positive = 0.5
    evade_time: Positive = 1.0
    field_speed: Positive = 0.3
    attraction: Positive = 5.0
    repulsion: Positive = 0.08
    influence: Positive = 0.1
    patience: Positive = 1.5


def name_or_settings(value: Any) -> str:
    """Which branch of `response` a value is meant for."""
    settings = isinstance(value, dict | ResponseModel)
    return "constrained-settings" if settings else "constrained-name"


ResponseByKind = Annotated[
    Annotated[ResponseName, Tag("constrained-name")]
    | Annotated[ResponseModel, Tag("constrained-settings")],
    Discriminator(name_or_settings),
]


class RobotEntry(Strict):
    """A robot of the scene."""

    urdf: str
    srdf: str | None = None
    base: PoseModel = PoseModel()
    buffer: NotNegative | None = None
    mode: Mode | None = None
    stopping: StoppingModel | None = None
    response: ResponseByKind = "deflect"
    gripper: GripperModel | None = None
    fit_target: Positive = 0.030
    max_primitives: Annotated[int, Field(ge=1, le=64)] = 8
    home: dict[str, Number] = Field(default={})
    packages: dict[str, str] = Field(default={})


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


class CycleModel(Strict):
    """When the guard is called."""

    period: Positive = 0.001
    late: NotNegative = 0.0


class SceneModel(Strict):
    """The whole file."""

    robots: Annotated[
        dict[str, RobotEntry], Field(min_length=1, max_length=MOST_ROBOTS)
    ]
    objects: Annotated[dict[str, ObjectModel], Field(max_length=MOST_OBJECTS)] = Field(
        default={}
    )
    packages: dict[str, str] = Field(default={})
    mode: Mode = "path"
    cycle: CycleModel = CycleModel()
    buffer: NotNegative | None = None
    margin: NotNegative | None = None
    allow: list[AllowEntry] = Field(default=[])
    buffers: list[BufferEntry] = Field(default=[])
    index: IndexModel = IndexModel()
