"""Sensors in `armguard check`: rates, cost, and the speed that each one allows."""

from collections.abc import Iterator
from math import inf, isfinite, sqrt
from time import process_time

import numpy as np
from numpy.typing import NDArray

from armguard.cli.finding import Finding
from armguard.errors import ArmguardError
from armguard.scene.scene import Scene
from armguard.scene.sensors import SceneSensor
from armguard.sense import Sense
from armguard.sense.view import View, sure_reach

# Frames of each sensor of which the cost is measured.
FRAMES = 5

# Time from one of these frames to the next, and between joint positions [s].
SECONDS, STEP = 0.5, 0.005

# Distance that is left in front of what is seen when the arm rests [m].
FLOOR = 0.03

# Share of a core that sensors may take.
MOST_SHARE = 0.8

# Distances at which the smallest body that is surely seen is printed, and error of its
# size [m].
NEARER, SIZE_STEP = (0.1, 0.2, 0.5, 1.0, 2.0), 1e-3

# Speed below which a sensor hardly lets an arm move [m/s].
SLOW = 0.25


def sensor_findings(scene: Scene) -> Iterator[Finding]:
    """What the sensors of a scene cost, and what each one alone allows."""
    space = scene.sensing
    if space is None or not scene.sensors:
        return
    sensors = scene.sensors.values()
    rate = sum(1.0 / one.period for one in sensors)
    zones = sum(one.zones[0] * one.zones[1] for one in sensors if one.form == "zones")
    try:
        share = measured_share(scene)
    except ArmguardError as error:
        yield Finding("sensors", "FAIL", str(error), keys=("sensing",))
        return
    yield Finding(
        "sensors",
        "PASS" if share <= MOST_SHARE else "WARN",
        f"{len(scene.sensors)} sensors, {zones:,} zones, {rate:.0f} frames/s take "
        f"{share:.0%} of a core (measured at home, all of them near to something)",
        ""
        if share <= MOST_SHARE
        else "raise `sensing.cell`, or the `period` of the sensors",
        keys=("sensors",),
    )
    for one in sensors:
        keys = ("sensors", one.entry)
        if one.form == "capacitive":
            said = f"{one.name} frees no space: it only takes knowledge away"
            yield Finding("sensors", "PASS", said, keys=keys)
            continue
        view = View(one, space.intruder.size, space.cell)
        age = worst_age(scene, one)
        hard = deceleration_at(scene, one)
        speeds = {0.0, space.intruder.speed if space.unknown == "moving" else 0.0}
        allowed = [allowed_speed(view.reach, age, hard, w) for w in sorted(speeds)]
        said = ", ".join(
            f"{v:.2f} m/s if what it sees moves at {w:g} m/s"
            for v, w in zip(allowed, sorted(speeds), strict=True)
        )
        seen = f"{space.intruder.size * 1e3:g} mm up to {view.reach:.2f} m"
        seen += smallest_bodies(one, view.reach)
        fast = allowed[-1] >= SLOW
        yield Finding(
            "sensors",
            "PASS" if fast else "WARN",
            f"towards what only it sees: {said} (it surely sees {seen}, its frames are "
            f"up to {age * 1e3:.0f} ms old, the stop has {hard:.1f} m/s²)",
            "" if fast else "add a sensor that sees farther, or a zone that is free",
            keys=keys,
        )


def smallest_bodies(sensor: SceneSensor, reach: float) -> str:
    """The smallest bodies that a sensor surely sees nearer than its reach [m]."""
    places = (place for place in NEARER if place < reach)
    said = [f"{size * 1e3:.0f} mm at {place:g} m" for place in places
            if isfinite(size := smallest_body(sensor, place))]  # fmt: skip
    return "".join(f", {one}" for one in said)


def smallest_body(sensor: SceneSensor, distance: float) -> float:
    """Diameter of the smallest body that is surely seen at a distance [m].

    Infinite if none of a metre is.
    """
    low, high = 0.0, 1.0
    if sure_reach(sensor, high) < distance:
        return inf
    while high - low > SIZE_STEP:
        middle = 0.5 * (low + high)
        low, high = (
            (low, middle) if sure_reach(sensor, middle) >= distance else (middle, high)
        )
    return high


def measured_share(scene: Scene) -> float:
    """Share of a core that all sensors take, with joint positions in every cycle.

    It is measured at home.

    Raises:
        SceneError: The scene has no such map.
    """
    sense, total, steps = Sense(scene), 0.0, round(SECONDS / STEP)
    for k in range(FRAMES + 1):
        start, before = k * SECONDS, process_time()
        for step in range(steps):
            sense.joints(scene.home, start + step * STEP)
        spent = (process_time() - before) / (steps * scene.period)
        for name, one in scene.sensors.items():
            # Every frame has other distances, so that none repeats another.
            middle = 0.5 * (one.range[0] + min(one.range[1], 1.5)) + 0.001 * k
            values = frame_at(one, middle)
            before, stamp = process_time(), start + SECONDS - 2.0 * STEP
            sense.frame(name, values, None, stamp)
            spent += (process_time() - before) / one.period
        # The first frames load kernels.
        total += spent if k else 0.0
    return total / FRAMES


def frame_at(sensor: SceneSensor, distance: float) -> NDArray[np.float64]:
    """A frame of a sensor that sees a wall at a distance [m].

    A cloud is as dense as declared within 45° about the axis.
    """
    if sensor.form in ("beam", "infrared", "capacitive"):
        return np.array(distance)
    if sensor.form == "points":
        slope = np.arange(-0.41, 0.41, sensor.spacing)
        x, y = (part.ravel() for part in np.meshgrid(slope, slope))
        return distance * np.stack([x, y, np.ones(len(x))], axis=1)
    columns, rows = sensor.zones
    return np.full((rows, columns), distance)


def worst_age(scene: Scene, sensor: SceneSensor) -> float:
    """Age of a measurement until an arm that it stops begins to stop [s]."""
    delays = [
        one.stopping.sensing + one.stopping.command
        for one in scene.robots.values()
        if one.stopping is not None
    ]
    frame = sensor.period + sensor.delay + 2.0 * sensor.jitter
    return frame + scene.period + scene.late + max(delays, default=0.0)


def deceleration_at(scene: Scene, sensor: SceneSensor) -> float:
    """Deceleration of the slowest stop at a sensor, or at half a metre [m/s²].

    It is that of a single joint, at the distance of the sensor from the robot's base.
    """
    robots = list(scene.robots.values())
    if sensor.on is not None:
        robots = [scene.robots[sensor.on.split("/", 1)[0]]]
    least = min(
        (one.stopping.deceleration.min() for one in robots if one.stopping is not None),
        default=np.inf,
    )
    return float(0.5 * least) if isfinite(least) else 1.0


def allowed_speed(reach: float, age: float, deceleration: float, speed: float) -> float:
    """Speed from which an arm rests before what it does not see yet [m/s].

    Args:
        reach: Distance at which it is surely seen [m].
        age: Time until the stop begins [s].
        deceleration: Deceleration of the stop [m/s²].
        speed: Speed at which it may come [m/s].
    """
    # v² / 2a + v (T + w / a) + w T = reach - floor
    half = age + speed / deceleration
    room = reach - FLOOR - speed * age
    if room <= 0.0:
        return 0.0
    return deceleration * (sqrt(half * half + 2.0 * room / deceleration) - half)
