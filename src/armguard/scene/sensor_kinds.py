"""Figures of sensors by kind."""

from dataclasses import dataclass
from math import radians
from typing import Literal

# What a distance is measured along: the axis of the sensor, or the ray of the zone.
Along = Literal["axis", "ray"]

# The form of its frames: distances of zones; a depth image; points, each with a ray
# from the sensor; one distance within a cone; the signal of an infrared sensor, or of a
# capacitive pad.
Form = Literal["zones", "image", "points", "beam", "infrared", "capacitive"]

# "tof": any array of zones that each measure a distance by time of flight.
KindName = Literal[
    "tof", "vl53l5cx", "vl53l8cx", "depth", "points", "range", "infrared", "capacitive"
]

Pair = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Codes:
    """What the status of a zone says.

    Attributes:
        valid: Codes of distances that were measured.
        doubtful: Codes of distances that may be wrong: they hit, and free nothing.
        nothing: Codes that say that nothing is within range. All others are invalid.
    """

    valid: tuple[int, ...]
    doubtful: tuple[int, ...]
    nothing: tuple[int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorKind:
    """Figures of a kind of sensor.

    Attributes:
        form: The form of its frames.
        zones: Columns and rows of its zones or pixels.
        view: Angle of its view along the columns and along the rows [rad].
        range: Least and greatest distance that it measures [m].
        error: How far off a distance, or the place of a zone, may be, beside its
            noise [m].
        noise: Standard deviation of a distance or a signal d: the sum of
            noise[k] · dᵏ [m or V].
        period: Time from frame to frame [s].
        delay: Time from the measurement to the stamp of its frame [s].
        jitter: How much that time may differ from frame to frame [s].
        fill: Share of a zone that an object has to fill to be measured [-].
        merge: Two surfaces nearer together than this may give one distance between
            them [m].
        spacing: Greatest angle between neighbouring rays of points [rad].
        gain: k of the signal V = k ρ cos θ / (d + δ)² of an infrared sensor [V m²], or
            of a pad: its signal if all before it is filled.
        offset: δ of that signal, or the radius of a pad [m].
        reflectance: Least and greatest reflectance ρ of what may come [-].
        tilt: Greatest angle of incidence θ [rad].
        drift: How fast the signal of a pad may drift, in units of its gain [1/s].
        along: What a distance is measured along.
        codes: What the status of a zone says.
    """

    form: Form = "zones"
    zones: tuple[int, int] = (8, 8)
    view: Pair = (0.785, 0.785)
    range: Pair = (0.02, 0.4)
    error: float = 0.01
    noise: tuple[float, float, float] = (0.002, 0.006, 0.0)
    period: float = 0.067
    delay: float = 0.0
    jitter: float = 0.005
    fill: float = 0.25
    merge: float = 0.6
    spacing: float = 0.0
    gain: float = 0.0
    offset: float = 0.0
    reflectance: Pair = (1.0, 1.0)
    tilt: float = 0.0
    drift: float = 0.0
    along: Along = "axis"
    codes: Codes = Codes(valid=(0,), doubtful=(), nothing=(1,))


# Codes of ST's driver: 5 measured; 6 and 9 at about half the confidence; 255 no target.
ST_CODES = Codes(valid=(5,), doubtful=(6, 9), nothing=(255,))

# Range, view and rates are of ST's data sheets. Noise is of 11,446 recorded frames of a
# VL53L8CX: 2 to 3 mm at 0.1 to 0.3 m, 5 mm to 0.9 m, 13 mm beyond. Its distances are
# perpendicular to the sensor, as ST's driver gives them.
KINDS: dict[KindName, SensorKind] = {
    "tof": SensorKind(),
    "vl53l5cx": SensorKind(
        view=(radians(45.0), radians(45.0)),
        range=(0.02, 4.0),
        noise=(0.003, 0.008, 0.0),
        period=1.0 / 15.0,
        delay=0.010,
        codes=ST_CODES,
    ),
    "vl53l8cx": SensorKind(
        view=(radians(45.0), radians(45.0)),
        range=(0.02, 4.0),
        period=1.0 / 15.0,
        delay=0.010,
        codes=ST_CODES,
    ),
    "depth": SensorKind(
        form="image",
        zones=(640, 480),
        range=(0.3, 3.0),
        error=0.005,
        noise=(0.001, 0.0, 0.002),
        period=1.0 / 30.0,
        delay=0.045,
        jitter=0.008,
        fill=1.0,
        merge=0.0,
    ),
    # A cloud: of a lidar, or of a depth camera that does not give its image.
    "points": SensorKind(
        form="points",
        zones=(1, 1),
        range=(0.1, 10.0),
        error=0.01,
        noise=(0.005, 0.0, 0.001),
        period=0.1,
        jitter=0.01,
        fill=1.0,
        merge=0.0,
        spacing=0.01,
        along="ray",
    ),
    # A distance within a cone, by sound or by light: `sensor_msgs/Range`.
    "range": SensorKind(
        form="beam",
        view=(0.26, 0.26),
        range=(0.02, 2.0),
        noise=(0.003, 0.01, 0.0),
        period=0.05,
        along="ray",
        merge=0.0,
    ),
    # An emitter and a detector of infrared light. Reflectances are those of black
    # rubber and of white paper.
    "infrared": SensorKind(
        form="infrared",
        view=(0.35, 0.35),
        range=(0.01, 0.5),
        error=0.002,
        noise=(0.0001, 0.01, 0.0),
        period=0.01,
        jitter=0.001,
        merge=0.0,
        along="ray",
        gain=0.02,
        offset=0.01,
        reflectance=(0.04, 0.88),
        tilt=0.5,
    ),
    # A pad with a driven shield behind it.
    "capacitive": SensorKind(
        form="capacitive",
        view=(2.1, 2.1),
        range=(0.005, 0.3),
        error=0.002,
        noise=(0.0003, 0.0, 0.0),
        period=0.02,
        jitter=0.001,
        merge=0.0,
        along="ray",
        gain=1.0,
        offset=0.03,
        drift=0.00005,
    ),
}
