"""Settings of a scene, of its robots and of its objects, each declared here alone."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import Annotated, Any, Literal, TypedDict, get_args

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo

from armguard.scene.gripping import Grasp, Gripper
from armguard.scene.schema import (
    BRIEF,
    CLOSED,
    METRES,
    SECONDS,
    SPEED,
    NotNegative,
    Number,
    Positive,
    Triple,
    at_most,
)

# How the distance a robot must keep is made: a number; from its stopping figures and
# its speed; from these and from where it may go while it stops.
Mode = Literal["fixed", "speed", "path"]
MODES: tuple[Mode, ...] = get_args(Mode)
DEFAULT_MODE: Mode = "path"


@dataclass(frozen=True, kw_only=True)
class CycleSettings:
    """When the guard is called.

    Attributes:
        period: Time from one cycle to the next [s].
        late: How much later than that a cycle may come [s].
    """

    __pydantic_config__ = CLOSED

    period: Annotated[Positive, SECONDS] = 0.001
    late: Annotated[NotNegative, SECONDS] = 0.0


@dataclass(frozen=True, slots=True)
class CubeSettings:
    """The octree's root cube.

    Attributes:
        centre: Its centre [m].
        edge: Its edge [m].
    """

    __pydantic_config__ = CLOSED

    centre: Triple
    edge: Positive


@dataclass(frozen=True, slots=True)
class IndexSettings:
    """Which index, and how fine.

    Attributes:
        kind: "octree"; "joint_table" for a table of joint positions; "brute_force" for
            comparison; "auto" for the octree, but in scenes of at most 256 primitives,
            in which a test of all pairs is faster.
        leaf_capacity: The paper's N: a leaf with more primitives is split.
        max_depth: Leaves at this depth are not split; chosen by the scene if None.
        cube: Root cube; chosen by the scene if None, enlarged if too small.
    """

    __pydantic_config__ = CLOSED

    kind: Literal["auto", "octree", "joint_table", "brute_force"] = "auto"
    leaf_capacity: Annotated[int, Field(ge=1)] = 5
    max_depth: Annotated[int, Field(ge=0, le=10)] | None = None
    cube: CubeSettings | None = None


# Names of the responses of a robot to near bodies, see `armguard.respond.RESPONSES`.
ResponseName = Literal["stop", "slow", "deflect", "field"]

# How what a pair of two robots has left is shared between them.
Sharing = Literal["contribution", "equal", "priority"]

# What is done with a first position far from where the robot is.
FarStart = Literal["ramp", "refuse"]


def at_most_one(value: float, info: ValidationInfo) -> float:
    """Refuse a share of more than all."""
    if value > 1.0:
        raise ValueError(f"{info.field_name} is {value}; it must be in (0, 1]")
    return value


Share = Annotated[
    Positive, AfterValidator(at_most_one), Field(json_schema_extra={"maximum": 1.0})
]


@dataclass(frozen=True, slots=True, kw_only=True)
class ResponseSettings:
    """Response of a robot to near bodies, and how its operator takes it over again.

    Attributes:
        kind: The response.
        sharing: How what a pair of two robots has left is shared.
        priority: Under "priority" the robot of the higher one is yielded to [-].
        recover_speed: Share of its top speeds during a recovery [-].
        resume_speed: The same while it catches up with commanded positions [-].
        far: Distance between a joint and its commanded position from which on it does
            not simply follow, until it is half as far [rad or m].
        far_start: Whether it catches up with a first position so far away, or is
            refused.
        evade: Whether it moves out of the way of objects that come at it, whatever its
            operator wants.
        evade_speed: Share of its top speeds it then uses at most [-].
        evade_time: It begins when an object that goes on straight would be too near in
            this time, or up to twice as early if it knows no good way out [s].
        field_speed: Share of its top speeds a field moves it at, at most [-].
        attraction: Under "field": speed towards the goal per remaining distance, near
            its end [1/s].
        repulsion: Under "field": speed at which a pair is opened that has half of
            `influence` left [m/s].
        influence: Under "field": pairs that have no more than this left at rest are
            pushed apart [m].
        patience: Under "field": a goal that has not come nearer for this time is
            reported as a local minimum [s].
    """

    __pydantic_config__ = CLOSED

    kind: ResponseName = "deflect"
    sharing: Sharing = "contribution"
    priority: Number = 0.0
    recover_speed: Share = 0.1
    resume_speed: Share = 0.1
    far: Positive = 0.2
    far_start: FarStart = "ramp"
    evade: bool = False
    evade_speed: Share = 0.5
    evade_time: Positive = 1.0
    field_speed: Share = 0.3
    attraction: Positive = 5.0
    repulsion: Positive = 0.08
    influence: Annotated[Positive, METRES] = 0.1
    patience: Positive = 1.5


# What each of these may be.
CHOICES: dict[str, tuple[str, ...]] = {
    "kind": get_args(ResponseName),
    "sharing": get_args(Sharing),
    "far_start": get_args(FarStart),
}


def by_name(value: Any) -> Any:
    """The settings of a response by its name."""
    if not isinstance(value, str):
        return value
    if value not in CHOICES["kind"]:
        known = ", ".join(map(repr, CHOICES["kind"]))
        raise ValueError(f"is {BRIEF.repr(value)}; it must be one of {known}")
    return {"kind": value}


def by_flag(value: Any) -> Any:
    """The default settings for `true`, none for `false`."""
    return (Grasp() if value else None) if isinstance(value, bool) else value


@dataclass(frozen=True, kw_only=True)
class RobotSettings:
    """How a robot is guarded.

    Attributes:
        buffer: Distance its links must keep; the scene's if None [m].
        mode: How the distance it must keep is made; the scene's mode if None.
        response: Its response to near bodies, see `Guard.filter`.
        gripper: Its gripper, see docs/gripping.md; None if it has none.
        fit_target: Overreach the fitted primitives should stay below [m].
        max_primitives: Primitives a link may be given for that.
    """

    __pydantic_config__ = CLOSED

    buffer: Annotated[NotNegative, METRES] | None = None
    mode: Mode | None = None
    response: Annotated[
        ResponseSettings,
        BeforeValidator(
            by_name, json_schema_input_type=ResponseName | ResponseSettings
        ),
    ] = ResponseSettings()
    gripper: Gripper | None = None
    fit_target: Annotated[Positive, at_most(0.5, "m")] = 0.030
    max_primitives: Annotated[int, Field(ge=1)] = 8


class FitKeys(TypedDict, total=False):
    """Settings of a robot's fits as scripts give them, see `RobotSettings`."""

    fit_target: float
    max_primitives: int


