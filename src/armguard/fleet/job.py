"""Jobs of fleets: which inputs, in which scenes, with which settings."""

from collections.abc import Iterator
from itertools import product
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

# Settings of a sweep that are of plans; all others are those of `armguard replay`.
OF_PLANS = ("following_error", "skew")

GIGABYTE = 1 << 30


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
        inputs: Recordings, plans, LeRobot datasets, folders and patterns of them.
        scenes: Scene files; each input is judged in each of them.
        sweep: Values of settings by name; every combination is judged.
        joints: Joint of each column of datasets, None to leave one out; by default
            columns have the names of joints.
        units: Unit of the joint positions of datasets.
        hold_home: Whether joints without a column stay at home.
        guard: Whether the guard judges each frame of an audit as well.
        rest_offset: Greatest difference of leader and follower at rest [rad or m].
        interpolation: See `Plan.of`.
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


def split_settings(settings: dict[str, str]) -> tuple[dict[str, str], dict[str, float]]:
    """Settings of the scene, and those of plans.

    Raises:
        FleetError: One of the latter is no number.
    """
    scene = {name: text for name, text in settings.items() if name not in OF_PLANS}
    return scene, dict(numbers(settings))


def numbers(settings: dict[str, str]) -> Iterator[tuple[str, float]]:
    """Settings of plans as numbers."""
    for name in OF_PLANS:
        if name in settings:
            try:
                yield name, float(settings[name])
            except ValueError:
                raise FleetError(
                    f"sweep: {name} is '{settings[name]}'; it must be a number"
                ) from None
