"""Calls between two cycles as data: their arguments, their rights, what they do.

Messages, recordings and programs of this machine give the arguments: numbers, shapes
and regions either as JSON holds them or as `Guard` takes them. What they may be is for
the guard to judge.
"""

from base64 import b64decode, b64encode
from collections.abc import Mapping
from functools import partial
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, PlainSerializer, PlainValidator

from armguard.cells.deltas import Delta
from armguard.geometry.pose import Pose
from armguard.geometry.shapes import Shape
from armguard.guard.clusters import Cluster
from armguard.guard.contract import Region
from armguard.record import dtype_of
from armguard.recording.rights import Role
from armguard.recording.shape_words import shape_of, words_of
from armguard.respond import Guard

Floats = NDArray[np.float64]

# Every call by its name.
CALLS: dict[str, type["Call"]] = {}


def numbers_in(value: Any) -> Floats | None:
    """Numbers as an array, a pose as its transform; None if there are none."""
    if isinstance(value, Pose):
        return value.matrix()
    if value is None:
        return None
    try:
        found = np.array(value)
        if found.dtype.kind in "iufO":
            return found.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        pass
    raise ValueError("it must be numbers")


def shape_in(value: Any) -> Shape | None:
    """A shape, also from its kind and its sizes; None if there is none."""
    if isinstance(value, Mapping):
        return shape_of(value)
    if value is None or isinstance(value, Shape):
        return value
    raise ValueError(
        "it must be a kind and its sizes, such as {'kind': 'sphere', 'radius': 0.1}"
    )


def region_in(value: Any) -> Region | None:
    """A region, also from its fields, its pose as a transform or as `xyz` and `rpy`."""
    if value is None or isinstance(value, Region):
        return value
    try:
        words = {"frame": None, **value}
        given = {key: tuple(words[key]) for key in ("xyz", "rpy") if key in words}
        pose = Pose.from_matrix(words["pose"]) if "pose" in words else Pose(**given)
        size = tuple(words["size"])
    except (TypeError, KeyError) as error:
        form = "{'size': (x, y, z), 'xyz': (x, y, z)}"
        raise ValueError(f"it must be a region, such as {form}: {error!r}") from None
    return Region(size=size, pose=pose, frame=words["frame"])


def region_words(region: Region) -> dict[str, Any]:
    """A region as a recording holds it, with the very bits of its pose."""
    return {
        "size": list(region.size),
        "xyz": list(region.pose.xyz),
        "rpy": list(region.pose.rpy),
        "frame": region.frame,
    }


def records_in(kind: type, value: Any) -> Any:
    """Records of a kind, also from their bytes in base 64."""
    if not isinstance(value, str):
        return value
    try:
        rows = np.frombuffer(b64decode(value, validate=True), dtype_of(kind))
    except ValueError:
        raise ValueError(
            f"it must be records of {kind.__name__}, or their bytes in base 64"
        ) from None
    return rows.view(np.recarray)


def bytes_of(value: Any) -> str:
    """Records as a recording holds them: their bytes in base 64."""
    return b64encode(value.tobytes()).decode()


RECORDS = PlainSerializer(bytes_of, return_type=str)

Changes = Annotated[Any, PlainValidator(partial(records_in, Delta)), RECORDS]
Moving = Annotated[Any, PlainValidator(partial(records_in, Cluster)), RECORDS]
Numbers = Annotated[
    Floats | None,
    PlainValidator(numbers_in),
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
    """A call between two cycles; a class with a name and a right can be made.

    Attributes:
        call: Its name.
        right: The role it needs. From COMMAND on it needs the command itself as well.
    """

    model_config = ConfigDict(
        extra="forbid", frozen=True, strict=True, arbitrary_types_allowed=True
    )

    call: ClassVar[str]
    right: ClassVar[Role]

    def __init_subclass__(cls, call: str = "", right: Role | None = None) -> None:
        """Register it."""
        if call and right:
            cls.call, cls.right = call, right
            CALLS[call] = cls


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
        """The event of a recording for it, ready for JSON."""
        return {"call": self.call, **self.model_dump()}


class Engage(GuardCall, call="engage", right=Role.COMMAND):
    """See `Guard.engage`."""

    name: str | None = None
    ordered: bool = True


class Grasp(GuardCall, call="grasp", right=Role.COMMAND):
    """See `Guard.grasp`."""

    robot: str
    name: str


class Release(GuardCall, call="release", right=Role.COMMAND):
    """See `Guard.release`."""

    robot: str
    name: str


class Allow(GuardCall, call="allow", right=Role.COMMAND):
    """See `Guard.allow`."""

    a: str
    b: str
    region: RegionWords = None
    depth: float = 0.002
    speed: float = 0.02
    until: float | None = None


class SwapModel(GuardCall, call="swap_model", right=Role.COMMAND):
    """See `Guard.swap_model`."""

    robot: str
    model: str


class Retreat(GuardCall, call="retreat", right=Role.COMMAND):
    """See `Guard.retreat`."""

    name: str | None = None
    to: Literal["path"] | Numbers = "path"


class FieldGoal(GuardCall, call="field_goal", right=Role.COMMAND):
    """See `Guard.field_goal`."""

    name: str
    q: Numbers = None
    pose: Numbers = None


class Reset(GuardCall, call="reset", right=Role.COMMAND):
    """See `Guard.reset`."""


class Place(GuardCall, call="place", right=Role.SENSE):
    """See `Guard.place`."""

    name: str
    pose: Numbers
    stamp: float | None = None
    velocity: Numbers = None
    shape: ShapeWords = None


class Remove(GuardCall, call="remove", right=Role.SENSE):
    """See `Guard.remove`."""

    name: str


class UpdateCells(GuardCall, call="update_cells", right=Role.SENSE):
    """See `Guard.update_cells`."""

    deltas: Changes
    stamp: float


class UpdateClusters(GuardCall, call="update_clusters", right=Role.SENSE):
    """See `Guard.update_clusters`."""

    clusters: Moving


class Configure(Call, call="configure", right=Role.ADMINISTER):
    """Goes on with other settings of the scene, for all robots or by name."""

    response: str | dict[str, str] | None = None
    mode: str | dict[str, str] | None = None


class Why(Call, call="why", right=Role.OBSERVE):
    """Requests the last cycle in words."""


class ListObjects(Call, call="objects", right=Role.OBSERVE):
    """Asks where objects were placed since the start, after so many of them."""

    first: Annotated[int, Field(ge=0)] = 0


class OrderStop(Call, call="stop", right=Role.OBSERVE):
    """Stops all robots until they are engaged."""


class Ping(Call, call="ping", right=Role.OBSERVE):
    """Requests the number of the next cycle."""


def call_of(event: Mapping[str, Any]) -> GuardCall:
    """The call of an event in a recording.

    Raises:
        KeyError: There is no such call.
        ValueError: It has other arguments, or is none of the guard's.
    """
    words = dict(event)
    call = CALLS[words.pop("call")].model_validate(words)
    if not isinstance(call, GuardCall):
        raise ValueError(f"'{call.call}' does nothing to a guard")
    return call
