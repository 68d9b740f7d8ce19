"""Jobs of fleets: which inputs, in which scenes, with which settings."""

from itertools import product
from math import inf, nan
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from armguard.errors import ArmguardError
from armguard.scene.schema import (
    Name,
    NotNegative,
    Number,
    Positive,
    Strict,
    model_of,
)
from armguard.scene.yaml_source import YamlSource
from armguard.simulation.judge import JudgeName

# Settings of a sweep that are of plans or of the simulated robots, by the work that has
# them; all others are those of `armguard replay`.
OF_WORK = {
    "verify": ("following_error", "skew"),
    "run": ("plant.errors", "plant.lateness"),
}

GIGABYTE = 1 << 30

# Longest time of an episode with a random motion [s], and of another motion, in times
# of its own.
RANDOM_DURATION, TIMES_AS_LONG = 5.0, 3.0


class FleetError(ArmguardError, ValueError):
    """A job, its inputs or its results are not as required."""


class JointEntry(Strict):
    """Which joint of the scene a column of a dataset has, and in which numbers.

    Attributes:
        joint: 'robot/joint', or the joint alone if one robot has it.
        scale: What a number of the dataset is multiplied by [rad or m].
        zero: What is added then [rad or m].
    """

    joint: Name
    scale: Number | None = None
    zero: Number = 0.0


class JobModel(Strict):
    """A job of a fleet.

    Attributes:
        inputs: Recordings, plans, LeRobot datasets, folders and patterns of them, and
            random motions.
        scenes: Scene files; each input is judged in each of them.
        sweep: Values of settings by name; every combination is judged.
        joints: Joint of each column of datasets, None to leave one out; by default
            columns have the names of joints.
        units: Unit of the joint positions of datasets.
        hold_home: Whether joints without a column stay at home.
        guard: Whether the guard judges each frame of an audit as well.
        rest_offset: Greatest difference of leader and follower at rest [rad or m].
        interpolation: See `Plan.of`.
        duration: Longest time of an episode; by default `RANDOM_DURATION` of random
            motions, and `TIMES_AS_LONG` times that of a motion [s].
        judge: Judge of true states, see `judge_of`; by default Coal where it is
            installed and knows all shapes.
        memory: Memory that a part of the work may take [GB].
        time_limit: Time that a part may take; by default twenty times the median [s].
    """

    inputs: Annotated[list[Name], Field(min_length=1)]
    scenes: list[Name] = Field(default_factory=list)
    sweep: dict[Name, Annotated[list[str | float | bool], Field(min_length=1)]] = Field(
        default_factory=dict
    )
    joints: dict[Name, JointEntry | Name | None] = Field(default_factory=dict)
    units: Literal["radians", "degrees"] = "radians"
    hold_home: bool = False
    guard: bool = True
    rest_offset: NotNegative = 0.05
    interpolation: Literal["linear", "cubic", "quintic"] | None = None
    duration: Positive | None = None
    judge: JudgeName | None = None
    memory: Positive = 2.0
    time_limit: Positive | None = None

    def settings(self) -> list[dict[str, str]]:
        """Every combination of the sweep, values as text."""
        values = [[in_words(one) for one in each] for each in self.sweep.values()]
        return [dict(zip(self.sweep, one, strict=True)) for one in product(*values)]


def in_words(value: str | float | bool) -> str:
    """A value of a setting as text."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def read_job(path: Path) -> JobModel:
    """The job of a file.

    Raises:
        SceneFileError: It is no job of a fleet.
    """
    return model_of(YamlSource(path), JobModel, JointEntry)


def split_settings(
    work: str, settings: dict[str, str]
) -> tuple[dict[str, str], dict[str, float]]:
    """Settings of the scene, and those of the work.

    Raises:
        FleetError: One of the latter is no number from 0 on, or of other work.
    """
    scene, own = dict[str, str](), dict[str, float]()
    for name, text in settings.items():
        of = next((each for each, names in OF_WORK.items() if name in names), None)
        if of is None:
            scene[name] = text
        elif of != work:
            raise FleetError(f"sweep: {name} is a setting of `{of}` alone")
        else:
            own[name] = not_negative(name, text)
    return scene, own


def not_negative(name: str, text: str) -> float:
    """A setting of the work as a number."""
    try:
        value = float(text)
    except ValueError:
        value = nan
    if not 0.0 <= value < inf:
        raise FleetError(f"sweep: {name} is '{text}'; it must be a number from 0 on")
    return value
