"""State of a guard: saved as bytes, restored, or copied to another guard."""

from dataclasses import dataclass, field
from typing import Any

from numpy.typing import NDArray

from armguard.guard.checkpoint import (
    CheckpointError,
    arrays_in,
    layout_of,
    pack,
    placement_of,
    put_back,
    stand,
    unpack,
)
from armguard.guard.checkpoint_bounds import (
    BOUNDS,
    Greatest,
    Rules,
    check_about,
    check_bounds,
    check_contracts,
    check_placement,
    check_poses,
)
from armguard.guard.given import CycleInput
from armguard.guard.holding import Holding
from armguard.guard.objects import Objects
from armguard.guard.sensed_space import SensedSpace
from armguard.guard.static_errors import static_errors
from armguard.guard.watch import Watch
from armguard.guard.workspace import Memory


@dataclass(slots=True)
class Saving:
    """Saves and restores the state of a guard.

    Attributes:
        arrays: The saved arrays, by 'ledger.name'.
        greatest: Greatest values that the rules refer to, by name.
        watch: Watch.
        memory: What a cycle carries to the next one.
        given: Input of cycles.
        holding: Held objects.
        objects: Objects of the scene.
        sensed: Sensed space.
        rules: Permitted integers of a checkpoint.
        layout: Digest of the saved arrays; empty until it is needed.
    """

    arrays: dict[str, NDArray[Any]]
    greatest: Greatest
    watch: Watch
    memory: Memory
    given: CycleInput
    holding: Holding
    objects: Objects
    sensed: SensedSpace
    rules: Rules = field(default_factory=lambda: BOUNDS)
    layout: bytes = b""

    def add(
        self, arrays: dict[str, NDArray[Any]], rules: Rules, greatest: Greatest
    ) -> None:
        """Add arrays to the saved ones, with their rules."""
        self.arrays |= arrays
        self.rules = {**self.rules, **rules}
        self.greatest = {**self.greatest, **greatest}
        self.layout = b""

    def checkpoint(self) -> bytes:
        """State of the guard as bytes, for `restore`.

        Call it between two cycles. The next cycle measures all pairs again, in this
        guard and in the restored one.
        """
        self.memory.measure_all, self.memory.kept_count = 1, 0
        changed = sorted(self.objects.changed)
        about = {
            "last_stamp": float(self.given.last_stamp),
            "changed": changed,
            "holders": self.holding.holders,
        }
        where = placement_of(self.objects.index, self.objects.places_of(changed))
        return pack(self._layout_kept(), about, {**self.arrays, **where})

    def restore(self, data: bytes) -> None:
        """Continue from a checkpoint of another guard of the same scene.

        Call it between two cycles; it takes some milliseconds. From then on equal
        inputs give bit-identical verdicts in both guards.

        Args:
            data: Result of `checkpoint`.

        Raises:
            CheckpointError: It is no checkpoint, it is damaged, or it was made of
                another scene or by another version; nothing has changed.
        """
        tables, index = self.holding.tables, self.objects.index
        layout, about, numbers = unpack(data)
        if layout != self._layout_kept():
            raise CheckpointError(
                "this checkpoint was made of another scene, of other modes or by "
                "another version; a guard of the very same scene can take it over"
            )
        last_stamp, changed, holders = check_about(about, tables)
        places = self.objects.places_of(changed)
        where = placement_of(index, places)
        found = arrays_in(numbers, {**self.arrays, **where})
        known = {**self.arrays, **self.holding.as_held(holders)}
        check_bounds(found, known, self.rules, self.greatest)
        check_poses("workspace.T_world", found["workspace.T_world"])
        check_poses("tables.T_parent_joint", found["tables.T_parent_joint"])
        check_contracts(found["grips.contracts"], tables)
        check_placement(found, places, holders, index, tables)
        for name, array in self.arrays.items():
            array[...] = found[name]
        self.given.last_stamp = last_stamp
        self.holding.holders.clear()
        self.holding.holders.update(holders)
        for name in self.objects.changed.difference(changed):
            put_back(
                index,
                tables.standing[name],
                tables.local_rows,
            )
        self.objects.changed = set(changed)
        stand(index, places, **{name: found[name] for name in where})
        self._renew_static_errors()
        self.sensed.renew()
        self.holding.grippers.tables_changed()
        self.memory.kept_count = 0

    def take_over(self, other: "Saving") -> None:
        """See `Monitor.take_over`."""
        if self._layout_kept() != other._layout_kept():
            raise CheckpointError(
                "two guards remember different state: their scenes differ in more "
                "than settings, or in modes"
            )
        self.holding.grippers.show_detailed()
        for name, array in self.arrays.items():
            array[...] = other.arrays[name]
        self._renew_static_errors()
        self.sensed.renew()
        self.holding.grippers.show_those_coarse()
        self.given.last_stamp = other.given.last_stamp

    def stand_as(self, other: "Saving") -> None:
        """See `Monitor.stand_as`."""
        objects = self.objects
        objects.changed |= other.objects.changed
        places = objects.places_of(sorted(objects.changed))
        stand(self.objects.index, places, **placement_of(other.objects.index, places))
        for name in ("seen_at", "object_velocity", "doubt", "sighted_at"):
            getattr(self.watch, name)[:] = getattr(other.watch, name)
        self.holding.grippers.tables_changed()

    def _renew_static_errors(self) -> None:
        """Write the static errors of this scene's figures for the restored tables."""
        for name, errors in static_errors(self.holding.tables).items():
            getattr(self.watch, name)[...] = errors

    def _layout_kept(self) -> bytes:
        """Digest of the saved arrays and of the scene."""
        if not self.layout:
            tables = self.holding.tables
            robots = [part.name for part in tables.robots]
            self.layout = layout_of(
                self.arrays,
                [*tables.q_names, *robots, len(tables.kinds)],
                [[name, s.first, s.count] for name, s in tables.standing.items()],
            )
        return self.layout
