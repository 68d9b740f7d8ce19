"""A bay with simulated sensors, for tests of sensing."""

import heapq

import numpy as np

import armguard as ag

# Times of joint positions [s].
STEP = 0.004


def bay(
    zones=True, camera=True, cell=0.025, unknown="still", size=0.05, reason=None,
    **settings
):  # fmt: skip
    """The bay with two rings of zones and a camera above the bench."""
    scene = ag.bay_scene("path")
    scene.set_sensing(
        region={"centre": (-0.4, 0, 1.1), "size": 128}, cell=cell, unknown=unknown,
        reason=reason, intruder={"speed": 1.6, "size": size},
    )  # fmt: skip
    scene.add(ag.Box(size=(4, 4, 0.2)), "floor", pose=ag.Pose(xyz=(0, 0, -0.1)))
    for robot in ("left", "right") if zones else ():
        scene.add_sensor(
            robot + "_ring", kind="vl53l8cx", on=f"{robot}/link5", **settings,
            ring={"count": 4, "radius": 0.12, "height": 0.06},
        )  # fmt: skip
    if camera:
        scene.add_sensor(
            "top", kind="depth", size=(160, 120), focal=130,
            range=(0.3, 3.0), pose=ag.Pose(xyz=(-0.2, 0, 2.3), rpy=(np.pi, 0, 0)),
            **settings,
        )  # fmt: skip
    return scene


def swing(scene, speed=1.0):
    """A motion of all joints about their home."""
    home = scene.home
    phase = np.linspace(0, 5, len(home))
    return lambda t: home + 0.35 * np.sin(speed * t + phase) - 0.35 * np.sin(phase)


def drive(
    sense, rig, scene, motion, seconds, start=0.0, each=None, tamper=None, late=0.0
):
    """Let sensors look at a motion, with a call after every frame."""
    rng = np.random.default_rng(7)
    queue = []
    for k, (name, sensor) in enumerate(scene.sensors.items()):
        phase = sensor.period * (0.3 + 0.61 * k % 1.0)
        count = np.ceil(max(start - 0.06 - phase, 0.0) / sensor.period)
        heapq.heappush(queue, (phase + count * sensor.period, name))
    for k in range(round(seconds / STEP)):
        t = start + (k + 1) * STEP
        sense.joints(motion(t), t)
        while queue and queue[0][0] + scene.sensors[queue[0][1]].delay + 0.01 <= t:
            measured, name = heapq.heappop(queue)
            sensor = scene.sensors[name]
            heapq.heappush(queue, (measured + sensor.period, name))
            reading = rig.read(name, motion(measured))
            off = rng.uniform(-1, 1) * late
            stamp = measured + sensor.delay + off
            sent = (reading.distance, reading.status, stamp)
            if tamper is not None:
                sent = tamper(name, measured, *sent)
            if sent is None or stamp <= sense.health[name].stamp:
                continue
            distance, status, stamp = sent
            if sensor.image:
                sense.depth(name, distance, stamp)
            else:
                sense.zones(name, distance, status, stamp)
            if each is not None:
                each(t, name)
