"""A carriage on a rail before a wall: a guard of one joint whose truth is a line."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from armguard.geometry import Box, Pose, Sphere
from armguard.respond import Guard
from armguard.scene import Scene
from robots import carriage

# Radius of the carriage, place of the wall's face, how far the joint goes [m].
RADIUS = 0.05
WALL = 10.0
LIMIT = 40.0

# What every pair keeps [m].
BUFFER = 0.005


@dataclass(frozen=True)
class Corner:
    """Declared figures at a corner of what they may be.

    Attributes:
        period: Time from one cycle to the next [s].
        late: How much later one may come [s].
        figures: Stopping figures.
    """

    period: float
    late: float
    figures: dict[str, float]


def corner_of(rng: np.random.Generator) -> Corner:
    """Some figures: each of them small or large."""

    def either(low: float, high: float) -> float:
        return float(rng.choice([low, high]))

    deceleration = either(2.0, 8.0)
    sensing = either(0.0, 0.003)
    figures = {
        "velocity": 1.5,
        "acceleration": either(2.0, 10.0),
        "deceleration": deceleration,
        "deceleration_most": either(2.0 * deceleration, np.inf),
        "ramp": either(0.0, 0.05),
        "position_error": either(0.0, 2e-4),
        "velocity_error": either(5e-4, 0.02),
        "sensing": sensing,
        "command": either(0.0, 0.01),
        "stale": sensing + 0.02,
    }
    return Corner(either(0.001, 0.004), either(0.0, 0.001), figures)


@cache
def guard_of(number: int) -> tuple[Corner, Guard]:
    """Figures of a number, and a guard of a carriage that has them."""
    corner = corner_of(np.random.default_rng(number))
    scene = Scene(
        period=corner.period, late=corner.late, buffer=BUFFER, margin=0.5, mode="path"
    )
    ball = carriage(Sphere(radius=RADIUS), LIMIT)
    scene.add_robot(ball, name="carriage", stopping=dict(corner.figures))
    wall = Pose(xyz=(WALL + 0.5, 0.0, 0.0))
    scene.add(Box(half_extents=(0.5, 1.0, 1.0)), name="wall", pose=wall)
    return corner, Guard(scene, self_test=False)


class Truth:
    """Where the carriage truly is: it goes evenly until a stop takes effect.

    Args:
        place: Where it is at time 0 [m].
        speed: Its speed [m/s].
        stop: Delay [s], ramp [s] and deceleration [m/s²] of its stop.
    """

    def __init__(
        self, place: float, speed: float, stop: tuple[float, float, float]
    ) -> None:
        self.place, self.speed, self.stop = place, speed, stop
        self.effect = np.inf

    def order(self, now: float) -> None:
        """Have it stop, unless it was to already."""
        self.effect = min(self.effect, now + self.stop[0])

    def at(self, time: float) -> tuple[float, float]:
        """Position [m] and speed [m/s]."""
        if time <= self.effect:
            return self.place + self.speed * time, self.speed
        since, (_, ramp, least) = time - self.effect, self.stop
        rising = min(ramp, np.sqrt(2.0 * ramp * self.speed / least))
        rest = rising
        if rising == ramp:
            rest += (self.speed - 0.5 * least * ramp) / least
        t = min(since, rest)
        up = min(t, rising)
        full = t - up
        jerk = least / ramp if ramp > 0.0 else 0.0
        risen = self.speed - 0.5 * jerk * up * up
        way = self.speed * up - jerk * up**3 / 6.0 + risen * full
        way -= 0.5 * least * full * full
        left = risen - least * full if t < rest else 0.0
        return self.place + self.speed * self.effect + way, max(left, 0.0)


Given = dict[str, Any]
