"""Figures of one robot: limits, stops, delays, errors; each with where it is from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, isfinite
from reprlib import repr as brief
from typing import Annotated, Any, Required, TypedDict, Unpack, get_type_hints

import numpy as np
from numpy.typing import NDArray

from armguard.errors import ModelError, did_you_mean
from armguard.robot.model import JointKind, RobotModel
from armguard.robot.stopping.table import StopTable

Floats = NDArray[np.float64]

# A figure of each joint: one for all, or one by joint name.
PerJoint = float | Mapping[str, float]

# Units a figure beyond its ceiling seems to be in, and those it has to be in.
MISTAKEN = {
    "s": ("milliseconds", "seconds"),
    "m": ("millimetres", "metres"),
    "rad": ("degrees", "radians"),
}


class FiguresError(ModelError):
    """A figure is missing, or cannot be true.

    Attributes:
        figure: Its name, an attribute of `StoppingFigures`; "" if it is about several.
        joint: The joint it is wrong for, "" if for all.
    """

    def __init__(self, message: str, figure: str = "", joint: str = "") -> None:
        super().__init__(message)
        self.figure = figure
        self.joint = joint


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure as it is declared.

    Attributes:
        key: Its key in a scene file, with dots.
        ceiling: Beyond this it is taken for a figure in other units; the fastest arms
            there are stay well below.
        unit: "s", "m" or "rad"; None of a figure by joint, whose unit follows from
            whether the joint turns or slides.
        default: What it is if it is not declared; None if it follows from others.
        positive: Whether it cannot be 0.
        bounded: Whether it has to be finite.
    """

    key: str
    ceiling: float
    unit: str | None = None
    default: float | None = None
    positive: bool = False
    bounded: bool = True

    def of(
        self, name: str, model: RobotModel, value: Any, *, trusted: bool = False
    ) -> Any:
        """The figure of a robot, of shape (n,) if it is one by joint.

        Args:
            name: Its name, an attribute of `StoppingFigures`.
            model: The robot.
            value: A number, or one by joint name.
            trusted: Whether it may be above the ceiling.

        Raises:
            FiguresError: It is missing for a joint, or cannot be true.
        """
        each = [("", value)]
        if self.unit is None:
            value = per_joint(name, value, model.q_names)
            each = list(zip(model.q_names, value.tolist(), strict=True))
        for joint, number in each:
            figure = f"{name} of joint '{joint}'" if joint else name
            enough = number > 0.0 if self.positive else number >= 0.0
            if self.bounded and not (isfinite(number) and enough):
                bound = f"finite and {'> 0' if self.positive else '>= 0'}"
                sentence = f"{figure} is {number:g}; it must be {bound}"
                raise FiguresError(sentence, name, joint)
            if number > self.ceiling and not trusted:
                slides = joint and model.joints[joint].kind is JointKind.PRISMATIC
                looks, give = MISTAKEN[self.unit or ("m" if slides else "rad")]
                sentence = f"{figure} is {number:g}, which looks like {looks}; give "
                raise FiguresError(sentence + give, name, joint)
        return value


def per_joint(what: str, value: PerJoint, names: Sequence[str]) -> Floats:
    """A figure of each joint, shape (n,).

    Raises:
        FiguresError: A joint has none, or a name is no joint's.
    """
    if not isinstance(value, Mapping):
        array = np.asarray(value)
        if array.shape not in ((), (len(names),)) or array.dtype.kind not in "iuf":
            raise FiguresError(
                f"{what} is {brief(value)}; it must be a number, or numbers by "
                "joint name",
                what,
            )
        return np.full(len(names), array, dtype=np.float64)
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


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
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
        deceleration_most: Greatest deceleration of a stop; infinite if unknown
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
        base_error: Greatest error of the base's position [m].
        base_turn: By what angle it may be turned [rad].
        sources: Where a figure is from, by attribute name; a figure without a
            source was declared by the user. A source that holds "assumption:" is one.
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

    def __repr__(self) -> str:
        """Top speeds and decelerations of the joints."""
        joints = zip(self.joints, self.velocity, self.deceleration, strict=False)
        each = (f"{name} {v:g} {a:g}" for name, v, a in joints)
        return f"<StoppingFigures velocity, deceleration: {'; '.join(each)}>"

    def table_of(self, joint_index: int) -> StopTable | None:
        """Measured stops of a joint, None if there are none."""
        if not self.tables:
            return None
        return self.tables.get(self.joints[joint_index])


class DeclaredFigures(TypedDict, total=False):
    """Figures as they are declared, see `StoppingFigures`."""

    deceleration: Annotated[
        Required[PerJoint], Figure("deceleration", 200.0, positive=True)
    ]
    velocity: Annotated[PerJoint | None, Figure("velocity", 35.0, positive=True)]
    acceleration: Annotated[
        PerJoint | None, Figure("acceleration", 1000.0, positive=True)
    ]
    deceleration_most: Annotated[
        PerJoint, Figure("most", inf, None, inf, bounded=False)
    ]
    ramp: Annotated[float, Figure("ramp", 1.0, "s", 0.0)]
    settle: Annotated[PerJoint, Figure("settle", 0.5, None, 0.0)]
    settle_time: Annotated[float, Figure("settle_time", 10.0, "s", 0.0)]
    tables: Mapping[str, StopTable] | None
    brake_delay: Annotated[float, Figure("brake.delay", 2.0, "s", 0.1)]
    brake_deceleration: Annotated[
        PerJoint | None, Figure("brake.deceleration", 1000.0, positive=True)
    ]
    position_error: Annotated[PerJoint, Figure("errors.position", 0.2, None, 1e-4)]
    velocity_error: Annotated[PerJoint, Figure("errors.velocity", 2.0, None, 0.01)]
    tracking_error: Annotated[PerJoint, Figure("errors.tracking", 2.0, None, 0.02)]
    sensing: Annotated[float, Figure("delays.sensing", 1.0, "s", 0.002)]
    command: Annotated[float, Figure("delays.command", 1.0, "s", 0.004)]
    stale: Annotated[float, Figure("delays.stale", 2.0, "s", 0.010)]
    model_error: Annotated[float, Figure("errors.model", 0.5, "m", 0.0)]
    base_error: Annotated[float, Figure("errors.base", 0.5, "m", 0.0)]
    base_turn: Annotated[float, Figure("errors.base_turn", 0.5, "rad", 0.0)]
    sources: Mapping[str, str] | None


