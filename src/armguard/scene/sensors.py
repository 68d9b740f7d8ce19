"""Sensors of a scene: settings, and the figures of their kinds."""

from dataclasses import dataclass, fields
from math import atan, pi, tan
from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from armguard.geometry.pose import Pose
from armguard.scene.schema import (
    CLOSED,
    METRES,
    SECONDS,
    Name,
    NotNegative,
    Number,
    Positive,
    at_most,
    counted,
)
from armguard.scene.sensor_kinds import KINDS, Along, Codes, Form, KindName, Pair

# The widest view whose zones are cut out of one plane before the sensor [rad].
WIDEST = 0.9 * pi

Distance = Annotated[Positive, at_most(20.0, "m")]
Share = Annotated[Positive, Field(le=1.0)]
Seconds = Annotated[Positive, SECONDS]
Delay = Annotated[NotNegative, SECONDS]
View = Annotated[Positive, at_most(WIDEST, "rad")]
Count = Annotated[int, Field(ge=1, le=64)]
Pixels = Annotated[int, Field(ge=2, le=4096)]

# Keys that only sensors of a form have.
OF_FORMS: dict[Form, tuple[str, ...]] = {
    "zones": ("zones", "view"),
    "image": ("size", "focal", "middle"),
    "points": ("spacing",),
    "beam": ("angle",),
    "infrared": ("angle", "gain", "offset", "reflectance", "tilt"),
    "capacitive": ("gain", "offset", "drift"),
}

# Parts of the cone of a beam along each edge of a square about it.
PARTS = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class RingSettings:
    """Sensors in a ring about the z axis of their frame, all looking outwards.

    Attributes:
        count: How many there are.
        radius: Radius of the ring [m].
        height: Place of the ring along the axis [m].
    """

    __pydantic_config__ = CLOSED

    count: Annotated[int, Field(ge=1, le=32)]
    radius: Annotated[NotNegative, METRES]
    height: Annotated[Number, METRES] = 0.0

    def frames(self) -> NDArray[np.float64]:
        """Frames of the sensors: columns along the ring, rows along its axis.

        Returns:
            Transforms, shape (count, 4, 4).
        """
        angles = 2.0 * pi * np.arange(self.count) / self.count
        c, s = np.cos(angles), np.sin(angles)
        T = np.tile(np.eye(4), (self.count, 1, 1))
        T[:, 0, 0], T[:, 1, 0], T[:, :3, 1] = -s, c, (0.0, 0.0, 1.0)
        T[:, 0, 2], T[:, 1, 2], T[:, 2, 2] = c, s, 0.0
        T[:, 0, 3], T[:, 1, 3] = self.radius * c, self.radius * s
        T[:, 2, 3] = self.height
        return T


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorSettings:
    """A sensor, or a ring of equal ones.

    Attributes:
        on: 'robot/link' that carries it; None if it is fixed in the world.
        kind: "tof": an array of zones that each measure a distance by time of flight;
            "vl53l5cx" and "vl53l8cx": such arrays of ST; "depth": a depth camera;
            "points": a lidar, or any sensor that gives points; "range": one distance
            within a cone; "infrared": the signal of light that comes back;
            "capacitive": the signal of a pad. The kind has figures of all that is not
            set.
        zones: Columns and rows of its zones.
        view: Angle of its view along the columns and along the rows [rad].
        size: Columns and rows of the pixels of a depth camera.
        focal: Its focal length, required for a depth camera [pixels].
        middle: Column and row of its principal point; by default that of the image
            [pixels].
        angle: Opening angle of the cone of a single distance or signal [rad].
        spacing: Greatest angle between neighbouring rays of points [rad].
        gain: k of the signal V = k ρ cos θ / (d + δ)² of an infrared sensor [V m²], or
            of a pad: its signal if all before it is filled.
        offset: δ of that signal, or the radius of a pad [m].
        reflectance: Least and greatest reflectance ρ of what may come [-].
        tilt: Greatest angle of incidence θ [rad].
        drift: How fast the signal of a pad may drift, in units of its gain [1/s].
        range: Least and greatest distance that it measures [m].
        error: How far off a distance, or the place of a zone, may be, beside its
            noise [m].
        noise: Standard deviation of a distance or a signal d, as a + b·d + c·d² [m or
            V].
        period: Time from frame to frame [s].
        delay: Time from the measurement to the stamp of its frame [s].
        jitter: How much that time may differ from frame to frame [s].
        fill: Share of a zone that an object has to fill to be measured [-].
        along: "axis" for distances perpendicular to the sensor, "ray" for those from
            its middle.
        ring: Sensors in a ring; none for one sensor.
    """

    __pydantic_config__ = CLOSED

    on: Name | None = None
    kind: KindName = "tof"
    zones: Annotated[tuple[Count, Count], counted(2)] | None = None
    view: Annotated[tuple[View, View], counted(2)] | None = None
    size: Annotated[tuple[Pixels, Pixels], counted(2)] | None = None
    focal: Positive | None = None
    middle: Annotated[tuple[Number, Number], counted(2)] | None = None
    angle: View | None = None
    spacing: View | None = None
    gain: Positive | None = None
    offset: Annotated[Positive, METRES] | None = None
    reflectance: Annotated[tuple[Share, Share], counted(2)] | None = None
    tilt: Annotated[NotNegative, at_most(1.4, "rad")] | None = None
    drift: NotNegative | None = None
    range: Annotated[tuple[Distance, Distance], counted(2)] | None = None
    error: Annotated[NotNegative, METRES] | None = None
    noise: (
        Annotated[tuple[NotNegative, NotNegative, NotNegative], counted(3)] | None
    ) = None
    period: Seconds | None = None
    delay: Delay | None = None
    jitter: Delay | None = None
    fill: Annotated[Positive, Field(le=1.0)] | None = None
    along: Along | None = None
    ring: RingSettings | None = None

    @model_validator(mode="after")
    def _is_a_sensor(self) -> Self:
        if self.range is not None and self.range[0] >= self.range[1]:
            least, greatest = self.range
            raise ValueError(f"range is {least} to {greatest} m; it must rise")
        if self.reflectance is not None and self.reflectance[0] > self.reflectance[1]:
            least, greatest = self.reflectance
            raise ValueError(f"reflectance is {least} to {greatest}; it must not fall")
        form = KINDS[self.kind].form
        own = OF_FORMS[form]
        for key in (key for keys in OF_FORMS.values() for key in keys):
            if key not in own and getattr(self, key) is not None:
                said = ", ".join(own)
                raise ValueError(f"kind {self.kind} has no `{key}`; it has {said}")
        if form == "image" and self.focal is None:
            raise ValueError(
                "focal is missing; give that of the camera, such as focal: 615 [pixels]"
            )
        return self


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneSensor:
    """A sensor of a scene, with all figures.

    Attributes:
        name: Its name; sensor k of a ring is 'NAME/k'.
        entry: Name of its entry: of the sensor, or of its ring.
        on: 'robot/link' that carries it; None if it is fixed in the world.
        kind: Its kind.
        mount: Frame of its entry: that of the sensor, or of its ring.
        pose: Its frame in the link that carries it, or in the world: it looks along z,
            its columns follow x, its rows y.
        form: The form of its frames.
        zones: Columns and rows.
        view: Angle of its view along the columns and along the rows [rad].
        focal: Focal lengths along columns and rows [zones or pixels].
        middle: Column and row of its principal point [zones or pixels].
        range: Least and greatest distance [m].
        error: Error of a distance, or of the place of a zone [m].
        noise: Coefficients of the noise.
        period: Time from frame to frame [s].
        delay: Time from the measurement to the stamp [s].
        jitter: How much that differs [s].
        fill: Share of a zone that an object has to fill [-].
        merge: Depth within which surfaces merge [m].
        spacing: Greatest angle between neighbouring rays of points [rad].
        gain: See `SensorKind`, from here to `drift`.
        offset: Depth of the optical centre, or radius of a pad [m].
        reflectance: Least and greatest reflectance [-].
        tilt: Greatest angle of incidence [rad].
        drift: How fast the signal may drift [1/s].
        along: What a distance is measured along.
        codes: What the status of a zone says.
    """

    name: str
    entry: str
    on: str | None
    kind: KindName
    mount: Pose
    pose: Pose
    form: Form
    zones: tuple[int, int]
    view: Pair
    focal: Pair
    middle: Pair
    range: Pair
    error: float
    noise: tuple[float, float, float]
    period: float
    delay: float
    jitter: float
    fill: float
    merge: float
    spacing: float
    gain: float
    offset: float
    reflectance: Pair
    tilt: float
    drift: float
    along: Along
    codes: Codes

    @property
    def image(self) -> bool:
        """Whether it has pixels of a pinhole camera."""
        return self.form == "image"

    @property
    def narrow(self) -> bool:
        """Whether it gives one distance or signal of all that is within a cone."""
        return self.form in ("beam", "infrared")


