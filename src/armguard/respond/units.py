"""Desired motion in degrees or millimetres, or no number: the log names it."""

import logging
from math import ceil, inf, radians

import numpy as np
from numpy.typing import NDArray

from armguard.guard.given import other_unit, top_speeds, turning_joints, within
from armguard.respond.state import (
    POSITIONS,
    STANDSTILL,
    TOOL_TWIST,
    TWIST_ROW,
    TWISTS,
    VELOCITIES,
)
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]

log = logging.getLogger("armguard")

# Desired speeds so many times the top speed of a joint are in another unit [-].
FAR_TOO_FAST = 20.0

# In their own unit they are at most so many times that speed [-].
LIKELY = 2.0

# No tool is led at this speed [m/s], or turned so fast [rad/s].
MOST_TOOL_SPEED, MOST_TOOL_TURN = 10.0, 20.0

# Time from one look to the next. A speed counts if two looks in a row find it: a
# controller that corrects a large error requests as much for a moment [s].
SUSTAINED = 0.5

FORMS = 1 + max(VELOCITIES, POSITIONS, TWISTS, STANDSTILL)


class DesiredUnits:
    """Finds desired motion that looks like another unit or is none, and logs it once.

    Such motion is followed: positions as far as the limits of the joints, velocities
    and twists at their top speeds.

    Args:
        tables: The scene.
    """

    def __init__(self, tables: SceneTables) -> None:
        self._tables = tables
        self._tops = top_speeds(tables)
        self._turning = turning_joints(tables)
        self._factors = np.where(self._turning, radians(1.0), 1e-3)
        # Cycles from one look to the next, and those that are left, by form.
        self._every, self._left = ceil(SUSTAINED / tables.period), [1] * FORMS
        self._suspected = False
        self._said: set[int] = set()

    def note(self, form: int, desired: Floats | None) -> None:
        """Note what was desired in a cycle: looked at in the first, then now and then.

        Args:
            form: Form of the motion.
            desired: Desired motion in that form; None if it was refused.
        """
        self._left[form] -= 1
        if self._left[form]:
            return
        self._left[form] = self._every
        hint = "" if desired is None else self.hint(form, desired)
        if hint and form not in self._said and (self._suspected or form == POSITIONS):
            self._said.add(form)
            log.warning("%s", hint)
        self._suspected = bool(hint)

    def hint(self, form: int, desired: Floats) -> str:
        """In words, that desired motion looks like another unit; "" if it does not.

        Args:
            form: `VELOCITIES`, `POSITIONS` or `TWISTS`.
            desired: Desired motion in that form.
        """
        if form == POSITIONS:
            return self._hint_of_positions(desired)
        if form == TWISTS:
            return self._hint_of_twists(desired.reshape(-1, TWIST_ROW))
        return self._hint_of_velocities(desired) if form == VELOCITIES else ""

    def _hint_of_positions(self, q: Floats) -> str:
        """A position outside its limits, if that looks like another unit."""
        tables = self._tables
        hint = "" if within(q, tables) else other_unit(q, tables)[0]
        if not hint:
            return ""
        k = int(np.minimum(q - tables.lower, tables.upper - q).argmin())
        return (
            f"q_desired of joint '{tables.q_names[k]}' is {q[k]:g}, its limits are "
            f"[{tables.lower[k]:g}, {tables.upper[k]:g}]; {hint}"
        )

    def _hint_of_velocities(self, v: Floats) -> str:
        """A velocity that is no number, or all too fast ones if in another unit."""
        if not np.isfinite(v).all():
            k = int(np.isfinite(v).argmin())
            name = self._tables.q_names[k]
            return f"v_desired of joint '{name}' is {v[k]}; it must be finite"
        speed = np.abs(v)
        far = speed > FAR_TOO_FAST * self._tops
        likely = speed * self._factors <= LIKELY * self._tops
        if not far.any() or not likely[far].all():
            return ""
        k = int((speed / self._tops).argmax())
        seems, unit = (
            ("degrees", "rad/s") if self._turning[k] else ("millimetres", "m/s")
        )
        return (
            f"v_desired of joint '{self._tables.q_names[k]}' is {v[k]:g} {unit}, its "
            f"top speed is {self._tops[k]:g}; that looks like {seems} a second, give "
            f"{unit}: {v[k] * self._factors[k]:.4g}"
        )

    def _hint_of_twists(self, rows: Floats) -> str:
        """A twist that is faster than any tool, if it is not in another unit."""
        for row in rows:
            name = self._tables.robots[int(row[0])].name
            parts = (
                (MOST_TOOL_SPEED, "m/s", "millimetres", 1e-3),
                (MOST_TOOL_TURN, "rad/s", "degrees", radians(1.0)),
            )
            for first, (most, unit, seems, factor) in zip((0, 3), parts, strict=True):
                size = np.abs(row[TOOL_TWIST + first :][:3]).max()
                if most < size < inf:
                    return (
                        f"the twist of robot '{name}' is {size:g} {unit}; that looks "
                        f"like {seems} a second, give {unit}: {size * factor:.4g}"
                    )
        return ""
