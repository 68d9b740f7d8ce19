"""The reflex that stops the arms by sensors: its settings."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from armguard.errors import SceneError
from armguard.scene.schema import CLOSED, METRES, Name, Positive
from armguard.scene.sensors import SceneSensor

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
        SceneError: It is a camera, no robot carries it, or it does not see so far.
    """
    if sensor.image or sensor.on is None:
        raise SceneError(
            f"the reflex takes zones of sensors on links; sensor '{sensor.name}' is "
            f"{'a camera' if sensor.image else 'on none'}: leave it out"
        )
    least, greatest = sensor.range
    if not least < distance <= greatest:
        raise SceneError(
            f"distance is {distance} m; sensor '{sensor.name}' measures from "
            f"{least} to {greatest} m"
        )
