"""Calls between two cycles as data: their arguments, who may make them, what they do.

Messages, recordings and programs of this machine give the arguments: numbers, shapes
and regions either as JSON holds them or as `Guard` takes them. What they may be is for
the guard to judge.
"""

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, PlainSerializer, PlainValidator

from armguard.geometry.pose import Pose
from armguard.geometry.shapes import Shape
from armguard.guard.contract import Region
from armguard.respond import Guard
from armguard.station.shape_words import shape_of, words_of
from armguard.station.wire.keys import Role

Floats = NDArray[np.float64]

# Every call by its name.
CALLS: dict[str, type["Call"]] = {}


def numbers_of(value: Any) -> Floats | None:
    """Numbers as an array, a pose as its transform; None if there are none.

    Raises:
        ValueError: They are no numbers.
    """
    if isinstance(value, Pose):
        return value.matrix()
    try:
        return None if value is None else np.array(value, dtype=np.float64)
    except (TypeError, OverflowError) as error:
        raise ValueError(str(error)) from None


def shape_in(value: Any) -> Shape | None:
    """A shape, from its kind and sizes if it is told by these; None if there is none.

    Raises:
        ShapeError: There is no such kind, or it has no such sizes.
        ValueError: It is no shape.
    """
    if isinstance(value, Mapping):
        return shape_of(value)
    if value is None or isinstance(value, Shape):
        return value
    raise ValueError("it must be a kind and its sizes")


def region_in(value: Any) -> Region | None:
    """A region; None if there is none.

    Args:
        value: `half_extents`, `frame`, and `pose` as a transform, shape (4, 4), or as
            `xyz` and `rpy`.

    Raises:
        GraspError: The sizes are none.
        PoseError: The pose is none.
        ValueError: It is no region.
    """
    if value is None or isinstance(value, Region):
        return value
    try:
        words = {"frame": None, **value}
        given = {key: tuple(words[key]) for key in ("xyz", "rpy") if key in words}
        pose = Pose.from_matrix(words["pose"]) if "pose" in words else Pose(**given)
        sizes = tuple(words["half_extents"])
    except (TypeError, KeyError) as error:
        raise ValueError(f"it is no region: {error!r}") from None
    return Region(half_extents=sizes, pose=pose, frame=words["frame"])


def region_words(region: Region) -> dict[str, Any]:
    """A region as a recording holds it, with the very bits of its pose."""
    return {
        "half_extents": list(region.half_extents),
        "xyz": list(region.pose.xyz),
        "rpy": list(region.pose.rpy),
        "frame": region.frame,
    }


Numbers = Annotated[
    Floats | None,
    PlainValidator(numbers_of),
    PlainSerializer(lambda value: value.tolist(), when_used="unless-none"),
]
ShapeWords = Annotated[
    Shape | None,
    PlainValidator(shape_in),
    PlainSerializer(words_of, when_used="unless-none"),
]
RegionWords = Annotated[
    Region | None,
    PlainValidator(region_in),
    PlainSerializer(region_words, when_used="unless-none"),
]


class Call(BaseModel):
    """A call between two cycles; a class with a name is one that can be made.

    Attributes:
        call: Its name.
        right: The role it needs. From COMMAND on it needs the command itself as well.
    """

    model_config = ConfigDict(
        extra="forbid", frozen=True, strict=True, arbitrary_types_allowed=True
    )

    call: ClassVar[str]
    right: ClassVar[Role]

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        """Register it."""
        if "call" in vars(cls):
            CALLS[cls.call] = cls


class GuardCall(Call):
    """A call of the method of `Guard` that has its name and its arguments."""

    def apply(self, guard: Guard) -> None:
        """Make it.

        Raises:
            ArmguardError: See the guard's method.
        """
        getattr(guard, self.call)(**dict(self))

    @property
    def event(self) -> dict[str, Any]:
        """What a recording tells of it, ready for JSON."""
        return {"call": self.call, **self.model_dump()}


class Engage(GuardCall):
    """See `Guard.engage`."""

    call = "engage"
    right = Role.COMMAND

    name: str | None = None
    ordered: bool = True


class Grasp(GuardCall):
    """See `Guard.grasp`."""

    call = "grasp"
    right = Role.COMMAND

    robot: str
    name: str


class Release(GuardCall):
    """See `Guard.release`."""

    call = "release"
    right = Role.COMMAND

    robot: str
    name: str


class Allow(GuardCall):
    """See `Guard.allow`."""

    call = "allow"
    right = Role.COMMAND

    a: str
    b: str
    region: RegionWords = None
    depth: float = 0.002
    speed: float = 0.02
    until: float | None = None


class SwapModel(GuardCall):
    """See `Guard.swap_model`."""

    call = "swap_model"
    right = Role.COMMAND

    robot: str
    model: str


class Retreat(GuardCall):
    """See `Guard.retreat`."""

    call = "retreat"
    right = Role.COMMAND

    name: str | None = None
    to: Literal["path"] | Numbers = "path"


class FieldGoal(GuardCall):
    """See `Guard.field_goal`."""

    call = "field_goal"
    right = Role.COMMAND

    name: str
    q: Numbers = None
    pose: Numbers = None


class Reset(GuardCall):
    """See `Guard.reset`."""

    call = "reset"
    right = Role.COMMAND


class Place(GuardCall):
    """See `Guard.place`."""

    call = "place"
    right = Role.SENSE

    name: str
    pose: Numbers
    stamp: float | None = None
    velocity: Numbers = None
    shape: ShapeWords = None


class Remove(GuardCall):
    """See `Guard.remove`."""

    call = "remove"
    right = Role.SENSE

    name: str


class Configure(Call):
    """Goes on with other settings of the scene, for all robots or by name."""

    call = "configure"
    right = Role.ADMINISTER

    response: str | dict[str, str] | None = None
    mode: str | dict[str, str] | None = None


class Why(Call):
    """Asks for the last cycle in words."""

    call = "why"
    right = Role.OBSERVE


class ListObjects(Call):
    """Asks where objects were placed since the start, after so many of them."""

    call = "objects"
    right = Role.OBSERVE

    first: Annotated[int, Field(ge=0)] = 0


class OrderStop(Call):
    """Stops all robots until they are engaged."""

    call = "stop"
    right = Role.OBSERVE


class Ping(Call):
    """Asks for the number of the next cycle."""

    call = "ping"
    right = Role.OBSERVE


def call_of(event: Mapping[str, Any]) -> GuardCall:
    """The call that a recording tells of.

    Raises:
        KeyError: There is no such call.
        ValueError: It has other arguments, or is none of the guard's.
    """
    words = dict(event)
    made = CALLS[words.pop("call")]
    call = made.model_validate(words)
    if not isinstance(call, GuardCall):
        raise ValueError(f"'{made.call}' does nothing to a guard")
    return call
