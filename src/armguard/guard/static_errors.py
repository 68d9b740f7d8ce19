"""Static errors: displacements that every pair's separation covers, even at rest.

A robot's primitives may lie beside where its model and its joint angles put them. Each
kind of such an error is one row of `STATIC_ERRORS`, and one field of `Budget`.
"""

from collections.abc import Callable
from math import pi, sin
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.robot.stopping.figures import StoppingFigures
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]


class StaticError(NamedTuple):
    """A kind of static error.

    Attributes:
        term: Field of `Budget` that reports it.
        between_robots: Whether it cancels between two links of one robot.
        size: Greatest displacement, by a robot's figures, of a point within a distance
            of the robot's base [m].
    """

    term: str
    between_robots: bool
    size: Callable[[StoppingFigures, float], float]


def base_error(figures: StoppingFigures, reach: float) -> float:
    """Translation error of the base, plus its angle error times the distance [m]."""
    turn = 2.0 * sin(min(figures.base_turn, pi) / 2.0)
    return float(figures.base_error + turn * reach)


STATIC_ERRORS = (
    StaticError("model", False, lambda figures, _: figures.model_error),
    StaticError("base", True, base_error),
)

BETWEEN_ROBOTS = tuple(kind.between_robots for kind in STATIC_ERRORS)


def errors_at(robot: int, reach: float, tables: SceneTables) -> list[float]:
    """Static errors, by kind, of a robot's primitive within `reach` of its base [m]."""
    figures = tables.robots[robot].stopping if robot >= 0 else None
    if figures is None:
        return [0.0] * len(STATIC_ERRORS)
    return [kind.size(figures, reach) for kind in STATIC_ERRORS]


def static_errors(tables: SceneTables) -> dict[str, Floats]:
    """Static errors of the moving primitives: the fields of `Watch` that hold them."""
    rows = zip(tables.robot_of_primitive, tables.base_reach, strict=True)
    kinds = [errors_at(int(r), float(reach), tables) for r, reach in rows]
    by_kind = np.array(kinds).reshape(-1, len(STATIC_ERRORS)).T.copy()
    return {"static_error": by_kind, **sums_of(by_kind)}


def sums_of(by_kind: Floats) -> dict[str, Floats]:
    """Sums of the errors that apply to every pair, and between robots only [m]."""
    between = np.array(BETWEEN_ROBOTS)
    return {
        "link_error": by_kind[~between].sum(axis=0),
        "robot_error": by_kind[between].sum(axis=0),
    }


def set_static_errors(primitives: slice, by_kind: Floats, watch: Any) -> None:
    """Change the static errors of some primitives.

    Args:
        primitives: Their places.
        by_kind: Their errors, shape (kinds, k) [m].
        watch: The `Watch`.
    """
    watch.static_error[:, primitives] = by_kind
    for name, row in sums_of(by_kind).items():
        getattr(watch, name)[primitives] = row


def static_needs(
    pairs: NDArray[np.int32], link: Floats, robot: Floats, tables: SceneTables
) -> Floats:
    """Static need of each pair, without object motion, shape (c,) [m].

    Args:
        pairs: The pairs, shape (c, 2).
        link: See `Watch.link_error`.
        robot: See `Watch.robot_error`.
        tables: The scene.
    """
    others = len(tables.kinds) - tables.moving_count
    link, robot = np.pad(link, (0, others)), np.pad(robot, (0, others))
    owner = np.pad(tables.robot_of_primitive, (0, others), constant_values=-1)
    i, j = pairs.T
    apart = np.where(owner[i] != owner[j], robot[i] + robot[j], 0.0)
    buffers = tables.buffers[tables.groups[i], tables.groups[j]]
    return np.asarray(buffers + link[i] + link[j] + apart)
