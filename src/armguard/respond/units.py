"""Desired motion in degrees or millimetres: the log names it."""

import logging
from math import ceil, inf, radians

import numpy as np
from numpy.typing import NDArray

from armguard.guard.given import other_unit, top_speeds, turning_joints, within
from armguard.respond.command import Changed
from armguard.respond.state import (
    POSITIONS,
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

# No tool is led at this speed [m/s], or turned so fast [rad/s].
MOST_TOOL_SPEED, MOST_TOOL_TURN = 10.0, 20.0

# Time for which a speed is far too high before it counts, and the fewest cycles of it:
# a controller that corrects a large error requests as much for a moment [s].
SUSTAINED, FEWEST = 0.5, 20

SLOWED = int(Changed.SPEED)


class DesiredUnits:
    """Finds desired motion that looks like another unit, and logs it once.

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
        n, r = len(tables.q_names), len(tables.robots)
        # Where a command has the reasons of each robot's change.
        self._reasons = range(4 * n + 3 * r, 4 * n + 4 * r)
        self._needed = max(FEWEST, ceil(SUSTAINED / tables.period))
        self._slowed, self._suspected = 0, False
        self._said: set[int] = set()

    def note(self, form: int, desired: Floats | None, commanded: Floats) -> None:
        """Note what was desired in a cycle, and log it if it looks like another unit.

        Velocities and twists are only looked at where the kernels have slowed a robot
        to its top speeds: twice while they do so in each cycle.

        Args:
            form: Form of the motion.
            desired: Desired motion in that form; None if it was refused.
            commanded: Numbers of the command.
        """
        if form == POSITIONS and desired is not None:
            if form not in self._said and (hint := self._hint_of_positions(desired)):
                self._say(form, hint)
            return
        for k in self._reasons:
            if int(commanded.item(k)) & SLOWED:
                break
        else:
            self._slowed, self._suspected = 0, False
            return
        self._slowed += 1
        if self._slowed % self._needed or form in self._said or desired is None:
            return
        hint = self.hint(form, desired)
        if hint and self._suspected:
            self._say(form, hint)
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

    def _say(self, form: int, hint: str) -> None:
        self._said.add(form)
        log.warning("%s", hint)

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
        """A velocity far beyond its top speed, if all such fit in another unit."""
        speed = np.abs(v)
        far = speed > FAR_TOO_FAST * self._tops
        if not far.any() or (speed * self._factors > self._tops)[far].any():
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
