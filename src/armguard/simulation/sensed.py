"""A bay with simulated sensors, a motion of its arms, and the frames of that motion."""

import heapq
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.pose import Pose
from armguard.geometry.shapes import Box
from armguard.scene.bay import bay_scene
from armguard.scene.scene import Scene
from armguard.scene.sensing import Unknown
from armguard.sense import Sense
from armguard.sense.frames_file import JOINTS, Event
from armguard.sense.sense import EVENTS
from armguard.simulation.sensors import Rig

Floats = NDArray[np.float64]
Motion = Callable[[float], Floats]


class Course(NamedTuple):
    """A motion of limited time.

    Attributes:
        motion: Joint positions by time [rad or m].
        seconds: How long it takes [s].
    """

    motion: Motion
    seconds: float


# Distances, status and stamp of a frame; None if it is lost.
Sent = tuple[Any, Any, Any] | None
Tamper = Callable[[str, float, Floats, Any, float], Sent]

# Time between joint positions, and from a stamp until the frame is there [s].
STEP, TRANSPORT = 0.004, 0.01


def sensed_bay(
    zones: bool = True, camera: bool = True, unknown: Unknown = "still",
    reason: str | None = None, **settings: Any,
) -> Scene:  # fmt: skip
    """The bay with a ring of four zone sensors on each arm, and a camera above.

    Args:
        zones: Whether it has the rings.
        camera: Whether it has the camera.
        unknown: See `SensingSettings`.
        reason: See `SensingSettings`.
        settings: Settings of all sensors, see `SensorSettings`.
    """
    scene = bay_scene("path")
    scene.set_sensing(
        region={"centre": (-0.4, 0, 1.1), "size": 128}, cell=0.025, unknown=unknown,
        reason=reason, intruder={"speed": 1.6, "size": 0.05},
    )  # fmt: skip
    scene.add(Box(size=(4, 4, 0.2)), "floor", pose=Pose(xyz=(0, 0, -0.1)))
    for robot in ("left", "right") if zones else ():
        scene.add_sensor(
            robot + "_ring", kind="vl53l8cx", on=f"{robot}/link5", **settings,
            ring={"count": 4, "radius": 0.12, "height": 0.06},
        )  # fmt: skip
    if camera:
        scene.add_sensor(
            "top", kind="depth", size=(160, 120), focal=130, range=(0.3, 3.0),
            pose=Pose(xyz=(-0.2, 0, 2.3), rpy=(np.pi, 0, 0)), **settings,
        )  # fmt: skip
    return scene


def swing(scene: Scene, speed: float = 1.0) -> Motion:
    """A motion of all joints near home, as a function of time.

    Args:
        scene: The scene.
        speed: Its angular frequency [rad/s].
    """
    home = scene.home
    phase = np.linspace(0.0, 5.0, len(home))
    start = np.sin(phase)
    return lambda t: home + 0.35 * (np.sin(speed * t + phase) - start)


def through(postures: Floats, speed: float = 1.2, rest: float = 0.3) -> Course:
    """A motion from posture to posture, smooth in each joint.

    Args:
        postures: Joint positions, shape (k, n) [rad or m].
        speed: Greatest velocity of a joint [rad/s or m/s].
        rest: Time at rest at each posture [s].
    """
    ways = np.abs(np.diff(postures, axis=0)).max(axis=1)
    # A half wave of the cosine has 1.57 of its mean velocity.
    times = 0.5 * np.pi * ways / speed
    starts = rest + np.concatenate([[0.0], np.cumsum(times + rest)])

    def motion(t: float) -> Floats:
        k = min(max(int(np.searchsorted(starts, t)) - 1, 0), len(times) - 1)
        share = min(max((t - starts[k]) / max(times[k], 1e-9), 0.0), 1.0)
        share = 0.5 - 0.5 * np.cos(np.pi * share)
        return np.asarray(postures[k] + share * (postures[k + 1] - postures[k]))

    return Course(motion, float(starts[-1]))


