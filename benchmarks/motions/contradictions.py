"""Velocities and positions that contradict each other; clean ones at their limits."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

from armguard.cli.console import say
from armguard.geometry import Pose, Sphere
from armguard.guard import Reason
from armguard.guard.watch import RUNNING
from armguard.respond import Guard
from armguard.robot.model import JointKind
from armguard.scene import Scene
from arrays import Floats
from robots import joint, robot_of

# What the arm is: joints, and its figures.
JOINTS = 6
PERIOD = 0.001
FIGURES: dict[str, float] = {
    "velocity": 2.0,
    "acceleration": 8.0,
    "deceleration": 4.0,
    "deceleration_most": 8.0,
    "position_error": 1e-4,
    "velocity_error": 0.01,
    "sensing": 0.002,
    "command": 0.004,
    "stale": 0.02,
}

# When a contradiction begins, and for how long it is waited [s].
BEGIN, PATIENCE = 0.3, 0.5

# Speeds it is played at [rad/s].
SPEEDS = (0.05, 0.1, 0.3, 1.0, 1.5)

# Longest motion until it is to be named [s].
SOON = 0.08


class Moving:
    """Joints that sway, each in its own time, and rest nowhere for long.

    Args:
        speed: Their greatest speed [rad/s].
        rng: Of the motion.
    """

    def __init__(self, speed: float, rng: np.random.Generator) -> None:
        # None accelerates by more than half of what it may.
        most = 0.5 * FIGURES["acceleration"]
        self.turn = np.minimum(rng.uniform(0.5, 3.0, JOINTS), most / speed)
        self.size = speed / self.turn * rng.choice([-1.0, 1.0], JOINTS)
        # Two joints that move alike may be taken for each other.
        self.size[1] = -np.sign(self.size[0]) * abs(self.size[1])
        # Half of the speed at least when the contradiction begins, and for a while.
        self.phase = rng.uniform(-0.4, 0.4, JOINTS) - self.turn * BEGIN

    def at(self, t: float) -> tuple[Floats, Floats]:
        """Positions and velocities."""
        angle = self.turn * t + self.phase
        return self.size * np.sin(angle), self.size * self.turn * np.cos(angle)


Wrong = Callable[[float, Moving], tuple[Floats, Floats]]


def velocities(change: Callable[[Floats], Floats]) -> Wrong:
    """Velocities are changed, positions are right."""
    return lambda t, m: (m.at(t)[0], change(m.at(t)[1]))


def positions(change: Callable[[Floats, Floats], Floats]) -> Wrong:
    """Positions are changed, by what they were at the beginning; velocities right."""
    return lambda t, m: (change(m.at(t)[0], m.at(BEGIN)[0]), m.at(t)[1])


def first(values: Floats, value: float) -> Floats:
    """The same, but for the first joint's."""
    return np.concatenate([[value], values[1:]])


def swapped(values: Floats) -> Floats:
    """The first two joints are taken for each other."""
    return np.concatenate([values[1::-1], values[2:]])


KINDS: dict[str, Wrong] = {
    "velocities stuck at 0": velocities(np.zeros_like),
    "one velocity stuck at 0": velocities(lambda v: first(v, 0.0)),
    "velocities stuck": lambda t, m: (m.at(t)[0], 0.5 * m.at(BEGIN)[1]),
    "velocities of the wrong sign": velocities(np.negative),
    "one velocity of the wrong sign": velocities(lambda v: first(v, -v[0])),
    "velocities half as large": velocities(lambda v: 0.5 * v),
    "velocities twice as large": velocities(lambda v: 2.0 * v),
    "velocities in degrees": velocities(np.degrees),
    "velocities of two joints swapped": velocities(swapped),
    "one velocity off by 0.04 rad/s": velocities(lambda v: first(v, v[0] + 0.04)),
    "positions stand still": positions(lambda q, was: was),
    "one position stands still": positions(lambda q, was: first(q, was[0])),
    "positions and velocities stand still": lambda t, m: m.at(BEGIN),
    "positions go half as far": positions(lambda q, was: 0.5 * (q + was)),
    "positions go back": positions(lambda q, was: 2.0 * was - q),
    "positions of two joints swapped": positions(lambda q, was: swapped(q)),
}