def scene_sensors(name: str, settings: SensorSettings, pose: Pose) -> list[SceneSensor]:
    """The sensors of an entry: one, or those of its ring.

    Args:
        name: Name of the entry.
        settings: Its settings.
        pose: Frame of the sensor, or of the middle of the ring.
    """
    kind = KINDS[settings.kind]
    given = {field.name: getattr(settings, field.name) for field in fields(settings)}
    figures = {
        field.name: getattr(kind, field.name)
        if given.get(field.name) is None
        else given[field.name]
        for field in fields(kind)
    }
    columns, rows = figures["zones"] = settings.size or figures["zones"]
    if kind.form in ("beam", "infrared"):
        columns, rows = figures["zones"] = PARTS, PARTS
        figures["view"] = (settings.angle or kind.view[0],) * 2
    if kind.form == "image":
        assert settings.focal is not None
        focal = (settings.focal, settings.focal)
        figures["view"] = tuple(
            2.0 * atan(0.5 * n / settings.focal) for n in (columns, rows)
        )
    else:
        across, along = figures["view"]
        focal = (0.5 * columns / tan(across / 2.0), 0.5 * rows / tan(along / 2.0))
    middle = settings.middle or (0.5 * (columns - 1), 0.5 * (rows - 1))
    figures |= {"entry": name, "mount": pose, "on": settings.on, "kind": settings.kind}
    figures |= {"focal": focal, "middle": middle}
    if settings.ring is None:
        return [SceneSensor(name=name, pose=pose, **figures)]
    return [
        SceneSensor(name=f"{name}/{k}", pose=Pose.from_matrix(T), **figures)
        for k, T in enumerate(pose.matrix() @ settings.ring.frames())
    ]