class RobotKeys(FitKeys, total=False):
    """Settings of a robot as scripts give them, see `RobotSettings`."""

    buffer: float | None
    mode: Mode | None
    response: ResponseName | ResponseSettings | Mapping[str, Any]
    gripper: Gripper | Mapping[str, Any] | None


@dataclass(frozen=True, kw_only=True)
class ObjectSettings:
    """What an object is, beside its shapes and its place.

    Attributes:
        attached_to: 'robot/link' it rides on; not for triangles.
        buffer: Distance it must keep; the scene's if None [m].
        present: Whether it is there when a guard starts; `Guard.place` puts it there
            later.
        top_speed: Greatest speed of any of its points, if it may move by itself [m/s].
        person: Whether it is a person.
        graspable: How it may be gripped, see docs/gripping.md; None if it may not.
        rests_on: Bodies a graspable object may be put down on; None for what it rests
            on when it is grasped.
        error: How far off any of its points may be seen, if it has a `top_speed` [m].
        stale: Age from which on a sighting of such an object is refused [s].
    """

    __pydantic_config__ = CLOSED

    attached_to: str | None = None
    buffer: Annotated[NotNegative, METRES] | None = None
    present: bool = True
    top_speed: Annotated[NotNegative, SPEED] = 0.0
    person: bool = False
    graspable: Annotated[
        Grasp | None,
        BeforeValidator(by_flag, json_schema_input_type=bool | Grasp | None),
    ] = None
    rests_on: Annotated[
        tuple[str, ...] | None,
        BeforeValidator(
            lambda value: (value,) if isinstance(value, str) else value,
            json_schema_input_type=str | list[str] | None,
        ),
    ] = None
    error: Annotated[NotNegative, METRES] = 0.0
    stale: Annotated[
        float,
        Field(gt=0.0),
        BeforeValidator(
            lambda value: inf if value is None else value,
            json_schema_input_type=Positive | None,
        ),
    ] = inf


class ObjectKeys(TypedDict, total=False):
    """Settings of an object as scripts give them, see `ObjectSettings`."""

    attached_to: str | None
    buffer: float | None
    present: bool
    top_speed: float
    person: bool
    graspable: Grasp | Mapping[str, Any] | bool | None
    rests_on: str | Sequence[str] | None
    error: float
    stale: float
