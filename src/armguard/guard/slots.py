"""Slots: primitives at the end of the tables of a guard that stand for sensed cells."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.shapes import Box, ShapeKind, shape_row
from armguard.guard.sensed import GROWS, SLOTS, CellKind
from armguard.scene.exact import ExactTables
from armguard.scene.sensing import SENSED, UNSEEN, SceneSensing
from armguard.scene.tables import SceneTables


def with_slots(tables: SceneTables) -> SceneTables:
    """The tables of a guard: those of its scene, with slots if it has sensed space.

    A slot is a box in the middle of the region, and in no index. The walk moves it
    around cells that are near a robot.
    """
    sensing = tables.sensing
    if sensing is None or tables.slots:
        return tables
    slots = tuple(len(tables.robots) * count for count in SLOTS)
    count = sum(slots)
    T = np.eye(4)
    T[:3, 3] = sensing.region.centre
    row = shape_row(Box(size=(sensing.cell,) * 3), T)
    group = tables.holds.group_of[SENSED]
    names = names_of_slots(slots)
    own = int(tables.owners.max(initial=-1)) + 1
    pads: dict[str, NDArray[Any]] = {
        "kinds": np.full(count, ShapeKind.BOX, dtype=np.int32),
        "bodies": np.full(count, -1, dtype=np.int32),
        "owners": np.full(count, own, dtype=np.int32),
        "local_rows": np.tile(row, (count, 1)),
        "groups": np.full(count, group, dtype=np.int32),
        "growth": np.zeros(count),
        "model_errors": np.zeros(count),
    }
    padded: dict[str, Any] = {
        name: np.concatenate([getattr(tables, name), pad]) for name, pad in pads.items()
    }
    speeds = tables.top_speeds if len(tables.top_speeds) else np.zeros(tables.modelled)
    return replace(
        tables,
        **padded,
        body_names=(*tables.body_names, *names),
        labels=(*tables.labels, *names),
        exact=exact_with(tables.exact, count),
        top_speeds=np.concatenate([speeds, speeds_of_slots(sensing, slots)]),
        checkable_pairs=tables.checkable_pairs + count * tables.moving_count,
        slots=count,
    )


def names_of_slots(slots: tuple[int, ...]) -> tuple[str, ...]:
    """Name of the body of each slot, from the count of slots of each kind."""
    occupied = slots[CellKind.STILL] + slots[CellKind.MOVING]
    return (SENSED,) * occupied + (UNSEEN,) * (sum(slots) - occupied)


def speeds_of_slots(
    sensing: SceneSensing, slots: tuple[int, ...]
) -> NDArray[np.float64]:
    """Greatest speed of each slot, from the count of slots of each kind [m/s]."""
    speeds = [sensing.intruder.speed if kind in GROWS else 0.0 for kind in CellKind]
    return np.repeat(speeds, slots)


def exact_with(exact: ExactTables, count: int) -> ExactTables:
    """Exact shapes of tables with slots, which have none."""
    none = np.tile(np.array([-1, 0], dtype=np.int32), (count, 1))
    return replace(
        exact,
        of_primitive=np.concatenate([exact.of_primitive, none]),
        errors=np.concatenate([exact.errors, np.zeros(count)]),
    )