# What may be declared, and the figures of it; a figure follows those it is made of.
KEYS = tuple(DeclaredFigures.__annotations__)
FIGURES: dict[str, Figure] = {
    name: hint.__metadata__[0]
    for name, hint in get_type_hints(DeclaredFigures, include_extras=True).items()
    if hasattr(hint, "__metadata__")
}


# Names of figures by their keys, and the keys that hold several figures.
NAME_OF = {figure.key: name for name, figure in FIGURES.items()}
GROUPS = {key.partition(".")[0] for key in NAME_OF if "." in key}


def by_attribute(declared: Mapping[str, Any]) -> dict[str, Any]:
    """Figures by the names of `StoppingFigures`, from the keys of a scene file.

    Args:
        declared: Figures by key, in groups as in `{"errors": {"position": 1e-3}}`;
            names of `StoppingFigures` stay.

    Raises:
        FiguresError: A figure is declared twice.

    Example:
        >>> by_attribute({"most": 8.0, "errors": {"position": 1e-3}})
        {'deceleration_most': 8.0, 'position_error': 0.001}
    """
    found: dict[str, Any] = {}
    for key, value in declared.items():
        parts = {key: value}
        if key in GROUPS and isinstance(value, Mapping):
            parts = {f"{key}.{inner}": figure for inner, figure in value.items()}
        for part, figure in parts.items():
            name = NAME_OF.get(part, part)
            if name in found:
                raise FiguresError(f"{name} is declared twice; leave one out", name)
            found[name] = figure
    if found.get("sources"):
        found["sources"] = {NAME_OF.get(k, k): v for k, v in found["sources"].items()}
    return found


def stopping_figures(
    model: RobotModel, **declared: Unpack[DeclaredFigures]
) -> StoppingFigures:
    """Figures of a robot from numbers for all its joints, or by joint name.

    Args:
        model: The robot.
        declared: Figures by name, see `StoppingFigures`. All but `deceleration` have
            defaults: the top speeds of the URDF, twice the deceleration for the
            acceleration, that of a stop for a brake, and what `FIGURES` has.

    Raises:
        FiguresError: A figure is missing, or cannot be true.
    """
    given = dict[str, Any](declared)
    check_names(given)
    if given.get("deceleration") is None:
        raise FiguresError(
            "deceleration is missing: the least deceleration of a controlled stop "
            "[rad/s² or m/s²], a number or one for each joint",
            "deceleration",
        )
    made: dict[str, Any] = {}
    for name, figure in FIGURES.items():
        value = given.get(name)
        if value is None:
            value = figure.default
        # A speed of the URDF may be above the ceiling: too high is on the safe side.
        derived = value is None
        if value is None:
            value = from_others(name, model, made)
        made[name] = figure.of(name, model, value, trusted=derived)
    least, most = made["deceleration"], made["deceleration_most"]
    for name, low, high in zip(model.q_names, least, most, strict=True):
        if not high >= low:
            raise FiguresError(
                f"deceleration_most of joint '{name}' is {high:g}, below its "
                f"deceleration, {low:g}",
                "deceleration_most",
                name,
            )
    sensing, stale = made["sensing"], made["stale"]
    if stale < sensing:
        raise FiguresError(
            f"stale is {stale * 1e3:g} ms, less than sensing, {sensing * 1e3:g} ms: "
            "every measurement would be refused",
            "stale",
        )
    return StoppingFigures(
        **made,
        tables=dict(given.get("tables") or {}),
        sources=dict(given.get("sources") or {}),
        joints=model.q_names,
    )


def check_names(declared: Mapping[str, Any]) -> None:
    """Refuse figures, and sources of figures, that there are not.

    Raises:
        FiguresError: There is one.
    """
    for key in declared:
        if key not in KEYS:
            known = dict.fromkeys((*KEYS, *NAME_OF))
            raise FiguresError(
                f"there is no figure '{key}'; {did_you_mean(key, known)}", key
            )
    for key in declared.get("sources") or {}:
        if key not in KEYS:
            raise FiguresError(
                f"there is a source for '{key}', no figure; {did_you_mean(key, KEYS)}",
                "sources",
            )


def from_others(name: str, model: RobotModel, made: Mapping[str, Floats]) -> PerJoint:
    """A figure that is not declared and has no default of its own."""
    if name == "velocity":
        return urdf_velocity(model)
    factor = 2.0 if name == "acceleration" else 1.0
    joints = zip(model.q_names, made["deceleration"].tolist(), strict=True)
    return {joint: factor * value for joint, value in joints}


def urdf_velocity(model: RobotModel) -> dict[str, float]:
    """Top speeds of the URDF by joint name [rad/s or m/s].

    Raises:
        FiguresError: A joint has none.
    """
    speeds = {}
    for name in model.q_names:
        speed = model.joints[name].velocity
        if speed is None:
            raise FiguresError(
                f"joint '{name}' has no speed limit in the URDF; give `velocity`",
                "velocity",
                name,
            )
        speeds[name] = speed
    return speeds
