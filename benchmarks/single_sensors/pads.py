"""Capacitive pads on an arm: foreign boxes that come near, and the arm's own motion."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

import armguard as ag
from armguard.sense.capacitive import Capacitive
from armguard.sense.history import JointHistory
from armguard.sense.prediction import mount_of, predict
from armguard.sense.view import View
from armguard.sense.world import World
from armguard.simulation.sensed import Motion, sensed_bay, swing
from armguard.simulation.sensors import Rig

Floats = NDArray[np.float64]

# Edge of a foreign box [m], and distances at which it starts and ends [m].
EDGE, START, END = 0.1, 0.25, 0.02

# Speeds of approaches [m/s], and the greatest angle from the axis of a pad [rad].
SPEEDS, ANGLE = (0.02, 0.3), 0.6

# Time from signal to signal of pads on arms in motion [s].
PERIOD = 0.1

# Drift of the signal, as a share of the gain, and its time of a wave [s].
DRIFT, WAVE = 0.003, 600.0


def pads(**settings: Any) -> ag.Scene:
    """The bay with two pads on the left forearm."""
    scene = sensed_bay(zones=False, camera=False)
    scene.add_sensor(
        "pads", kind="capacitive", on="left/link5",
        ring={"count": 2, "radius": 0.09, "height": 0.06}, **settings,
    )  # fmt: skip
    return scene


class Bench:
    """Pads with the motion of the arms, without a map.

    Args:
        scene: The scene.
        rig: The simulated sensors.
        motion: The motion.
    """

    def __init__(self, scene: ag.Scene, rig: Rig, motion: Motion) -> None:
        self.rig, self._motion, self._world = rig, motion, World(scene)
        self._history = JointHistory(*self._world.joint_figures())
        views = {n: View(one, 0.05) for n, one in scene.sensors.items()}
        self.views = views
        self.pads = {name: Capacitive(view) for name, view in views.items()}
        self._step = 0
        self._known: dict[str, Floats] = {}

    def take(self, name: str, t: float, still: bool = False) -> float:
        """Radius of the ball that a pad reports at a time [m].

        Args:
            name: Name of the pad.
            t: The time [s].
            still: Whether the arms are at rest: then all is known as at first.
        """
        if name not in self._known or not still:
            self._known[name] = self._signal_of_known(name, t)
        signal = float(self.rig.read(name, self._motion(t)).distance)
        return self.pads[name].take(signal, t, self._known[name])

    def _signal_of_known(self, name: str, t: float) -> Floats:
        """Signal of the links and objects at a time, see `Capacitive.known`."""
        while self._step * 0.004 <= t + 0.02:
            self._history.add(self._motion(self._step * 0.004), self._step * 0.004)
            self._step += 1
        view = self.views[name]
        placed = self._world.at(self._history, t, view.sensor.jitter)
        assert placed is not None
        mount = mount_of(view.sensor, self._world, placed)
        shift = float(placed.shifts.max(initial=0.0))
        prediction = predict(view, mount, placed, self._world)
        error = view.sensor.error + shift
        return self.pads[name].known(mount, prediction, error)


def frame(scene: ag.Scene, name: str) -> tuple[Floats, Floats]:
    """Place and axes of a pad at home."""
    world = World(scene)
    history = JointHistory(*world.joint_figures())
    for stamp in (0.0, 0.1):
        history.add(scene.home, stamp)
    placed = world.at(history, 0.05, 0.0)
    assert placed is not None
    mount = mount_of(scene.sensors[name], world, placed)
    return mount.origin, mount.R


def approaches(count: int, seed: int = 3) -> dict[str, Any]:
    """Distances at which boxes are noticed that come towards a pad at rest."""
    scene, rng = pads(), np.random.default_rng(seed)
    rig = Rig(scene, boxes=[(EDGE,) * 3], seed=seed)
    name = next(iter(scene.sensors))
    origin, R = frame(scene, name)
    noticed, inside = [], 0
    period = scene.sensors[name].period
    for _ in range(count):
        bench = Bench(scene, rig, lambda t: scene.home)
        speed, turn = rng.uniform(*SPEEDS), rng.uniform(0.0, 2.0 * np.pi)
        angle = rng.uniform(0.0, ANGLE)
        way = R @ (
            np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle),
        )  # fmt: skip
        rpy = rng.uniform(-1.5, 1.5, 3).tolist()
        rig.place(0, None)
        for k in range(10):
            bench.take(name, (5 + k) * period, still=True)
        found = None
        # Its nearest point is at least half an edge before its middle.
        for k in range(int((START - END) / speed / period)):
            distance = START - speed * period * k
            at = origin + (distance + 0.5 * EDGE) * way
            rig.place(0, ag.Pose(xyz=at.tolist(), rpy=rpy))
            radius = bench.take(name, (15 + k) * period, still=True)
            if radius > 0.0:
                found = distance
                # The nearest point is within the ball that is reported.
                inside += radius >= distance - 0.5 * EDGE * (np.sqrt(3.0) - 1.0)
                break
        noticed.append(-1.0 if found is None else found)
    near = np.array(noticed)
    return {
        "approaches": count, "missed": int((near < 0).sum()),
        "below_80_mm": int((near < 0.08).sum()),
        "least": float(near.min()), "median": float(np.median(near)),
        "within_the_ball": int(inside),
    }  # fmt: skip


def own_motion(minutes: float, seed: int = 4) -> dict[str, Any]:
    """Alarms of pads while both arms move, and their own signal drifts."""
    scene = pads(period=PERIOD)
    rig, motion = Rig(scene, seed=seed), swing(scene, 1.0)
    bench, frames, alarms = Bench(scene, rig, motion), 0, 0
    before = dict.fromkeys(scene.sensors, 0.0)
    for k in range(1, int(minutes * 60.0 / PERIOD)):
        t = PERIOD * k
        rig.drift = DRIFT * np.sin(2.0 * np.pi * t / WAVE)
        for name in scene.sensors:
            radius = bench.take(name, t)
            frames += 1
            alarms += radius > 0.0 and before[name] == 0.0
            before[name] = radius
    return {"minutes": minutes, "frames": frames, "alarms": int(alarms)}
