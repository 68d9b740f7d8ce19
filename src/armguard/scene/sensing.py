"""Sensed space, and the reflex that stops the arms by sensors: their settings."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, StringConstraints, model_validator

from armguard.errors import SceneError
from armguard.geometry.pose import Pose
from armguard.scene.schema import (
    CLOSED,
    METRES,
    SPEED,
    Name,
    NotNegative,
    Positive,
    PositiveTriple,
    Triple,
    checked,
    part_of,
)
from armguard.scene.sensors import SceneSensor, Seconds

Distance = Annotated[Positive, METRES]
Port = Annotated[int, Field(ge=1, le=65535)]


def no_repetition(values: tuple[object, ...]) -> tuple[object, ...]:
    """Refuse a list in which something is named twice."""
    if len(set(values)) < len(values):
        raise ValueError("names something twice")
    return values


def in_this_folder(value: str) -> str:
    """Refuse a name that leads to another folder: the file is written there."""
    if "/" in value or "\\" in value or value in (".", ".."):
        raise ValueError(f"is {value!r}; it must be a name without a folder")
    return value


@dataclass(frozen=True, slots=True, kw_only=True)
class ReflexSettings:
    """The reflex, see docs/reflex.md.

    Attributes:
        sensors: Names of the sensors it stops the arms by.
        distance: Each of their zones that sees something nearer stops the arms [m].
        vote: Frames in a row that have to see it.
        file: Its file, beside the scene file; `armguard check --reflex` writes it.
        port: UDP port of its frames and resets.
        listeners: UDP ports of the service and of the controllers, one for each.
        period: Time from pulse to pulse [s].
        watchdog: Silence of the reflex after which a listener stops the arms [s].
    """

    __pydantic_config__ = CLOSED

    sensors: Annotated[
        tuple[Name, ...], Field(min_length=1), AfterValidator(no_repetition)
    ]
    distance: Distance = 0.12
    vote: Literal[1, 2] = 1
    file: Annotated[Name, AfterValidator(in_this_folder)] = "reflex.json"
    port: Port = 47810
    listeners: Annotated[
        tuple[Port, ...],
        Field(min_length=1, max_length=16),
        AfterValidator(no_repetition),
    ] = (47811, 47812, 47813, 47814)
    period: Annotated[Positive, Field(ge=0.001, le=0.05)] = 0.02
    watchdog: Annotated[Positive, Field(ge=0.003, le=1.0)] = 0.1


def check_reflex_sensor(sensor: SceneSensor, distance: float) -> None:
    """Refuse a sensor by which the reflex cannot stop the arms.

    Raises:
        SceneError: It has no zones, no robot carries it, or it does not see so far.
    """
    if sensor.form != "zones" or sensor.on is None:
        but = "on none" if sensor.on is None else f"of kind {sensor.kind}"
        raise SceneError(
            f"the reflex takes zones of sensors on links; sensor '{sensor.name}' is "
            f"{but}: leave it out"
        )
    least, greatest = sensor.range
    if not least < distance <= greatest:
        raise SceneError(
            f"distance is {distance} m; sensor '{sensor.name}' measures from "
            f"{least} to {greatest} m"
        )


# Names of bodies in verdicts: of sensed cells, and of space that no sensor has seen.
SENSED, UNSEEN = "something sensed", "space not known free"

# How space counts that no sensor has seen free: as free; as an obstacle that is
# stationary; as one that moves at the intruder's speed.
Unknown = Literal["free", "still", "moving"]


def check_reason(unknown: str, reason: str | None) -> None:
    """Refuse unseen space that counts as free without a reason."""
    if unknown == "free" and not (reason or "").strip():
        raise ValueError("unknown is free; give the reason, as in reason: brick wall")


@dataclass(frozen=True, slots=True, kw_only=True)
class RegionSettings:
    """The cube of cells.

    Attributes:
        centre: Its middle, world [m].
        size: Cells along its edge.
    """

    __pydantic_config__ = CLOSED

    centre: Triple
    size: Literal[64, 128, 256, 512] = 256


@dataclass(frozen=True, slots=True, kw_only=True)
class IntruderSettings:
    """What may come into the region, unseen.

    Attributes:
        speed: Its greatest speed [m/s].
        size: Its least size; a smaller one may stay unseen [m].
    """

    __pydantic_config__ = CLOSED

    speed: Annotated[NotNegative, SPEED]
    size: Distance


@dataclass(frozen=True, slots=True, kw_only=True)
class ZoneSettings:
    """A part of space in which unseen cells count otherwise.

    Attributes:
        box: Its edges [m].
        unknown: How unseen space in it counts, as above.
        reason: Why unseen space in it is free; required then.
    """

    __pydantic_config__ = CLOSED

    box: PositiveTriple
    unknown: Unknown
    reason: str | None = None

    @model_validator(mode="after")
    def _free_for_a_reason(self) -> Self:
        check_reason(self.unknown, self.reason)
        return self


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneZone(ZoneSettings):
    """A zone of a scene.

    Attributes:
        pose: Frame of its middle in the world.
    """

    pose: Pose = field(default_factory=Pose)


@dataclass(frozen=True, slots=True, kw_only=True)
class StartSettings:
    """Space about the arms that a person has looked at before the sensors start.

    Attributes:
        clear: Distance from all links within which there is nothing but modelled
            objects [m].
        reason: Why this is known.
    """

    __pydantic_config__ = CLOSED

    clear: Annotated[Distance, Field(le=1.0)]
    reason: Annotated[str, StringConstraints(strip_whitespace=True, min_length=1)]


@dataclass(frozen=True, slots=True, kw_only=True)
class SensingSettings:
    """Cells that sensors fill and the guard reads, see docs/cells.md.

    Attributes:
        region: The cube of cells.
        cell: Edge of a cell [m].
        unknown: How space counts that no sensor has seen free: "still", as an obstacle;
            "moving", as one that grows at the intruder's speed; "free".
        reason: Why it is free; required then.
        intruder: What may come into the region, unseen.
        start: Space about the arms that is known free when the sensors start.
        stale: Age of the cells from which on all robots stop [s].
    """

    __pydantic_config__ = CLOSED

    region: RegionSettings
    cell: Annotated[Positive, Field(ge=0.001, le=0.2)] = 0.01
    unknown: Unknown
    reason: str | None = None
    intruder: IntruderSettings
    start: StartSettings | None = None
    stale: Seconds = 1.0

    @model_validator(mode="after")
    def _free_for_a_reason(self) -> Self:
        check_reason(self.unknown, self.reason)
        return self

    @property
    def edge(self) -> float:
        """Edge of the region [m]."""
        return self.region.size * self.cell


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneSensing(SensingSettings):
    """Sensed space of a scene.

    Attributes:
        zones: Zones by name; in several at once the first one counts.
    """

    zones: Mapping[str, SceneZone] = field(default_factory=dict)

    @property
    def may_be_free(self) -> bool:
        """Whether unseen space counts as free anywhere."""
        zones = self.zones.values()
        return self.unknown == "free" or any(zone.unknown == "free" for zone in zones)


def scene_sensing(
    settings: Mapping[str, Any], zones: Mapping[str, SceneZone]
) -> SceneSensing:
    """Sensed space of settings by name, and of zones.

    Raises:
        SceneError: A setting cannot be true.
    """
    known = checked("sensing", settings, kind=SensingSettings)
    found = {}
    for name, zone in zones.items():
        given = part_of(zone, ZoneSettings)
        valid = checked(f"sensing: zone '{name}'", given, kind=ZoneSettings)
        found[name] = SceneZone(**part_of(valid, ZoneSettings), pose=zone.pose)
    return SceneSensing(**part_of(known, SensingSettings), zones=found)