def events_of(
    rig: Rig, scene: Scene, course: Course, entry: str, late: float = 0.0,
    seed: int = 0,
) -> Iterator[Event]:  # fmt: skip
    """Joint positions, and the frames of a sensor or of a ring, on a course.

    Args:
        rig: The simulated sensors.
        scene: The scene.
        course: The motion.
        entry: Name of the sensor or of the ring.
        late: How much longer the delay is than declared [s].
        seed: Seed of the jitter.
    """
    rng = np.random.default_rng(seed)
    sensors = {n: one for n, one in scene.sensors.items() if one.entry == entry}
    due = {n: one.period * rng.random() for n, one in sensors.items()}
    for k in range(int(course.seconds / STEP)):
        t = k * STEP
        yield Event(JOINTS, "", t, [course.motion(t)])
        for name, sensor in sensors.items():
            if t < due[name]:
                continue
            jitter = sensor.jitter * rng.uniform(-1.0, 1.0)
            found = rig.read(name, course.motion(due[name]))
            stamp = due[name] + sensor.delay + late + jitter
            arrays = [found.distance, found.status]
            given = [one for one in arrays if one is not None]
            yield Event(EVENTS[sensor.form], name, stamp, given)
            due[name] += sensor.period


def drive(
    sense: Sense, rig: Rig, motion: Motion, seconds: float, *,
    start: float = 0.0, late: float = 0.0, tamper: Tamper | None = None,
    each: Callable[[float, str], None] | None = None,
) -> None:  # fmt: skip
    """Let the sensors of a scene see a motion, each at its own times.

    Args:
        sense: Takes joint positions and frames.
        rig: The simulated sensors.
        motion: Joint positions by time [rad or m].
        seconds: How long [s].
        start: Time of the first joint positions; a frame that was sent before is not
            sent again [s].
        late: How far stamps may be off, beside the declared delay [s].
        tamper: Changes frames before they are sent: by the name of the sensor, the time
            of the measurement, distances, status and stamp.
        each: Called after each frame with the time and the name of its sensor.
    """
    sensors = rig.scene.sensors
    rng, queue = np.random.default_rng(7), list[tuple[float, str]]()
    for k, (name, sensor) in enumerate(sensors.items()):
        phase = sensor.period * (0.3 + 0.61 * k % 1.0)
        count = np.ceil(max(start - 0.06 - phase, 0.0) / sensor.period)
        heapq.heappush(queue, (phase + count * sensor.period, name))
    for k in range(round(seconds / STEP)):
        t = start + (k + 1) * STEP
        sense.joints(motion(t), t)
        while queue and queue[0][0] + sensors[queue[0][1]].delay + TRANSPORT <= t:
            measured, name = heapq.heappop(queue)
            sensor = sensors[name]
            heapq.heappush(queue, (measured + sensor.period, name))
            reading = rig.read(name, motion(measured))
            stamp = measured + sensor.delay + late * rng.uniform(-1.0, 1.0)
            sent: Sent = (reading.distance, reading.status, stamp)
            if tamper is not None:
                sent = tamper(name, measured, *reading, stamp)
            if sent is None or stamp <= sense.health[name].stamp:
                continue
            distance, status, stamp = sent
            sense.frame(name, distance, status, stamp)
            if each is not None:
                each(t, name)


def off_mounts(scene: Scene, rig: Rig, way: float, seed: int = 1) -> None:
    """Mount all sensors elsewhere than declared.

    Args:
        scene: The scene.
        rig: The simulated sensors.
        way: How far, each in some direction [m].
        seed: Seed of the directions.
    """
    rng = np.random.default_rng(seed)
    for name, sensor in scene.sensors.items():
        aside = rng.normal(size=3)
        T = sensor.pose.matrix()
        T[:3, 3] += T[:3, :3] @ (way * aside / np.linalg.norm(aside))
        rig.truth[name] = T
