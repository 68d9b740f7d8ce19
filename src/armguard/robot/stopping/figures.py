"""Figures of one robot: limits, stops, delays, errors; each with where it is from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.errors import did_you_mean
from armguard.robot.model import RobotModel
from armguard.robot.stopping.plausible import FiguresError, check_plausible
from armguard.robot.stopping.table import StopTable

Floats = NDArray[np.float64]

# A figure of each joint: one for all, or one by joint name.
PerJoint = float | Mapping[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class StoppingFigures:
    """How a robot stops, and how well it is known where it is.

    The proof of the guard holds for every robot whose true figures lie inside these.
    Vectors are in the order of the model's `q_names`, shape (n,). A *stop* is
    controlled, under power (IEC 60204-1 category 1 or 2; SS1, SS2); a *brake* removes
    power at once (category 0; STO).

    Attributes:
        velocity: Top speed [rad/s or m/s].
        acceleration: Greatest acceleration a command can cause [rad/s² or m/s²].
        deceleration: Least deceleration of a stop [rad/s² or m/s²].
        deceleration_most: Greatest deceleration of a stop; infinite if nobody knows
            [rad/s² or m/s²].
        ramp: Time in which a stop's deceleration rises to its full value (jerk) [s].
        settle: How far a joint swings about its rest, to either side, after a stop
            from top speed; in proportion less from a lower one [rad or m].
        settle_time: Longest time it takes to settle [s].
        tables: Measured stops; they take the place of `deceleration`, `ramp` and
            `settle` for the joints they are given for.
        brake_delay: Longest time from the order until a brake holds on [s].
        brake_deceleration: Least deceleration of a brake [rad/s² or m/s²].
        position_error: Greatest error of a measured position [rad or m].
        velocity_error: Greatest error of a measured velocity [rad/s or m/s].
        tracking_error: How far the velocity of a joint may miss the commanded ones
            that are under way, beyond the delay `command` [rad/s or m/s].
        sensing: Longest time from the measured instant until the guard has it [s].
        command: Longest time from the guard's order until the drives obey [s].
        stale: Age from which on a measurement is refused [s].
        model_error: How far the real surface may lie outside the model's [m].
        base_error: How far the base may stand from where the scene says [m].
        base_turn: By what angle it may be turned [rad].
        sources: Where a figure is from, by attribute name; what is not in it was
            declared by the user. A source that holds "assumption:" is one.
        joints: Names of the joints, in the order of the vectors.
    """

    velocity: Floats
    acceleration: Floats
    deceleration: Floats
    deceleration_most: Floats
    ramp: float = 0.0
    settle: Floats
    settle_time: float = 0.0
    tables: Mapping[str, StopTable] = field(default_factory=dict)
    brake_delay: float
    brake_deceleration: Floats
    position_error: Floats
    velocity_error: Floats
    tracking_error: Floats
    sensing: float
    command: float
    stale: float
    model_error: float = 0.0
    base_error: float = 0.0
    base_turn: float = 0.0
    sources: Mapping[str, str] = field(default_factory=dict)
    joints: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check that every table belongs to a joint.

        Raises:
            FiguresError: One does not, and would be left out without a word.
        """
        for name in self.tables:
            if name not in self.joints:
                raise FiguresError(
                    f"there is a stopping table for '{name}', no joint", "tables", name
                )

    def table_of(self, joint_index: int) -> StopTable | None:
        """Measured stops of a joint, None if there are none."""
        if not self.tables:
            return None
        return self.tables.get(self.joints[joint_index])


