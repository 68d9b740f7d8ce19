"""Requests of operators: converted to arrays, or refused with a reason in words."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.errors import known_names
from armguard.guard.given import (
    FLOAT64,
    JointVector,
    described,
    is_mapping,
    joined,
    kind_of,
    real_array,
)
from armguard.guard.levels import ORDERED, Reason
from armguard.respond.state import MOST_TWISTS, TOOL_POINT, TOOL_TWIST, TWIST_ROW
from armguard.respond.tool import Tools
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]

# Numbers of a twist.
TWIST_PARTS = ("vx", "vy", "vz", "wx", "wy", "wz")


def as_vector(
    what: str, value: object, names: Sequence[str]
) -> tuple[Floats | None, str]:
    """A vector of finite numbers, or None and the reason in words.

    Args:
        what: Name of the vector.
        value: The vector.
        names: Names of its numbers.
    """
    count = len(names)
    order = "vx, vy, vz, wx, wy, wz" if names is TWIST_PARTS else "guard.q_names"
    wanted = f"it must be {count} numbers in the order of {order}"
    try:
        array = real_array(value)
    except Exception:  # whatever a stranger's object raises, the loop goes on
        return None, f"{what} is a {kind_of(value)}; {wanted}"
    if array.shape != (count,):
        return None, f"{what} has shape {array.shape}; {wanted}"
    if not np.isfinite(array).all():
        k = int((~np.isfinite(array)).argmax())
        return None, f"{what} of '{names[k]}' is {array[k]}; it must be finite"
    return array, ""


def positions_in(value: JointVector, tables: SceneTables) -> tuple[Floats | None, str]:
    """Desired joint positions as a kernel takes them, or None and the reason."""
    if is_mapping(value):
        return robot_vectors("q_desired", value, tables)
    return as_vector("q_desired", value, tables.q_names)


def robot_vectors(
    what: str,
    value: Mapping[str, ArrayLike],
    tables: SceneTables,
    *,
    partial: bool = False,
) -> tuple[Floats | None, str]:
    """A vector of finite numbers from vectors by robot name, see `joined`."""
    vector, fault = joined(what, value, tables.robots, partial=partial)
    if fault:
        return None, fault
    return as_vector(what, vector, tables.q_names)


def velocities_in(
    value: JointVector | Mapping[str, float],
    shape: tuple[int, ...],
    tables: SceneTables,
) -> tuple[Floats | None, str]:
    """Joint velocities as a kernel takes them, or None and the reason in words."""
    if (
        type(value) is np.ndarray
        and value.dtype is FLOAT64
        and value.shape == shape
        and value.flags.carray
    ):
        return value, ""
    if is_mapping(value):
        return named_velocities(value, tables)
    return as_vector("v_desired", value, tables.q_names)


def named_velocities(
    value: Mapping[str, ArrayLike], tables: SceneTables
) -> tuple[Floats | None, str]:
    """Velocities by joint name or by robot name; zero for those not named."""
    what, names = "v_desired", tables.q_names
    robots = [part.name for part in tables.robots]
    try:
        if any(name in robots for name in value):
            return robot_vectors(what, value, tables, partial=True)
        for name in value:
            if name not in names:
                wrong = f"{what} names {described(name)}, no joint and no robot"
                return None, f"{wrong}; {known_names((*robots, *names), 12)}"
        numbers = [value.get(name, 0.0) for name in names]
    except Exception:  # as above
        return None, f"{what} is a {kind_of(value)}; it must be numbers by joint name"
    return as_vector(what, numbers, names)


def reason_of_stop(reason: object) -> Reason:
    """The reason of an ordered stop, `STOP_ORDERED` for any value not in `ORDERED`."""
    if isinstance(reason, Reason) and reason in ORDERED:
        return reason
    return Reason.STOP_ORDERED


def twists_in(
    twists: Mapping[str, ArrayLike], tools: Tools
) -> tuple[Floats | None, str]:
    """Twists of tools as a cycle takes them, or None and the reason in words."""
    try:
        return read_twists(twists, tools)
    except Exception:  # whatever a stranger's object raises, the loop goes on
        return None, f"twists is a {kind_of(twists)}; it must be 6 numbers by robot"


def read_twists(
    twists: Mapping[str, ArrayLike], tools: Tools
) -> tuple[Floats | None, str]:
    """Twists of tools as a cycle takes them; an invalid object may raise."""
    count = len(twists)
    if count > MOST_TWISTS:
        return None, f"there are {count} twists; no more than {MOST_TWISTS} are led"
    rows = np.zeros((count, TWIST_ROW))
    fault = ""
    for row, (name, twist) in zip(rows, twists.items(), strict=True):
        tool = tools.named(name)
        vector, wrong = as_vector(f"the twist of '{name}'", twist, TWIST_PARTS)
        if tool is None:
            wrong = f"there is a twist for '{name}', no tool; {tools.near(name)}"
        elif vector is not None:
            row[:TOOL_POINT] = tool.robot, tool.body
            row[TOOL_POINT:TOOL_TWIST] = tool.p_body
            row[TOOL_TWIST:] = vector
        fault = fault or wrong
    return (None, fault) if fault else (rows.reshape(-1), "")
