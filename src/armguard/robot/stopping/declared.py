"""Figures somebody declared, with where each of the others is from."""

from collections.abc import Mapping
from dataclasses import fields
from inspect import signature
from typing import Any

from armguard.errors import did_you_mean
from armguard.robot.model import RobotModel
from armguard.robot.stopping.figures import (
    FiguresError,
    StoppingFigures,
    stopping_figures,
)

# How a source begins that nobody has measured or published.
ASSUMPTION = "assumption: "

# What a figure is from that is neither declared nor known of the robot.
DEFAULTS = {
    "velocity": "the URDF's speed limits",
    "acceleration": ASSUMPTION + "twice the deceleration",
    "deceleration_most": ASSUMPTION + "infinite, as nobody said",
    "brake_deceleration": ASSUMPTION + "a brake holds no less than a controlled stop",
}

# Keys of `stopping_figures` a user may declare.
KEYS = tuple(
    key for key in signature(stopping_figures).parameters if key not in ("model",)
)


def declared_figures(
    model: RobotModel,
    declared: Mapping[str, Any],
    own: StoppingFigures | None = None,
) -> StoppingFigures:
    """Figures from what somebody declared, the rest from the robot's own or defaults.

    Who declares a deceleration takes it from the robot's own measured tables and its
    own greatest deceleration too: these describe another stop.

    Args:
        model: The robot.
        declared: Arguments of `stopping_figures`.
        own: The robot's own figures, if it has some.

    Raises:
        FiguresError: A figure is missing, is none, or cannot be true.
    """
    unknown = [key for key in declared if key not in KEYS]
    if unknown:
        raise FiguresError(
            f"there is no figure '{unknown[0]}'; {did_you_mean(unknown[0], KEYS)}"
        )
    arguments: dict[str, Any] = {}
    sources: dict[str, str] = {}
    if own is not None:
        for field in fields(own):
            if field.name in declared or field.name == "sources":
                continue
            value = getattr(own, field.name)
            if hasattr(value, "tolist"):
                value = dict(zip(model.q_names, value.tolist(), strict=True))
            arguments[field.name] = value
            sources[field.name] = own.sources.get(field.name, "")
        if "deceleration" in declared:
            for key in {"deceleration_most", "tables"} & arguments.keys():
                del arguments[key], sources[key]
    arguments |= declared
    if "deceleration" not in arguments:
        raise FiguresError(
            "deceleration is missing: the least deceleration of a controlled stop "
            "[rad/s² or m/s²], a number or one for each joint"
        )
    for key in KEYS:
        if key not in arguments and key not in ("sources", "tables"):
            sources[key] = DEFAULTS.get(key, ASSUMPTION + "armguard's default")
    told = {**sources, **dict(declared.get("sources") or {})}
    return stopping_figures(model, **{**arguments, "sources": told})
