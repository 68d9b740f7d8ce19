"""What an episode is about: a scene, its figures, its rate; drawn from few of each."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
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
        floor: Distance to be kept beside what the figures require [m].
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
    changes: Mapping[str, Any] = field(default_factory=dict, hash=False)

    @property
    def figures(self) -> dict[str, Any]:
        """The declared figures, as `stopping_figures` takes them."""
        profiles = {**PROFILES, **SERVO_PROFILES}
        return {**profiles[self.profile], **self.changes}

    @property
    def name(self) -> str:
        """One word that identifies the settings."""
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


# Declared in place of zero where a figure must be > 0.
NONE = 1e-6

# What the plant really does while the term is declared as zero: large enough
# to stand out from what the guard adds for reasons of its own.
ENLARGED: Mapping[str, Mapping[str, Any]] = {
    "command": {"command": 0.03},
    "sensing": {"sensing": 0.015, "stale": 0.05},
    "period": {},
    "position_error": {"position_error": 0.01},
    "velocity_error": {"velocity_error": 0.2},
    "acceleration": {"acceleration": 40.0},
    "ramp": {"ramp": 0.06},
    "settle": {"settle": 0.03, "settle_time": 0.1},
    "deceleration": {},
    "model_error": {"model_error": 0.015},
    "base_error": {"base_error": 0.015},
    "top_speed": {},
    # A drive that can miss so fast that the stop comes too late.
    "tracking_error": {"tracking_error": 0.25, "acceleration": 40.0},
}

# Terms that only matter where commands go through the guard.
FILTERED_TERMS = ("tracking_error",)

TERMS = tuple(ENLARGED)

# Period and lateness of the plant where these are the term [s].
SLOW = (0.015, 0.005)

# Speed of the objects where that is the term [m/s].
FAST = 1.5

# How much stronger stops are declared than they are [-].
TOO_STRONG = 1.6


def enlarged(setting: Setting, term: str) -> Setting:
    """The setting as it truly is when a term is attacked: that term large, no floor.

    Args:
        setting: Setting of the episode.
        term: One of `TERMS`.
    """
    changes = {**setting.changes, **ENLARGED[term]}
    truth = replace(setting, profile="even", floor=0.0, changes=changes)
    if term == "period":
        truth = replace(truth, period=SLOW[0], late=SLOW[1])
        return replace(truth, changes={**changes, "stale": 0.05})
    if term == "top_speed":
        return replace(truth, top_speed=FAST)
    return truth


def understated(setting: Setting, term: str) -> Setting:
    """What is declared to the guard: the same, with one term as if it were nothing.

    Args:
        setting: The true setting.
        term: One of `TERMS`.
    """
    if term == "period":
        return replace(setting, period=NONE, late=0.0)
    if term == "top_speed":
        return replace(setting, top_speed=0.0)
    changes = {term: NONE if term == "acceleration" else 0.0}
    if term == "deceleration":
        figures = PROFILES[setting.profile]
        least = TOO_STRONG * figures["deceleration"]
        most = max(least, figures["deceleration_most"])
        changes = {"deceleration": least, "deceleration_most": most}
    return replace(setting, changes={**setting.changes, **changes})


@dataclass(frozen=True, slots=True)
class Plan:
    """A series of episodes.

    Attributes:
        scene: Name of the scene.
        mode: Mode of all robots.
        guard: Name of the guard.
        zero: Term of the budget that is declared as nothing, or None.
        large: Term that is as large, but declared as it is, or None: it shows that the
            term, and not its size, is the cause.
        weak_brake: Factor on the plant's decelerations [-].
        floor: Distance to be kept, in place of the settings' [m], or None.
        duration: Longest time of an episode [s].
        needless: Whether every stop is searched for a future that needed it.
        plant: "exact" for double integrators, "torque" for arms in MuJoCo that follow
            them with motors of limited torque.
        swing: "onwards" if joints swing beyond their rest only, "both" if back as well.
    """

    scene: str = "bay"
    mode: str = "path"
    guard: str = "armguard"
    zero: str | None = None
    large: str | None = None
    weak_brake: float = 1.0
    floor: float | None = None
    duration: float = 1.0
    needless: bool = False
    plant: str = "exact"
    swing: str = "onwards"

    @property
    def name(self) -> str:
        """One word that identifies the plan; the name of a file."""
        parts = [self.scene, self.mode, self.guard]
        parts += [f"zero-{self.zero}"] if self.zero else []
        parts += [f"large-{self.large}"] if self.large else []
        parts += [f"weak-{self.weak_brake:g}"] if self.weak_brake != 1.0 else []
        parts += [f"floor-{1e3 * self.floor:g}"] if self.floor is not None else []
        parts += [self.plant] if self.plant != "exact" else []
        parts += [f"swing-{self.swing}"] if self.swing != "onwards" else []
        parts += ["needless"] if self.needless else []
        parts += [f"for-{self.duration:g}"] if self.duration != 1.0 else []
        return "_".join(parts)

    @property
    def term(self) -> str | None:
        """The term that is large, declared as nothing or as it is."""
        return self.zero or self.large

    @property
    def attack(self) -> bool:
        """Whether plant and operator are the worst there are."""
        return self.term is not None or self.weak_brake != 1.0

    def truth_and_declared(self, seed: int) -> tuple[Setting, Setting]:
        """What is true in an episode, and what is declared to the guard."""
        profiles = SERVO_PROFILES if self.plant == "torque" else PROFILES
        truth = setting_of(self.scene, self.mode, seed, profiles)
        if self.floor is not None:
            truth = replace(truth, floor=self.floor)
        if self.term:
            truth = enlarged(truth, self.term)
        return truth, understated(truth, self.zero) if self.zero else truth
