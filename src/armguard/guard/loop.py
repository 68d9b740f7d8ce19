"""The loop of a guard: joint positions in, a verdict out, and the tables it needs."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.guard import layout
from armguard.guard.answer import (
    SlotsSeen,
    answer_of,
    first_row_of,
    names_of,
    stop_answer,
)
from armguard.guard.checkpoint import chosen, kept_of_tables
from armguard.guard.checkpoint_bounds import greatest_of
from armguard.guard.contract import ContractTable
from armguard.guard.contract_cycle import judge_with_contracts
from armguard.guard.contracts import prove_with_contract
from armguard.guard.cycle import run_cycle
from armguard.guard.given import (
    CycleInput,
    JointVector,
    likely_mistake,
    real_or_none,
)
from armguard.guard.grippers import Grippers
from armguard.guard.grips import grips_of
from armguard.guard.guarded_cycle import run_guarded_cycle
from armguard.guard.holding import Holding, snapshot
from armguard.guard.initial import largest_static_need, listed_pairs, watch_of
from armguard.guard.intent import read_intents
from armguard.guard.layout import IN_HEADER
from armguard.guard.levels import Reason
from armguard.guard.look_ahead import Outlook
from armguard.guard.objects import Objects
from armguard.guard.pace import Pace
from armguard.guard.planes import PLANE_COUNT
from armguard.guard.refine import MEMO_SIZE
from armguard.guard.saving import Saving
from armguard.guard.sensed_space import BOUNDS, SensedSpace
from armguard.guard.slots import with_slots
from armguard.guard.verdict import Verdict
from armguard.guard.watch import FEW, Watch
from armguard.guard.workspace import IndexKind, Measured, Memory, Settings, Workspace
from armguard.guard.world_at_home import build_index, joint_cells_of, world_at_home
from armguard.motion import motion_of
from armguard.record import records
from armguard.scene.tables import SceneTables
from armguard.separate import link_missing
from armguard.table import Ledger

# Arrays of a workspace that are the scene's own.
OF_SCENE = (
    "lower upper parent joint_kind q_index gain T_parent_joint axis bodies local_rows "
    "groups checked buffers"
).split()

OUT_OF_LIMITS = int(Reason.OUT_OF_LIMITS)

OTHER_THREAD = "another thread is in a cycle of this guard; a guard is for one thread"

# Arrays that `reset` does not change: figures of the scene, and sightings of objects.
KEPT = (
    "timing static_error link_error robot_error top_speed seen_at object_velocity "
    "clusters doubt object_stale robot_of movers pair_blocks block_need"
).split()


class Loop:
    """The cycles of a guard, their tables, and the changes of these between cycles.

    Attributes:
        tables: The compiled scene.
        index: The index; for pictures and statistics.

    Args:
        tables: The compiled scene.
        budget: Spans of a stop path that a cycle may test for all pairs together.
        clock: Clock in nanoseconds that measures `Verdict.cycle_time`.
    """

    def __init__(
        self, tables: SceneTables, budget: int, clock: Callable[[], int]
    ) -> None:
        self.tables = tables = with_slots(tables)
        self._budget = budget
        self._clock = clock
        self._guarded = any(part.mode != "fixed" for part in tables.robots)
        self._pace = Pace(tables.period, tables.late)
        self._busy = False
        self._outlook = Outlook()
        self._memory = records((), Memory)
        T_world = np.zeros((len(tables.parent), 12))
        world = world_at_home(tables, T_world)
        self._poses = T_world
        self.index = build_index(tables, world)
        for slot in range(tables.modelled, len(tables.kinds)):
            self.index.remove(slot)
        self._sensed = SensedSpace(tables, self.index)
        self._memory.measure_all = 1
        answer = answer_of(tables)
        self._out = answer["out"]
        self._watch = watch_of(tables)
        self._input = CycleInput(self._watch, tables.robots)
        self._settings = records((), Settings)
        settings = self._settings
        settings.first_row = first_row_of(tables)
        self._motion = motion_of(tables, self._budget)
        self._watch_ledger = Ledger(self._watch)
        self._grips = grips_of(tables)
        self._open_calls()
        self._expect_contracts()
        settings.moving_count = tables.moving_count
        settings.index_kind = index_kind(tables)
        settings.margin, settings.modelled = tables.margin, tables.modelled
        settings.sensed = tables.sensing is not None
        settings.static_need = largest_static_need(tables, self._watch)
        workspace = Workspace(
            **scratch_of(tables, len(answer["near"])),
            **answer,
            settings=self._settings,
            T_world=T_world,
            memory=self._memory,
            motion=self._motion,
            watch=self._watch,
            grips=self._grips,
            world=world,
            octree=self.index.state,
            joint_cells=joint_cells_of(self.index),
            sensed=self._sensed.table,
        )
        self._open_ledger(workspace)
        self._holding.warm_up()
        self._names = names_of(snapshot(tables), self._watch.disproved)
        self._saving = self._open_saving()

    def _open_calls(self) -> None:
        """Create what changes grippers, contracts and objects between cycles."""
        tables, watch = self.tables, self._watch
        self._grippers = Grippers(
            tables,
            self.index,
            self._grips,
            self._world_changed,
            self._take_over_tables,
        )
        self._contracts = ContractTable(self._grippers, watch)
        self._holding = Holding(
            tables,
            watch,
            self._motion,
            self._poses,
            self._grippers,
            self._contracts,
            lambda: self._lines,
        )
        self._objects = Objects(
            tables,
            watch,
            self.index,
            self._holding,
            self._world_changed,
            dict(tables.standing),
        )
        self._grippers.show_detailed()

    def _open_saving(self) -> Saving:
        """What writes and reads checkpoints of this loop."""
        tables = self.tables
        arrays = chosen(
            watch=self._watch,
            motion=self._motion,
            grips=self._grips,
            workspace=self._workspace,
        )
        saving = Saving(
            {**kept_of_tables(tables), **arrays},
            greatest_of(tables),
            self._watch,
            self._memory,
            self._input,
            self._holding,
            self._objects,
            self._sensed,
        )
        if tables.sensing is not None:
            saving.add(self._sensed.kept(), BOUNDS, {})
        return saving

    @property
    def q_names(self) -> tuple[str, ...]:
        """Name of each joint of q: 'robot/joint'."""
        return self.tables.q_names

    @property
    def home(self) -> NDArray[np.float64]:
        """Home configuration, a copy, shape (n,) [rad or m]."""
        return self.tables.home.copy()

    def step(
        self,
        q: JointVector,
        stamp: float | Mapping[str, float] | None = None,
        *,
        velocity: JointVector | None = None,
        now: float | None = None,
    ) -> Verdict:
        """Judge the joint positions of a cycle. Never raises.

        A guard is for one thread at a time: a cycle during another one is a stop
        (`Reason.WRONG_INPUT`).

        Args:
            q: Joint positions in the order of `q_names`, shape (n,), or a vector of
                each robot by its name [rad or m].
            stamp: Time of their measurement [s], for all robots or by robot name; on
                any clock, the same for all. Where every robot's mode is "fixed" it may
                be left out.
            velocity: Joint velocities measured with them, as `q` [rad/s or m/s]; if
                left out they are estimated from the stamps.
            now: Time of this cycle on the same clock [s]; if left out the newest
                stamp, and measurements count as old as is declared.

        Returns:
            The verdict; a snapshot that later cycles do not change.
        """
        start = self._clock()
        time: Any = stamp if now is None else now
        if time is not None and type(time) is not float:
            time = real_or_none(time)
        # The interpreter changes threads in calls and jumps only: none comes between
        # this test and the assignment.
        if self._busy:
            data = stop_answer(self._names, Reason.WRONG_INPUT)
            return Verdict(data, self._names, time, 0.0, OTHER_THREAD)
        self._busy = True
        try:
            if self._guarded:
                array, fault = self._input.take(q, stamp, velocity, now)
                used = run_guarded_cycle(array, self._lines)
                data, fault = self._answer(used, fault, array)
            else:
                fault = "" if stamp is None else self._input.judge_stamp(stamp)
                if fault:
                    data = stop_answer(self._names, Reason.TIME_BACKWARDS)
                else:
                    array, fault = self._input.positions(q)
                    if fault:
                        data = stop_answer(self._names, Reason.WRONG_INPUT)
                    else:
                        data = self._out[: run_cycle(array, self._lines)].copy()
                        if data.item(IN_HEADER.reason) == OUT_OF_LIMITS:
                            fault = likely_mistake(array, self.tables)
        finally:
            self._busy = False
        elapsed = (self._clock() - start) * 1e-9
        about = fault, self._cells_seen(time), self._outlook.last
        return Verdict(data, self._names, time, elapsed, *about)

    def judge_at_rest(self, q: JointVector) -> Verdict:
        """Judge a hypothetical configuration in which nothing moves. Never raises.

        The verdict shows whether each pair keeps its buffer there. The state of the
        loop does not change, and no stop is ordered.

        Args:
            q: Joint positions in the order of `q_names`, shape (n,) [rad or m].
        """
        start = self._clock()
        array, fault = self._input.positions(q)
        if fault:
            data = stop_answer(self._names, Reason.WRONG_INPUT)
        else:
            with self._grippers.detailed():
                used = run_cycle(array, self._lines)
                data = self._out[:used].copy()
            if data.item(IN_HEADER.reason) == OUT_OF_LIMITS:
                fault = likely_mistake(array, self.tables)
        return Verdict(data, self._names, None, (self._clock() - start) * 1e-9, fault)

    def _cells_seen(self, time: float | None) -> SlotsSeen | None:
        """What is known of the cells in slots; None without sensed space or a time."""
        if time is None or self.tables.sensing is None:
            return None
        seen_at = self._watch.seen_at[self.tables.modelled :]
        return SlotsSeen(time - seen_at, self._sensed.table.sources.copy())

    def _answer(
        self, used: int, fault: str, q: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], str]:
        """Copy of the answer of a cycle with predicted stops, and its input's fault.

        Args:
            used: Count of its numbers.
            fault: Fault of its input in words, or "".
            q: Positions that the kernel took.
        """
        data = self._out[:used].copy()
        reason = self._pace.note(data)
        if fault:
            data[IN_HEADER.reason] = Reason.WRONG_INPUT
            data[IN_HEADER.joint] = -1.0
        elif reason == OUT_OF_LIMITS:
            fault = likely_mistake(q, self.tables)
        self._outlook.note(q, data)
        return data, fault

    def reset(self) -> None:
        """Clear the last cycle, the last stamps, ordered stops and disproved figures.

        No plan is announced then. Robots count as at rest. Held objects stay held, and
        contracts of `allow` in force; those by intent end. Where every mode is "fixed",
        a reset does not change the next verdict; only all pairs are measured again.
        """
        self._memory.measure_all = 1
        self._outlook.take(None)
        self._input.last_stamp = -np.inf
        for name, fresh in watch_of(self.tables)._asdict().items():
            if name not in KEPT:
                getattr(self._watch, name)[...] = fresh
        self._motion.v_low[:] = self._motion.v_high[:] = 0.0
        self._motion.clock.fill(0.0)
        if len(self.tables.holds.grippers):
            self._holding.forget()
            self._world_changed()

    def _expect_contracts(self) -> None:
        """Enable contracts in the loop if there may be any, else disable them."""
        may_be = len(self._grips.grippers) > 0 or self._grips.may.any()
        if may_be:
            for kernel in (judge_with_contracts, prove_with_contract, read_intents):
                link_missing(kernel)
        settings = self._settings
        settings.contracts = settings.intents = may_be

    def _take_over_tables(self) -> None:
        """Apply changed tables of attached bodies and checked groups to the loop."""
        tables = self.tables
        watch = self._watch
        found = listed_pairs(tables, watch.link_error, watch.robot_error)
        self._watch = self._holding.watch = watch._replace(**found)
        for name, table in found.items():
            self._watch_ledger.put(Watch._fields.index(name), table)
        self._settings.static_need = largest_static_need(tables, self._watch)
        self._names = replace(self._names, tables=snapshot(tables))
        self._expect_contracts()
        self._world_changed()

    def _world_changed(self) -> None:
        """Use a rebuilt index, and measure every pair again in the next cycle."""
        if self._workspace.octree is not self.index.state:
            self._open_ledger(self._workspace._replace(octree=self.index.state))
        self._memory.measure_all = 1
        self._outlook.changes += 1
        self._sensed.claim()

    def _open_ledger(self, workspace: Workspace) -> None:
        """Create the ledger through which kernels access the arrays of a workspace."""
        self._workspace = workspace
        shared = {"watch": self._watch_ledger, "sensed": self._sensed.ledger}
        self._ledger = Ledger(workspace, **shared)
        self._lines = self._ledger.lines


def scratch_of(tables: SceneTables, capacity: int) -> dict[str, Any]:
    """Arrays of a workspace that belong to the scene, or are scratch, by name.

    Args:
        tables: The scene.
        capacity: Greatest count of near pairs.
    """
    count, bodies = len(tables.kinds), len(tables.parent)
    return {
        **{name: getattr(tables, name) for name in OF_SCENE},
        "exact_of": tables.exact.of_primitive,
        "exact_kinds": tables.exact.kinds,
        "exact_rows": tables.exact.rows,
        "T_next": np.zeros((bodies, 12)),
        "body_moved": np.zeros(bodies, dtype=np.uint8),
        "moved": np.zeros(count, dtype=np.uint8),
        "candidates": np.zeros(count, dtype=np.int32),
        "seen": np.zeros(count, dtype=np.int64),
        "kept": records(capacity, layout.NearRow),
        "memo": records(MEMO_SIZE, Measured),
        "planes": np.zeros(PLANE_COUNT, dtype=np.int64),
        "normals": np.zeros((PLANE_COUNT, 3)),
        "look_box": np.zeros(6),
    }


def index_kind(tables: SceneTables) -> int:
    """How pairs are searched without a prediction of stops: by an index or in turn."""
    if tables.index.kind == "auto":
        return IndexKind.LISTED if tables.modelled <= FEW else IndexKind.OCTREE
    return IndexKind[tables.index.kind.upper()]
