"""Stopping figures in the scene file's grammar."""

from pathlib import Path
from typing import Annotated, Any

from pydantic import Discriminator, Field, Tag

from armguard.robot.stopping import FiguresError, TableFile
from armguard.scene.schema import (
    ByJoint,
    Name,
    NotNegative,
    Positive,
    Strict,
    Triple,
)

Keys = tuple[str | int, ...]


def kind_of_tables(value: Any) -> str:
    """Which branch of `tables` a value is meant for."""
    if not isinstance(value, dict):
        return "branch-file"
    return "branch-chosen" if "file" in value else "branch-rows"


# Infinite is an answer here: nobody knows how hard a stop can be.
Most = Annotated[float, Field(gt=0.0)]


class BrakeModel(Strict):
    """A stop that removes power at once."""

    delay: NotNegative | None = None
    deceleration: ByJoint[Positive] | None = None


class ErrorsModel(Strict):
    """How well it is known where the robot is."""

    position: ByJoint[NotNegative] | None = None
    velocity: ByJoint[NotNegative] | None = None
    tracking: ByJoint[NotNegative] | None = None
    model: NotNegative | None = None
    base: NotNegative | None = None
    base_turn: NotNegative | None = None


class DelaysModel(Strict):
    """How late measurements and orders are."""

    sensing: NotNegative | None = None
    command: NotNegative | None = None
    stale: NotNegative | None = None


class TableFileModel(Strict):
    """A file of measured stops, and the conditions that are met here."""

    file: Name
    load: NotNegative | None = None
    extension: NotNegative | None = None


TablesByKind = Annotated[
    Annotated[Name, Tag("branch-file")]
    | Annotated[TableFileModel, Tag("branch-chosen")]
    | Annotated[
        dict[str, Annotated[list[Triple], Field(min_length=1)]],
        Tag("branch-rows"),
    ],
    Discriminator(kind_of_tables),
]


class StoppingModel(Strict):
    """How a robot stops, and how well it is known where it is."""

    velocity: ByJoint[Positive] | None = None
    acceleration: ByJoint[Positive] | None = None
    deceleration: ByJoint[Positive] | None = None
    most: ByJoint[Most] | None = None
    ramp: NotNegative | None = None
    settle: ByJoint[NotNegative] | None = None
    settle_time: NotNegative | None = None
    brake: BrakeModel = BrakeModel()
    errors: ErrorsModel = ErrorsModel()
    delays: DelaysModel = DelaysModel()
    tables: TablesByKind | None = None
    sources: dict[str, str] | None = None


# Where the file has a figure that `StoppingFigures` calls by another name.
KEYS_OF: dict[str, Keys] = {
    "deceleration_most": ("most",),
    "brake_delay": ("brake", "delay"),
    "brake_deceleration": ("brake", "deceleration"),
    "position_error": ("errors", "position"),
    "velocity_error": ("errors", "velocity"),
    "tracking_error": ("errors", "tracking"),
    "model_error": ("errors", "model"),
    "base_error": ("errors", "base"),
    "base_turn": ("errors", "base_turn"),
    "sensing": ("delays", "sensing"),
    "command": ("delays", "command"),
    "stale": ("delays", "stale"),
}
PLAIN = (
    "velocity",
    "acceleration",
    "deceleration",
    "ramp",
    "settle",
    "settle_time",
    "tables",
)
# Names of figures as `sources` has them: the keys with dots.
FIGURE_OF = {".".join(map(str, keys)): figure for figure, keys in KEYS_OF.items()}


def stopping_arguments(model: StoppingModel, folder: Path) -> dict[str, Any]:
    """Figures that are given, by the names of `StoppingFigures`.

    Args:
        model: The entry.
        folder: Where the path of a table counts from.
    """
    given: dict[str, Any] = {}
    for figure in (*PLAIN, *KEYS_OF):
        value: Any = model
        for key in KEYS_OF.get(figure, (figure,)):
            value = getattr(value, str(key))
        if value is not None:
            given[figure] = value
    if model.sources is not None:
        given["sources"] = {
            FIGURE_OF.get(name, name): source for name, source in model.sources.items()
        }
    tables = given.get("tables")
    if isinstance(tables, str):
        given["tables"] = TableFile(path=folder / tables)
    if isinstance(tables, TableFileModel):
        given["tables"] = TableFile(
            path=folder / tables.file, load=tables.load, extension=tables.extension
        )
    return given


def keys_of_figure(error: FiguresError, entry: Any) -> Keys:
    """Where in a robot's entry the figure is that an error is about.

    Args:
        error: The error.
        entry: The robot's `stopping` as the file has it, None if it has none.
    """
    keys = KEYS_OF.get(error.figure, (error.figure,) if error.figure else ())
    for key in keys:
        entry = entry.get(key) if isinstance(entry, dict) else None
    by_joint = isinstance(entry, dict) and error.joint
    return ("stopping", *keys, *((error.joint,) if by_joint else ()))
