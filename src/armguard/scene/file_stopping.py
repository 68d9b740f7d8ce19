"""Stopping figures in the scene file's grammar, made of their declarations."""

from operator import attrgetter
from pathlib import Path
from typing import Annotated, Any

from pydantic import Discriminator, Field, Tag, create_model

from armguard.robot.stopping import FiguresError, StoppingFigures, TableFile
from armguard.robot.stopping.figures import FIGURES, Figure
from armguard.scene.schema import (
    ByJoint,
    Name,
    NotNegative,
    Positive,
    Strict,
    Triple,
    meanings,
)

Keys = tuple[str | int, ...]

# Infinite is an answer here: how hard a stop can be may be unknown.
Most = Annotated[float, Field(gt=0.0)]


def kind_of_tables(value: Any) -> str:
    """Which branch of `tables` a value is for."""
    if not isinstance(value, dict):
        return "branch-file"
    return "branch-chosen" if "file" in value else "branch-rows"


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


def type_of(figure: Figure) -> Any:
    """What the file may have for a figure."""
    by_joint: Any = ByJoint
    number: Any = Positive if figure.positive else NotNegative
    if not figure.bounded:
        number = Most
    return (by_joint[number] if figure.unit is None else number) | None


def figure_keys() -> type[Strict]:
    """A mapping with a key for each figure, and mappings where keys have dots."""
    groups: dict[str, dict[str, Any]] = {}
    means = meanings(StoppingFigures)
    for name, figure in FIGURES.items():
        group, _, key = figure.key.rpartition(".")
        given = Field(default=None, description=means.get(name))
        groups.setdefault(group, {})[key] = (type_of(figure), given)
    plain = groups.pop("")
    for group, keys in groups.items():
        name, doc = f"{group.title()}Model", f"Figures under `{group}`."
        model = create_model(name, __base__=Strict, __doc__=doc, **keys)
        plain[group] = (model, model())
    return create_model("FigureKeys", __base__=Strict, **plain)


class StoppingModel(figure_keys()):  # type: ignore[misc]
    """How a robot stops, and how well it is known where it is."""

    tables: TablesByKind | None = None
    sources: dict[str, str] | None = None


# Names of figures by their keys, as `sources` has them.
FIGURE_OF = {figure.key: name for name, figure in FIGURES.items()}


def stopping_arguments(model: StoppingModel, folder: Path) -> dict[str, Any]:
    """Figures that are given, by the names of `StoppingFigures`.

    Args:
        model: The entry.
        folder: Where the path of a table counts from.
    """
    given = {name: attrgetter(figure.key)(model) for name, figure in FIGURES.items()}
    given = {name: value for name, value in given.items() if value is not None}
    if model.sources is not None:
        given["sources"] = {
            FIGURE_OF.get(name, name): source for name, source in model.sources.items()
        }
    tables = model.tables
    if tables is not None:
        given["tables"] = tables
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
    figure = FIGURES.get(error.figure)
    keys = (figure.key if figure else error.figure).split(".") if error.figure else []
    for key in keys:
        entry = entry.get(key) if isinstance(entry, dict) else None
    by_joint = isinstance(entry, dict) and error.joint
    return ("stopping", *keys, *((error.joint,) if by_joint else ()))
