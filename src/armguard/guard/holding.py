"""Held objects: grasp and release, as transactions between two cycles.

A held object moves with its gripper: its body is a child of the gripper's body, the
joints above that body move its primitives, and it is checked as the robot's links are.
Each transaction writes all tables at once; the next cycle judges with them.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.errors import GraspError, UnknownNameError, did_you_mean
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.guard.body_distance import body_distance
from armguard.guard.contract import ROOM, Contract, ContractTable, gain_of
from armguard.guard.grippers import Grippers
from armguard.guard.grips import ContractKind, ContractState
from armguard.guard.riding import as_held, carry, set_down, speed_of
from armguard.guard.watch import Watch
from armguard.motion.state import Motion
from armguard.scene.hold_tables import Graspable, GripperPart
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# A body counts as below if the downward part of the normal is at least this [-].
BELOW = 0.5

# Additional separation at rest for errors that depend on the pose [m].
AT_REST = 3e-3


@dataclass(slots=True)
class Holding:
    """Held and free objects, and the contracts between bodies.

    Attributes:
        tables: The scene; tables that depend on held objects are written.
        watch: Watch.
        motion: Motion.
        T_world: Poses of all bodies, shape (b, 12).
        grippers: The grippers.
        table: The contracts.
        lines: Function that returns the ledger of the workspace.
        holders: Robots that hold each held object; the first one carries it.
    """

    tables: SceneTables
    watch: Watch
    motion: Motion
    T_world: Floats
    grippers: Grippers
    table: ContractTable
    lines: Callable[[], Longs]
    holders: dict[str, list[str]] = field(default_factory=dict)

    def warm_up(self) -> None:
        """Compile or load the kernels of transactions, if objects are graspable."""
        if self.grippers.grips.objects.shape[0]:
            body_distance(0, 0, 0, 0, self.lines(), np.zeros(WITNESS_WIDTH))

    def grasp(self, robot: str, name: str) -> None:
        """Attach an object to a robot after its gripper has closed on it.

        One transaction between two cycles: the object moves with the gripper and is
        checked as the robot's links are. It may touch its support until it has lifted
        clear, and when it is put down there again. A second robot may grasp an object
        that the first one holds; it carries the object once the first one releases it.

        Args:
            robot: The robot.
            name: The object.

        Raises:
            UnknownNameError: There is no such robot or object.
            GraspError: The robot has no gripper, the object is not graspable, not
                present or held already, no finger touches it, or the gripper is too
                fast.
        """
        with self.grippers.transaction():
            self._grasp(robot, name)

    def release(self, robot: str, name: str) -> None:
        """Detach an object from a robot after its gripper has opened.

        One transaction between two cycles: the object is free, or moves with the other
        robot that holds it, and every pair is checked again. Links of the gripper that
        are too near to it may move away.

        Args:
            robot: The robot.
            name: The object.

        Raises:
            UnknownNameError: There is no such robot or object.
            GraspError: The robot does not hold the object.
        """
        with self.grippers.transaction():
            self._release(robot, name)

    def _grasp(self, robot: str, name: str) -> None:
        """Attach an object to a robot, see `grasp`."""
        g, part = self.grippers.of(robot)
        item = self._object(name)
        holders = self.holders.get(name, [])
        if robot in holders:
            raise GraspError(f"'{robot}' holds '{name}' already")
        if len(holders) == 2:
            raise GraspError(
                f"'{name}' is held by '{holders[0]}' and '{holders[1]}'; release it "
                "from one of them first"
            )
        if self.watch.last.now == -inf:
            raise GraspError(
                f"'{robot}' cannot grasp '{name}' before the first cycle: its "
                "place is not known yet"
            )
        if not self._is_there(name):
            raise GraspError(f"'{name}' is not there; `place` it first")
        self._check_touch(part, item)
        self._check_slow(part, item)
        self.table.forget_intent(g)
        self.holders[name] = [*holders, robot]
        row = self.grippers.grips.objects[self._number(name)]
        if holders:
            row.second_holder = g
        else:
            row.holder = g
        self.grippers.grips.grippers[g].held_count += 1
        if not holders:
            carry(item, part, *self._riding())
        self._check_groups()
        if not holders:
            self._stand(item)
        self.table.write_groups()

    def _release(self, robot: str, name: str) -> None:
        """Detach an object from a robot, see `release`."""
        g, part = self.grippers.of(robot)
        item = self._object(name)
        holders = self.holders.get(name, [])
        if robot not in holders:
            holder = f"'{holders[0]}' does" if holders else "no robot does"
            raise GraspError(f"'{robot}' does not hold '{name}'; {holder}")
        left = [other for other in holders if other != robot]
        row = self.grippers.grips.objects[self._number(name)]
        self.grippers.grips.grippers[g].held_count -= 1
        row.holder = self.grippers.of(left[0])[0] if left else -1
        row.second_holder = -1
        if left:
            self.holders[name] = left
            carry(item, self.grippers.of(left[0])[1], *self._riding())
        else:
            del self.holders[name]
            self.table.close(name, (ContractKind.SUPPORT, ContractKind.NEIGHBOUR))
            set_down(item, *self._riding())
        self._check_groups()
        self._let_go(part, item)
        self.table.write_groups()

    @property
    def contracts(self) -> tuple[Contract, ...]:
        """Contracts of all held objects with their grippers, and all in force."""
        found = [
            Contract(
                a=name,
                b=other,
                kind="held",
                depth=inf,
                speed=inf,
                gain=0.0,
                until=None,
                rearmed_at=None,
                ending=False,
                region=False,
            )
            for name, holders in self.holders.items()
            for robot in holders
            for other in self._mates(self.grippers.of(robot)[1])
        ]
        return (*found, *self.table.in_force())

    def forget(self) -> None:
        """End contracts by intent, and represent grippers by their detailed models."""
        for g, own in enumerate(self.grippers.grips.grippers):
            self.table.forget_intent(g)
            own.expired_target = -1
        self.table.write_groups()
        self.grippers.show_detailed()

    def check_free(self, name: str) -> None:
        """Refuse to place or remove an object that is held.

        Raises:
            GraspError: The object is held.
        """
        if name in self.holders:
            raise GraspError(
                f"'{name}' is held by '{self.holders[name][0]}'; release it first"
            )

    def as_held(self, holders: Mapping[str, Sequence[str]]) -> dict[str, NDArray[Any]]:
        """Tables as they are if these robots hold these objects, see `as_held`."""
        exempt = self._exempt(holders)
        return as_held(holders, exempt, self.tables, self.motion, self.grippers.grips)

    def put(self, name: str, T: Floats) -> None:
        """Set the pose of a free object's body to T, shape (4, 4)."""
        body = self.tables.holds.objects[name].body
        self.tables.T_parent_joint[body] = T[:3].reshape(12)
        self.T_world[body] = T[:3].reshape(12)

    def _riding(self) -> tuple[SceneTables, Watch, Motion, Floats]:
        """Tables that attach one body to another."""
        return self.tables, self.watch, self.motion, self.T_world

    def _number(self, name: str) -> int:
        """Index of an object among the graspable objects."""
        return [*self.tables.holds.objects].index(name)

    def _check_groups(self) -> None:
        """Write which groups are checked against each other now."""
        exempt = self._exempt(self.holders)
        self.tables.checked[:] = self.tables.holds.checked(self.holders, exempt)

    def _exempt(
        self, all_holders: Mapping[str, Sequence[str]]
    ) -> list[tuple[int, int]]:
        """Pairs of groups that are not checked if these robots hold these objects."""
        holds = self.tables.holds
        exempt = []
        for name, holders in all_holders.items():
            own = holds.group_of[name]
            for robot in holders:
                mates = self._mates(self.grippers.of(robot)[1])
                exempt += [(own, holds.group_of[mate]) for mate in mates]
                exempt += [
                    (own, holds.group_of[other])
                    for other, others in all_holders.items()
                    if other != name and others[0] == holders[0]
                ]
        return exempt

    def _mates(self, part: GripperPart) -> list[str]:
        """Bodies of a gripper, and those rigidly connected to it."""
        holds = self.tables.holds
        rigid = [
            name
            for name, (first, _) in holds.places.items()
            if self.tables.bodies[first] == part.body
        ]
        return list(dict.fromkeys([*rigid, *part.members]))

    def _stand(self, item: Graspable) -> None:
        """Open the contracts of a grasped object with its supports and neighbours.

        It may touch its supports until it has lifted clear, and when it is put down
        there again; to other bodies that are too near it must not get nearer.
        """
        grasp = item.grasp
        near = dict(self._neighbours(item))
        supports = item.rests_on
        if supports is None:
            supports = tuple(
                other
                for other, witness in near.items()
                if witness[0] <= grasp.touch and -witness[9] >= BELOW
            )
        for other in supports:
            if not self._are_checked(item.name, other):
                continue
            row = self.table.row(item.name, other, ContractKind.SUPPORT)
            if row is None:
                continue
            distance = near[other][0] if other in near else inf
            row.depth = max(grasp.depth, ROOM - distance)
            row.creep, row.gain = grasp.creep, gain_of(grasp)
            row.near, row.speed = grasp.near, grasp.intent_speed
            row.end_distance = row.lift = grasp.lift
            rests = distance <= grasp.lift
            row.state = ContractState.IN_FORCE if rests else ContractState.DORMANT
        for other, witness in near.items():
            if other not in supports:
                self.table.keep_apart(item.name, other, float(witness[0]), grasp)

    def _let_go(self, part: GripperPart, item: Graspable) -> None:
        """Open contracts that let a gripper move away from an object it released."""
        mates, grasp = set(self._mates(part)), item.grasp
        for other, witness in self._neighbours(item):
            if other not in mates:
                continue
            row = self.table.keep_apart(item.name, other, float(witness[0]), grasp)
            if row is None:
                continue
            row.kind = ContractKind.RELEASED
            if other in part.fingers:
                row.depth = max(grasp.depth, row.depth)

    def _neighbours(self, item: Graspable) -> Iterator[tuple[str, Floats]]:
        """Checked bodies that are too near to an object, with their witness rows."""
        tables, boxes, watch = self.tables, self.grippers.index.world.boxes, self.watch
        first, end = tables.holds.places[item.name]
        own = boxes[first:end]
        low, high = own[:, :3].min(axis=0), own[:, 3:].max(axis=0)
        errors = watch.link_error + watch.robot_error
        errors = np.pad(errors, (0, len(boxes) - len(errors)))
        most = float(tables.buffers[item.group].max() + 2.0 * errors.max()) + AT_REST
        most = max(most, item.grasp.lift)
        near = (boxes[:, :3] <= high + most) & (boxes[:, 3:] >= low - most)
        seen: set[str] = set()
        witness = np.zeros(WITNESS_WIDTH)
        for j in np.flatnonzero(near.all(axis=1)).tolist():
            other = tables.body_names[j]
            if other in seen or not self._is_there(other):
                continue
            seen.add(other)
            if self._are_checked(item.name, other):
                where = tables.holds.places[other]
                body_distance(first, end, *where, self.lines(), witness)
                need = tables.buffers[item.group, tables.holds.group_of[other]]
                need += errors[first:end].max() + errors[slice(*where)].max()
                if not witness[0] > max(need + AT_REST, item.grasp.lift):
                    yield other, witness.copy()

    def _check_touch(self, part: GripperPart, item: Graspable) -> None:
        """Refuse a grasp in which no finger touches the object.

        Raises:
            GraspError: No finger touches it.
        """
        holds = self.tables.holds
        nearest, witness = inf, np.zeros(WITNESS_WIDTH)
        for finger in part.fingers:
            where = holds.places[item.name]
            body_distance(*holds.places[finger], *where, self.lines(), witness)
            nearest = min(nearest, float(witness[0]))
        if not nearest <= item.grasp.touch:
            raise GraspError(
                f"'{part.name}' does not touch '{item.name}': its nearest finger is "
                f"{nearest * 1e3:.1f} mm away; it must be within "
                f"{item.grasp.touch * 1e3:.1f} mm"
            )

    def _check_slow(self, part: GripperPart, item: Graspable) -> None:
        """Refuse a grasp in which the gripper moves too fast.

        Raises:
            GraspError: The gripper is faster than `intent_speed`.
        """
        speed = speed_of(item, part, self.motion, self.T_world)
        if not speed <= item.grasp.intent_speed:
            raise GraspError(
                f"'{part.name}' moves '{item.name}' at {speed:.3f} m/s; to grasp it "
                f"it must be no faster than {item.grasp.intent_speed} m/s"
            )

    def _are_checked(self, a: str, b: str) -> bool:
        """Whether two bodies are checked against each other."""
        group_of = self.tables.holds.group_of
        return bool(self.tables.checked[group_of[a], group_of[b]])

    def _is_there(self, name: str) -> bool:
        """Whether a body is in the index."""
        return self.grippers.is_there(self.tables.holds.places[name][0])

    def _object(self, name: str) -> Graspable:
        """A graspable object by its name.

        Raises:
            UnknownNameError: There is no such object.
            GraspError: The object is not graspable.
        """
        known = self.tables.holds.objects
        if name in known:
            return known[name]
        if name in self.tables.standing:
            raise GraspError(
                f"'{name}' is not graspable; mark it with `graspable: true` in the "
                "scene"
            )
        raise UnknownNameError(
            f"no object is named '{name}'; {did_you_mean(str(name), known)}"
        )


def snapshot(tables: SceneTables) -> SceneTables:
    """Copy of the tables for verdicts, which later releases must not change."""
    return replace(tables, robot_of_primitive=tables.robot_of_primitive.copy())
