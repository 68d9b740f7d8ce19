"""The true figures of one episode: drawn inside the declared ones, often at corners."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from armguard.robot.stopping import StoppingFigures
from arrays import Floats

# A stop of unknown greatest deceleration is up to this many times
# stronger than its least [-].
UNKNOWN = 5.0

# How times, decelerations and errors are drawn, and how often.
TIMES = {"most": 0.6, "random": 0.3, "least": 0.1}
STOPS = {"adverse": 0.4, "least": 0.2, "corner": 0.2, "most": 0.05, "random": 0.15}
ERRORS = {
    "adverse": 0.4,
    "quiet": 0.15,
    "bias": 0.15,
    "noise": 0.12,
    "alternating": 0.1,
    "none": 0.08,
}


@dataclass(frozen=True, slots=True)
class Styles:
    """How the figures of an episode are drawn.

    Attributes:
        times: Delays, ramps, lateness: "most", "random" or "least" of the declared.
        stops: Decelerations: "least", "most", "random"; "corner", each joint one of
            both ends; "adverse", least for joints that close in on the nearest pair,
            most for those that move away.
        errors: Of measurements: "adverse", largest, towards "farther and slower";
            "bias", largest, one sign for the episode; "noise"; "alternating", largest,
            the other sign each cycle; "quiet", as "adverse", but it drifts there, and
            nothing at rest seems to move; "none".
        full: Whether acceleration, speed and displacements are the declared ones.
    """

    times: str
    stops: str
    errors: str
    full: bool

    @classmethod
    def worst(cls, errors: str = "adverse") -> "Styles":
        """The corner that uses every term up."""
        return cls("most", "adverse", errors, True)

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> "Styles":
        """Random styles; a third of the time the worst."""
        if rng.random() < 1 / 3:
            return cls.worst()
        return cls(
            pick(rng, TIMES), pick(rng, STOPS), pick(rng, ERRORS), rng.random() < 0.7
        )


def pick(rng: np.random.Generator, weights: Mapping[Any, float]) -> Any:
    """One of some choices, by weight."""
    shares = np.array(list(weights.values()))
    return list(weights)[int(rng.choice(len(shares), p=shares / shares.sum()))]


def joined(figures: Iterable[StoppingFigures], name: str) -> Floats:
    """A figure of all joints of some arms, shape (n,)."""
    rows = [np.broadcast_to(getattr(f, name), f.velocity.shape) for f in figures]
    return np.concatenate(rows).astype(np.float64)


class Truth:
    """What is true in one episode of all arms together, joints in the order of q.

    Attributes:
        velocity: Top speeds, shape (n,).
        acceleration: Accelerations, shape (n,).
        brake: Decelerations of brakes, shape (n,).
        slowest: Least decelerations of stops, shape (n,).
        position_error: Largest errors of measured positions, shape (n,).
        velocity_error: Largest errors of measured velocities, shape (n,).
        base_shifts: Where each arm's base truly is, from where it should be, (4, 4).
        outer: How far the true surface of each arm lies outside its model, (a,) [m].

    Args:
        rng: Of the episode.
        figures: Declared figures of each arm.
        styles: How to draw.
        weak: Factor on decelerations of stops; below 1 the plant breaks its word [-].
        swings_back: Whether a joint may also swing back before its rest.
    """

    def __init__(
        self,
        rng: np.random.Generator,
        figures: Sequence[StoppingFigures],
        styles: Styles,
        weak: float = 1.0,
        *,
        swings_back: bool = False,
    ) -> None:
        self.rng = rng
        self.swings_back = swings_back
        self.figures = figures
        self.styles = styles
        self.weak = weak
        self.velocity = joined(self.figures, "velocity") * self._share(0.5)
        self.acceleration = joined(self.figures, "acceleration") * self._share(0.3)
        self.brake = joined(self.figures, "brake_deceleration") / self._share(0.5)
        self.slowest = joined(self.figures, "deceleration")
        self.position_error = joined(self.figures, "position_error")
        self.velocity_error = joined(self.figures, "velocity_error")
        self.base_shifts = [self._shift(f) for f in figures]
        self.outer = np.array([f.model_error * self._share(0.0) for f in figures])

    def delay(self, longest: float) -> float:
        """A delay within its bound [s]."""
        if self.styles.times == "random":
            return float(self.rng.uniform(0.0, longest))
        return longest if self.styles.times == "most" else 0.0

    def delays(self, longest: float, count: int) -> Floats:
        """Delays within their bound, shape (count,) [s]."""
        if self.styles.times == "random":
            return self.rng.uniform(0.0, longest, count)
        return np.full(count, self.delay(longest))

    def lateness(self, cycle: int, longest: float) -> float:
        """How late a cycle comes: at the worst, every other one as late as it may."""
        if self.styles.times == "most":
            return longest if cycle % 2 else 0.0
        return self.delay(longest)

    def command_delay(self, arm: int) -> float:
        """Time until an arm's drives obey a stop ordered now [s]."""
        return self.delay(self.figures[arm].command)

    def brake_delay(self, arm: int) -> float:
        """Time until an arm's brake holds [s]."""
        return self.delay(self.figures[arm].brake_delay)

    def stop(self, closing: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Figures of a stop ordered now, for all joints.

        Args:
            closing: > 0 for joints that bring the nearest pair together, < 0 for those
                that take it apart, shape (n,).

        Returns:
            Deceleration, ramp [s], swing of a stop from the plant's top speed, negative
            for a swing back, and its time [s]; each shape (n,).
        """
        n = len(self.velocity)
        least = joined(self.figures, "deceleration")
        most = np.minimum(joined(self.figures, "deceleration_most"), UNKNOWN * least)
        times = np.array([self.delay(1.0) for _ in range(n)])
        style = self.styles.stops
        strength = np.full(n, float(style == "most"))
        if style == "random":
            strength = self.rng.uniform(0.0, 1.0, n)
        elif style == "corner":
            strength = self.rng.integers(0, 2, n).astype(np.float64)
        elif style == "adverse":
            strength = (closing < 0.0).astype(np.float64)
            times = np.where(strength > 0.0, 0.0, times)
        ramp = times * joined(self.figures, "ramp")
        swing = times * joined(self.figures, "settle")
        if self.swings_back:
            # At the worst towards the nearest pair: back where a joint moves away.
            away = closing < 0.0 if style == "adverse" else self.rng.random(n) < 0.5
            swing = np.where(away, -joined(self.figures, "settle"), swing)
        swing *= self.velocity / joined(self.figures, "velocity")
        duration = joined(self.figures, "settle_time") * self.rng.uniform(0.3, 1.0, n)
        return self.weak * (least + strength * (most - least)), ramp, swing, duration

    @property
    def follows(self) -> bool:
        """Whether errors of measurements go where nothing seems near."""
        return self.styles.errors in ("adverse", "quiet")

    def errors(self, cycle: int, signs: Floats) -> Floats:
        """Signs and sizes of the errors of a cycle, in shares of the largest, (n,).

        Those that follow a gradient are these where there is none.

        Args:
            cycle: Its number.
            signs: Signs drawn for the episode, shape (n,).
        """
        style = self.styles.errors
        if style == "noise":
            return self.rng.uniform(-1.0, 1.0, len(signs))
        if style == "alternating":
            return signs if cycle % 2 else -signs
        return np.zeros(len(signs)) if style == "none" else signs

    def _share(self, least: float) -> float:
        """Share of a declared figure that is true."""
        return 1.0 if self.styles.full else float(self.rng.uniform(least, 1.0))

    def _shift(self, figures: StoppingFigures) -> Floats:
        """A displacement of a base, most of the time the largest."""
        T = np.eye(4)
        way, axis = self.rng.normal(size=(2, 3))
        way *= figures.base_error * self._share(0.0) / np.linalg.norm(way)
        axis *= figures.base_turn * self._share(0.0) / np.linalg.norm(axis)
        T[:3, :3] = Rotation.from_rotvec(axis).as_matrix()
        T[:3, 3] = way
        return T