def stopping_figures(
    model: RobotModel,
    *,
    deceleration: PerJoint,
    velocity: PerJoint | None = None,
    acceleration: PerJoint | None = None,
    deceleration_most: PerJoint = inf,
    ramp: float = 0.0,
    settle: PerJoint = 0.0,
    settle_time: float = 0.0,
    tables: Mapping[str, StopTable] | None = None,
    brake_delay: float = 0.1,
    brake_deceleration: PerJoint | None = None,
    position_error: PerJoint = 1e-4,
    velocity_error: PerJoint = 0.01,
    tracking_error: PerJoint = 0.02,
    sensing: float = 0.002,
    command: float = 0.004,
    stale: float = 0.010,
    model_error: float = 0.0,
    base_error: float = 0.0,
    base_turn: float = 0.0,
    sources: Mapping[str, str] | None = None,
) -> StoppingFigures:
    """Figures of a robot from numbers for all its joints, or by joint name.

    Args:
        model: The robot.
        deceleration: Least deceleration of a stop.
        velocity: Top speed; that of the URDF if None.
        acceleration: Greatest acceleration; twice the deceleration if None.
        deceleration_most: Greatest deceleration of a stop.
        ramp: See `StoppingFigures`, from here to `base_turn`.
        settle: Swing.
        settle_time: Its time.
        tables: Measured stops by joint name.
        brake_delay: Delay of the brakes.
        brake_deceleration: Least deceleration of a brake; that of a stop if None.
        position_error: Error of positions.
        velocity_error: Error of velocities.
        tracking_error: Error of driven velocities.
        sensing: Delay of measurements.
        command: Delay of orders.
        stale: Greatest age.
        model_error: Error of the model.
        base_error: Error of the base.
        base_turn: Its angle.
        sources: Where figures are from.

    Raises:
        FiguresError: A figure is missing, or cannot be true.
    """
    names = model.q_names
    vector: dict[str, Any] = {
        "deceleration": per_joint("deceleration", deceleration, names),
        "deceleration_most": per_joint("deceleration_most", deceleration_most, names),
        "settle": per_joint("settle", settle, names),
        "position_error": per_joint("position_error", position_error, names),
        "velocity_error": per_joint("velocity_error", velocity_error, names),
        "tracking_error": per_joint("tracking_error", tracking_error, names),
    }
    vector["velocity"] = (
        urdf_velocity(model)
        if velocity is None
        else per_joint("velocity", velocity, names)
    )
    vector["acceleration"] = (
        2.0 * vector["deceleration"]
        if acceleration is None
        else per_joint("acceleration", acceleration, names)
    )
    vector["brake_deceleration"] = (
        vector["deceleration"]
        if brake_deceleration is None
        else per_joint("brake_deceleration", brake_deceleration, names)
    )
    for key in ("velocity", "deceleration", "acceleration", "brake_deceleration"):
        check_all(key, vector[key], names, positive=True)
    for key in ("settle", "position_error", "velocity_error", "tracking_error"):
        check_all(key, vector[key], names, positive=False)
    check_most(vector["deceleration"], vector["deceleration_most"], names)
    scalar: dict[str, Any] = {
        "ramp": ramp,
        "settle_time": settle_time,
        "brake_delay": brake_delay,
        "sensing": sensing,
        "command": command,
        "stale": stale,
        "model_error": model_error,
        "base_error": base_error,
        "base_turn": base_turn,
    }
    for key, value in scalar.items():
        if not (isfinite(value) and value >= 0.0):
            raise FiguresError(f"{key} is {value}; it must be finite and >= 0", key)
    check_plausible(model, {**vector, **scalar})
    if stale < sensing:
        raise FiguresError(
            f"stale is {stale * 1e3:g} ms, less than sensing, {sensing * 1e3:g} ms: "
            "every measurement would be refused",
            "stale",
        )
    return StoppingFigures(
        **vector,
        **scalar,
        tables=dict(tables or {}),
        sources=dict(sources or {}),
        joints=names,
    )


def per_joint(what: str, value: PerJoint, names: Sequence[str]) -> Floats:
    """A figure of each joint, shape (n,).

    Raises:
        FiguresError: A joint has none, or nobody has a name.
    """
    if not isinstance(value, Mapping):
        return np.full(len(names), float(value))
    unknown = [name for name in value if name not in names]
    if unknown:
        raise FiguresError(
            f"{what} is given for '{unknown[0]}', no joint; "
            f"{did_you_mean(unknown[0], names)}",
            what,
            unknown[0],
        )
    missing = [name for name in names if name not in value]
    if missing:
        raise FiguresError(f"{what} is missing for joint '{missing[0]}'", what)
    return np.array([float(value[name]) for name in names])


def urdf_velocity(model: RobotModel) -> Floats:
    """Top speeds of the URDF, shape (n,).

    Raises:
        FiguresError: A joint has none.
    """
    speeds = []
    for name in model.q_names:
        speed = model.joints[name].velocity
        if speed is None:
            raise FiguresError(
                f"joint '{name}' has no speed limit in the URDF; give `velocity`",
                "velocity",
                name,
            )
        speeds.append(speed)
    return np.array(speeds, dtype=np.float64)


def check_all(what: str, values: Floats, names: Sequence[str], positive: bool) -> None:
    """Every joint's figure is finite, and not negative or even positive.

    Raises:
        FiguresError: One is not.
    """
    for name, value in zip(names, values, strict=True):
        if not (isfinite(value) and (value > 0.0 if positive else value >= 0.0)):
            raise FiguresError(
                f"{what} of joint '{name}' is {value:g}; it must be finite and "
                f"{'> 0' if positive else '>= 0'}",
                what,
                name,
            )


def check_most(least: Floats, most: Floats, names: Sequence[str]) -> None:
    """The greatest deceleration is not below the least.

    Raises:
        FiguresError: It is, or is NaN.
    """
    for name, low, high in zip(names, least, most, strict=True):
        if not high >= low:
            raise FiguresError(
                f"deceleration_most of joint '{name}' is {high:g}, below its "
                f"deceleration, {low:g}",
                "deceleration_most",
                name,
            )
