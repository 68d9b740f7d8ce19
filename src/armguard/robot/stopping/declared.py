"""Figures as they are declared or published, each with where it is from.

Every figure of a robot by name says in `sources` where it is from. What holds the word
"assumption:" we could not trace to its maker: it is a careful guess, to be replaced by
your robot's manual or by a measurement of yours.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from armguard.errors import ModelError
from armguard.robot.known_arms import family_figures, known_arms
from armguard.robot.model import RobotModel
from armguard.robot.named import ROBOTS, robot_data
from armguard.robot.stopping.figures import (
    FIGURES,
    KEYS,
    FiguresError,
    PerJoint,
    StoppingFigures,
    by_attribute,
    check_names,
    stopping_figures,
    urdf_velocity,
)
from armguard.robot.stopping.table import StopTable
from armguard.robot.stopping.table_file import TableFile, read_stop_tables

# How the source of a figure is marked that is neither measured nor published.
ASSUMPTION = "assumption: "

# What a figure is from that is neither declared nor known of the robot.
DEFAULTS = {
    "velocity": "the URDF's speed limits",
    "acceleration": ASSUMPTION + "twice the deceleration",
    "deceleration": "the measured stops of `tables`",
    "deceleration_most": ASSUMPTION + "infinite, not declared",
    "brake_deceleration": ASSUMPTION + "a brake holds no less than a controlled stop",
}
DEFAULT = ASSUMPTION + "armguard's default"

# Figures that no data file has.
NO_ERROR = ASSUMPTION + "0: the URDF is right, and the base is where the scene says"
NO_ERRORS = dict.fromkeys(("model_error", "base_error", "base_turn"), NO_ERROR)

Tables = Mapping[str, StopTable | Sequence[Sequence[float]]] | TableFile | str | Path


def declared_figures(
    model: RobotModel,
    declared: Mapping[str, Any],
    own: StoppingFigures | None = None,
) -> StoppingFigures:
    """Figures as declared, the rest from the robot's own or defaults.

    A declared deceleration takes the place of the robot's own measured tables and of
    its own greatest deceleration too: these describe another stop.

    Args:
        model: The robot.
        declared: Figures by the keys of a scene file, such as
            `{"deceleration": 5.0, "errors": {"position": 1e-3}}`, or arguments of
            `stopping_figures`. `tables` may also be a CSV file, see `read_stop_tables`,
            or rows of speed, time and travel by joint name; a joint with a table needs
            no deceleration.
        own: The robot's own figures, if it has some.

    Raises:
        FiguresError: A figure is missing, is none, or cannot be true.
    """
    declared = by_attribute(declared)
    check_names(declared)
    arguments: dict[str, Any] = {}
    sources: dict[str, str] = {}
    if own is not None:
        replaced = {"sources", *declared}
        if "deceleration" in declared:
            replaced |= {"deceleration_most", "tables"}
        arguments = {key: getattr(own, key) for key in KEYS if key not in replaced}
        sources = {key: own.sources[key] for key in arguments if key in own.sources}
    arguments |= declared
    if "tables" in declared:
        tables = stop_tables(model, declared["tables"], arguments.get("velocity"))
        arguments["tables"] = tables
        arguments["deceleration"] = with_tables(
            model, arguments.get("deceleration"), tables
        )
    for key in FIGURES:
        if key not in declared and key not in sources:
            sources[key] = DEFAULTS.get(key, DEFAULT)
    arguments["sources"] = sources | dict(declared.get("sources") or {})
    return stopping_figures(model, **arguments)


def stop_tables(
    model: RobotModel, tables: Tables, velocity: PerJoint | None
) -> dict[str, StopTable]:
    """Tables by joint name, from a file or from rows.

    Args:
        model: The robot.
        tables: What is declared.
        velocity: Top speeds, those of the URDF if None.

    Raises:
        FiguresError: They cannot be read, or cannot be true.
    """
    if isinstance(tables, str | Path):
        tables = TableFile(path=Path(tables))
    if isinstance(tables, TableFile):
        speeds = urdf_velocity(model) if velocity is None else velocity
        top = FIGURES["velocity"].of("velocity", model, speeds).tolist()
        return read_stop_tables(
            tables, model, dict(zip(model.q_names, top, strict=True))
        )
    made = {}
    for joint, rows in tables.items():
        if isinstance(rows, StopTable):
            made[joint] = rows
            continue
        try:
            columns = [tuple(float(row[k]) for row in rows) for k in range(3)]
            made[joint] = StopTable(*columns)
        except ModelError as error:
            raise FiguresError(f"joint '{joint}': {error}", "tables", joint) from None
    return made


def with_tables(
    model: RobotModel,
    deceleration: PerJoint | None,
    tables: Mapping[str, StopTable],
) -> PerJoint | None:
    """Decelerations, of joints that have none those of their measured stops.

    Raises:
        FiguresError: A joint has neither.
    """
    if deceleration is not None and not isinstance(deceleration, Mapping):
        return deceleration
    found = dict(deceleration or {})
    for name in model.q_names:
        if name not in found and name not in tables:
            raise FiguresError(
                f"joint '{name}' has no deceleration and no table of measured stops",
                "deceleration",
            )
        if name not in found:
            found[name] = tables[name].deceleration
    return found


def named_figures(name: str, model: RobotModel) -> StoppingFigures | None:
    """Stopping figures of a robot by name, None if it has none.

    Args:
        name: Its name in `armguard.robot.named.ROBOTS`.
        model: The robot.
    """
    if name not in ROBOTS:
        return None
    data = robot_data(name)
    if "figures" not in data:
        return known_figures(model)
    if isinstance(data["figures"], str):
        data = robot_data(data["figures"])
    rows = data["figures"]
    groups = data.get("joints", {})
    return stopping_figures(
        model,
        **{key: by_joint(row["value"], groups) for key, row in rows.items()},
        sources={**{key: row["source"] for key, row in rows.items()}, **NO_ERRORS},
    )


def known_figures(model: RobotModel) -> StoppingFigures | None:
    """Stopping figures of a robot whose arms are recognised.

    Args:
        model: The robot.

    Returns:
        The figures of the arms' family; None if no arm is recognised, or if the arms
        are of several families.
    """
    arms = known_arms(model)
    if len({arm.family for arm in arms}) != 1:
        return None
    titles = ", ".join(sorted({arm.title for arm in arms}))
    values, sources = family_figures(arms[0].family)
    most = values.pop("velocity")
    limits = {name: model.joints[name].velocity for name in model.q_names}
    return stopping_figures(
        model,
        **values,
        velocity={name: min(most, limit or most) for name, limit in limits.items()},
        sources={
            **{key: f"{source} ({titles})" for key, source in sources.items()},
            "brake_deceleration": DEFAULTS["brake_deceleration"],
            **NO_ERRORS,
        },
    )


def by_joint(value: Any, groups: Mapping[str, list[str]]) -> Any:
    """A figure by joint name; in the data it is a number, or one or several a group."""
    if not isinstance(value, Mapping):
        return value
    found: dict[str, float] = {}
    for group, given in value.items():
        joints = groups[group]
        several = given if isinstance(given, list) else [given] * len(joints)
        found |= zip(joints, several, strict=True)
    return found
