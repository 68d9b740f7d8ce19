"""What an episode is about: a scene, its figures, its rate; drawn from few of each."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from typing import Any

# Grid of all instants of an episode: measurements, cycles, states that are judged [s].
SUBSTEP = 0.00025

# Figures of arms by profile, as `stopping_figures` takes them. Each makes another
# term of the guard's budget the large one.
PROFILES: Mapping[str, Mapping[str, Any]] = {
    # A research arm on its own controller: short delays, strong and even.
    "even": {
        "acceleration": 8.0,
        "deceleration": 4.0,
        "deceleration_most": 6.0,
        "ramp": 0.005,
        "settle": 0.001,
        "settle_time": 0.05,
        "brake_delay": 0.05,
        "brake_deceleration": 8.0,
        "position_error": 1e-4,
        "velocity_error": 0.005,
        "sensing": 0.002,
        "command": 0.004,
        "stale": 0.02,
    },
    # A large arm over a fieldbus: weak brakes of unknown greatest strength, long ramp.
    "weak": {
        "acceleration": 3.0,
        "deceleration": 1.5,
        "deceleration_most": inf,
        "ramp": 0.03,
        "settle": 0.005,
        "settle_time": 0.12,
        "brake_delay": 0.1,
        "brake_deceleration": 3.0,
        "position_error": 5e-4,
        "velocity_error": 0.02,
        "sensing": 0.004,
        "command": 0.010,
        "stale": 0.03,
        "base_error": 0.001,
        "base_turn": 0.001,
    },
    # A light arm that accelerates hard; its model and its base are known less well.
    "hard": {
        "acceleration": 25.0,
        "deceleration": 12.0,
        "deceleration_most": 40.0,
        "ramp": 0.002,
        "settle": 0.0005,
        "settle_time": 0.02,
        "brake_delay": 0.03,
        "brake_deceleration": 20.0,
        "position_error": 2e-4,
        "velocity_error": 0.05,
        "sensing": 0.001,
        "command": 0.002,
        "stale": 0.02,
        "model_error": 0.002,
        "base_error": 0.002,
        "base_turn": 0.002,
    },
}

# Figures of arms whose motors have limited torque, in turns. The arms of `torque.py`
# keep them with any payload they may carry; every episode checks it.
SERVO_PROFILES: Mapping[str, Mapping[str, Any]] = {
    "servo": {
        "velocity": 1.0,
        "acceleration": 2.5,
        "deceleration": 1.5,
        "deceleration_most": 3.0,
        "ramp": 0.03,
        "settle": 0.003,
        "settle_time": 0.15,
        "brake_delay": 0.05,
        "brake_deceleration": 1.5,
        "position_error": 1e-3,
        "velocity_error": 0.08,
        "tracking_error": 0.06,
        "sensing": 0.002,
        "command": 0.006,
        "stale": 0.02,
    },
}

# Period, lateness [s] and floor [m] that go together, by number.
RATES = (
    (0.001, 0.0, 0.0),
    (0.001, 0.0005, 0.005),
    (0.002, 0.0005, 0.002),
    (0.004, 0.001, 0.0),
)

# Greatest speed of objects that move [m/s].
TOP_SPEED = 0.4

SCENES = ("bay", "movers", "pandas")


@dataclass(frozen=True, slots=True)
class Setting:
    """Everything a guard is built from.

    Attributes:
        scene: Name of the scene, one of `SCENES`.
        mode: Mode of all its robots.
        profile: Figures of all its arms, a name in `PROFILES` or `SERVO_PROFILES`.
        period: Time from one cycle to the next [s].
        late: How much later a cycle may come [s].
        floor: Distance to be kept beside what the figures ask for [m].
        top_speed: Greatest speed of objects that move [m/s].
        changes: Figures other than the profile's.
    """

    scene: str
    mode: str
    profile: str
    period: float
    late: float
    floor: float
    top_speed: float = TOP_SPEED
    changes: Mapping[str, Any] = field(default_factory=dict)

    @property
    def figures(self) -> dict[str, Any]:
        """The declared figures, as `stopping_figures` takes them."""
        profiles = {**PROFILES, **SERVO_PROFILES}
        return {**profiles[self.profile], **self.changes}

    @property
    def name(self) -> str:
        """One word that tells settings apart."""
        numbers = (self.period, self.late, self.floor, self.top_speed)
        times = "-".join(f"{1e3 * x:g}" for x in numbers)
        changes = "".join(f",{k}={v}" for k, v in sorted(self.changes.items()))
        return f"{self.scene}/{self.mode}/{self.profile}/{times}{changes}"


def setting_of(
    scene: str, mode: str, number: int, profiles: Mapping[str, Any] = PROFILES
) -> Setting:
    """The setting of an episode: profiles and rates in turns.

    Args:
        scene: Name of the scene.
        mode: Mode of its robots.
        number: The episode's.
        profiles: Figures that are taken in turns.
    """
    profile = tuple(profiles)[number % len(profiles)]
    period, late, floor = RATES[number // len(profiles) % len(RATES)]
    return Setting(scene, mode, profile, period, late, floor)