def guard_of_arm() -> Guard:
    """A guard of an arm that is far from all else."""
    names = ["base", *(f"link{k}" for k in range(JOINTS))]
    turns = {"lower": -20.0, "upper": 20.0, "xyz": (0.0, 0.0, 0.3)}
    joints = [
        joint(f"joint{k}", JointKind.REVOLUTE, *link, (0.0, 0.0, 1.0), **turns)
        for k, link in enumerate(pairwise(names))
    ]
    balls = dict.fromkeys(names[1:], Sphere(radius=0.02))
    model = robot_of("arm", joints, balls, Pose(xyz=(0.15, 0.0, 0.0)))
    scene = Scene(period=PERIOD, mode="speed")
    scene.add_robot(model, name="arm", stopping=dict(FIGURES))
    return Guard(scene, self_test=False)


def contradiction_figures(count: int, seed: int) -> dict[str, Any]:
    """How soon contradictions are named.

    Args:
        count: Plays of each kind at each speed.
        seed: Of the motions.
    """
    guard, rng = guard_of_arm(), np.random.default_rng(seed)
    rows = []
    for kind, wrong in KINDS.items():
        say(kind)
        for speed in SPEEDS:
            # What is still is measured without errors.
            noisy = "still" not in kind
            found = [named(guard, wrong, speed, rng, noisy) for _ in range(count)]
            times = [time for time, _ in found if time is not None]
            rows.append(
                {
                    "kind": kind,
                    "speed": speed,
                    "plays": count,
                    "named": len(times),
                    "soon": sum(time <= SOON for time in times),
                    "longest_ms": 1e3 * max(times, default=0.0),
                    "reasons": sorted({reason for _, reason in found if reason}),
                }
            )
    return {"rows": rows, "kinds": len(KINDS)}


def named(
    guard: Guard, wrong: Wrong, speed: float, rng: np.random.Generator, noisy: bool
) -> tuple[float | None, str]:
    """Time from the beginning of a contradiction until it is named, and how."""
    guard.reset()
    guard._watch.phase[:] = RUNNING
    moving = Moving(speed, rng)
    for k in range(int((BEGIN + PATIENCE) / PERIOD)):
        t = k * PERIOD
        q, v = moving.at(t) if t <= BEGIN else wrong(t, moving)
        if noisy:
            # Errors are at their limits; those of positions alternate.
            q = q + FIGURES["position_error"] * (-1.0) ** k
            v = v + FIGURES["velocity_error"] * rng.choice([-1.0, 1.0], len(v))
        verdict = guard.step(q, 5.0 + t, velocity=v, now=5.0 + t + 0.001)
        if verdict.reason >= Reason.NOT_FINITE:
            assert t > BEGIN, verdict.why
            return t - BEGIN, verdict.reason.name
    return None, ""


def clean_figures(count: int, seed: int) -> dict[str, Any]:
    """False alarms in cycles in which everything is as wrong as declared, and no more.

    Args:
        count: Cycles.
        seed: Of the motions.
    """
    guard, rng = guard_of_arm(), np.random.default_rng(seed)
    guard._watch.phase[:] = RUNNING
    q, v, aim = np.zeros(JOINTS), np.zeros(JOINTS), np.zeros(JOINTS)
    before, age, skew = np.zeros(JOINTS), 0.0, 0.0
    bias = np.ones(JOINTS)
    alarms: list[str] = []
    for k in range(count):
        if k % 100 == 0:
            # Towards the middle where it is far out; velocities up to half a period
            # off, their errors for a while the same.
            aim = rng.uniform(-1.8, 1.8, JOINTS)
            aim = np.where(np.abs(q) > 3.0, -np.sign(q) * np.abs(aim), aim)
            skew = float(rng.choice([-0.5, 0.0, 0.5]))
            bias = rng.choice([-1.0, 1.0], JOINTS)
        if k % 1_000_000 == 0:
            say(f"{k} of {count} clean cycles, {len(alarms)} alarms")
        now = 5.0 + k * PERIOD
        # The next sample is later by a period and what its age is less.
        later = 0.45 * FIGURES["sensing"] * rng.random()
        time = PERIOD + age - later
        most = FIGURES["acceleration"] * time
        change = np.clip(aim - v, -most, most)
        push = change / time if skew > 0.0 else before
        seen = v + skew * PERIOD * push + FIGURES["velocity_error"] * bias
        verdict = guard.step(
            q + FIGURES["position_error"] * (-1.0) ** k,
            now - age,
            velocity=seen,
            now=now,
        )
        if verdict.reason >= Reason.NOT_FINITE:
            alarms.append(verdict.why)
        q, v = q + (v + 0.5 * change) * time, v + change
        before, age = change / time, later
    return {"cycles": count, "alarms": len(alarms), "examples": alarms[:5]}
