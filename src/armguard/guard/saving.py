"""What a guard remembers, saved as bytes, restored, or taken over by another one."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.guard.checkpoint import (
    CheckpointError,
    arrays_in,
    layout_of,
    pack,
    put_back,
    stand,
    unpack,
    whereabouts,
)
from armguard.guard.checkpoint_bounds import (
    BOUNDS,
    Greatest,
    Rules,
    check_about,
    check_bounds,
    check_contracts,
    check_poses,
    check_whereabouts,
    greatest_of,
)
from armguard.guard.given import CycleInput
from armguard.guard.grippers import Grippers
from armguard.guard.holding import Holding
from armguard.guard.memory import FORCE, KEPT_COUNT
from armguard.guard.objects import Objects
from armguard.guard.watch import Watch


class Saving:
    """Saves and restores a guard.

    Attributes:
        arrays: What is kept, by 'ledger.name'.
        rules: What whole numbers of a checkpoint may be.
        greatest: What is counted there, and its greatest number.

    Args:
        arrays: See above.
        watch: Watch.
        memory: What is carried from one cycle to the next.
        given: Input of cycles.
        holding: Who holds what.
        objects: Objects of the scene.
    """

    def __init__(
        self,
        arrays: dict[str, NDArray[Any]],
        watch: Watch,
        memory: NDArray[np.int64],
        given: CycleInput,
        holding: Holding,
        objects: Objects,
    ) -> None:
        self.arrays = arrays
        self.rules: Rules = BOUNDS
        self.greatest: Greatest = greatest_of(holding.tables)
        self._tables = holding.tables
        self._index = holding.grippers.index
        self._watch = watch
        self._memory = memory
        self._given = given
        self._holding = holding
        self._grippers: Grippers = holding.grippers
        self._objects = objects
        self._layout = b""

    def add(
        self, arrays: dict[str, NDArray[Any]], rules: Rules, greatest: Greatest
    ) -> None:
        """Keep more arrays."""
        self.arrays |= arrays
        self.rules = {**self.rules, **rules}
        self.greatest = {**self.greatest, **greatest}
        self._layout = b""

    def checkpoint(self) -> bytes:
        """All that is remembered, for `restore`.

        For between two cycles. The next cycle measures everything anew, here as there.
        """
        self._memory[FORCE], self._memory[KEPT_COUNT] = 1, 0
        changed = sorted(self._objects.changed)
        about = {
            "last_stamp": float(self._given.last_stamp),
            "changed": changed,
            "holders": self._holding.holders,
        }
        where = whereabouts(self._index, self._objects.places_of(changed))
        return pack(self._layout_kept(), about, {**self.arrays, **where})

    def restore(self, data: bytes) -> None:
        """Go on from a checkpoint of another guard of the same scene.

        For between two cycles; it takes some milliseconds. From here on the same inputs
        give the same bits as they do there.

        Args:
            data: What `checkpoint` gave.

        Raises:
            CheckpointError: It is none, it is damaged, or it was made of another scene
                or by another version; nothing has changed.
        """
        layout, about, numbers = unpack(data)
        if layout != self._layout_kept():
            raise CheckpointError(
                "this checkpoint was made of another scene, of other modes or by "
                "another version; a guard of the very same scene can take it over"
            )
        last_stamp, changed, holders = check_about(about, self._tables)
        places = self._objects.places_of(changed)
        where = whereabouts(self._index, places)
        found = arrays_in(numbers, {**self.arrays, **where})
        known = {**self.arrays, **self._holding.as_held(holders)}
        check_bounds(found, known, self.rules, self.greatest)
        check_poses("workspace.T_world", found["workspace.T_world"])
        check_poses("tables.T_parent_joint", found["tables.T_parent_joint"])
        check_contracts(found["grips.contracts"], self._tables)
        check_whereabouts(found, places, holders, self._index, self._tables)
        for name, array in self.arrays.items():
            array[...] = found[name]
        self._given.last_stamp = last_stamp
        self._holding.holders.clear()
        self._holding.holders.update(holders)
        for name in self._objects.changed.difference(changed):
            put_back(self._index, self._tables.standing[name], self._tables.local_rows)
        self._objects.changed = set(changed)
        stand(self._index, places, **{name: found[name] for name in where})
        self._grippers.tables_changed()
        self._memory[KEPT_COUNT] = 0

    def take_over(self, other: "Saving") -> None:
        """See `Monitor.take_over`."""
        if self._layout_kept() != other._layout_kept():
            raise CheckpointError(
                "two guards remember different things: their scenes differ in more "
                "than settings, or in modes"
            )
        self._grippers.show_detailed()
        for name, array in self.arrays.items():
            array[...] = other.arrays[name]
        self._grippers.show_those_coarse()
        self._given.last_stamp = other._given.last_stamp

    def stand_as(self, other: "Saving") -> None:
        """See `Monitor.stand_as`."""
        objects = self._objects
        objects.changed |= other._objects.changed
        places = objects.places_of(sorted(objects.changed))
        stand(self._index, places, **whereabouts(other._index, places))
        for name in ("seen_at", "object_velocity", "doubt", "sighted_at"):
            getattr(self._watch, name)[:] = getattr(other._watch, name)
        self._grippers.tables_changed()

    def _layout_kept(self) -> bytes:
        """The digest of what is kept."""
        if not self._layout:
            tables = self._tables
            robots = [part.name for part in tables.robots]
            self._layout = layout_of(
                self.arrays,
                [*tables.q_names, *robots, len(tables.kinds)],
                [[name, s.first, s.count] for name, s in tables.standing.items()],
            )
        return self._layout
