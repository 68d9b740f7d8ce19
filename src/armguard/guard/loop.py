"""What a loop needs, allocated before it: its tables, and the parts that write them."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.witness import WITNESS_WIDTH
from armguard.guard import layout
from armguard.guard.answer import first_row_of, names_of
from armguard.guard.checkpoint import chosen, kept_of_tables
from armguard.guard.checkpoint_bounds import greatest_of
from armguard.guard.contract import ContractTable
from armguard.guard.given import CycleInput
from armguard.guard.grippers import Grippers
from armguard.guard.grips import grips_of
from armguard.guard.holding import Holding, snapshot
from armguard.guard.memory import FORCE, MEMORY
from armguard.guard.objects import Objects
from armguard.guard.planes import PLANE_COUNT
from armguard.guard.refine import MEMO_SIZE, MEMO_WIDTH
from armguard.guard.saving import Saving
from armguard.guard.watch import (
    Watch,
    all_pairs,
    standing_needs,
    watch_of,
)
from armguard.guard.workspace import (
    BRUTE_FORCE,
    CONTRACTS,
    FIRST_ROW,
    GRIPS,
    INDEX_KIND,
    INTENTS,
    MOTION,
    MOVING_COUNT,
    OCTREE,
    PARTS,
    SELF,
    SETTINGS,
    WATCH,
    Workspace,
)
from armguard.guard.world_at_home import build_index, world_at_home
from armguard.motion import motion_of
from armguard.scene.tables import SceneTables
from armguard.table import Ledger

# Near pairs an answer has room for. More than this many at once is a reason to stop
# (`Reason.CAPACITY`), not to count on.
NEAR_CAPACITY = 4096

# Arrays of a workspace that are the scene's own.
OF_SCENE = (
    "lower upper parent joint_kind q_index gain T_parent_joint axis bodies local_rows "
    "groups checked buffers"
).split()


class Loop:
    """The tables of a loop, and what changes them between two cycles.

    Attributes:
        tables: The compiled scene.
        index: The octree, or brute force; for pictures and statistics.

    Args:
        tables: The compiled scene.
        budget: Spans of a stop path a cycle may test for all pairs together.
    """

    def __init__(self, tables: SceneTables, budget: int) -> None:
        self.tables = tables
        self._budget = budget
        self._memory = np.zeros(MEMORY, dtype=np.int64)
        capacity = max(1, min(tables.checkable_pairs, NEAR_CAPACITY))
        T_world = np.zeros((len(tables.parent), 12))
        world = world_at_home(tables, T_world)
        self._poses = T_world
        self.index = build_index(tables, world)
        self._memory[FORCE] = 1
        first_row = first_row_of(tables)
        self._out = np.zeros(first_row + capacity * layout.NEAR_WIDTH)
        self._watch = watch_of(tables)
        self._input = CycleInput(self._watch, (part.name for part in tables.robots))
        self._settings = settings = np.zeros(SETTINGS, dtype=np.int32)
        settings[FIRST_ROW] = first_row
        self._motion = motion_of(tables, self._budget)
        self._parts = Ledger(self._motion), Ledger(self._watch)
        self._addresses = np.zeros(PARTS, dtype=np.int64)
        for k, ledger in zip((MOTION, WATCH), self._parts, strict=True):
            self._addresses[k] = ledger.lines.ctypes.data
        self._grips = grips_of(tables)
        self._grips_ledger = Ledger(self._grips)
        self._addresses[GRIPS] = self._grips_ledger.lines.ctypes.data
        changes = self._world_changed, self._take_over_tables
        self._grippers = Grippers(tables, self.index, self._grips, *changes)
        self._contracts = ContractTable(self._grippers, self._watch)
        self._holding = Holding(
            tables,
            self._watch,
            self._motion,
            T_world,
            self._grippers,
            self._contracts,
            lambda: self._lines,
        )
        self._objects = Objects(
            tables,
            self._watch,
            self.index,
            self._holding,
            self._world_changed,
            dict(tables.standing),
        )
        self._grippers.show_detailed()
        self._expect_contracts()
        settings[MOVING_COUNT] = tables.moving_count
        brute_force = tables.index.kind == "brute_force"
        settings[INDEX_KIND] = BRUTE_FORCE if brute_force else OCTREE
        workspace = Workspace(
            **scratch_of(tables, capacity),
            settings=settings,
            T_world=T_world,
            memory=self._memory,
            out=self._out,
            look=np.array([largest_standing_need(tables, self._watch)]),
            parts=self._addresses,
            world=world,
            octree=self.index.state,
        )
        self._open_ledger(workspace)
        self._holding.warm_up()
        self._names = names_of(snapshot(tables), self._watch.disproved)
        self._saving = Saving(
            {
                **kept_of_tables(tables),
                **chosen(
                    watch=self._watch,
                    motion=self._motion,
                    grips=self._grips,
                    workspace=workspace,
                ),
            },
            greatest_of(tables),
            self._watch,
            self._memory,
            self._input,
            self._holding,
            self._objects,
        )

    def _expect_contracts(self) -> None:
        """Have the loop look at contracts where there may be any, and only there."""
        may_be = len(self._grips.grippers) > 0 or self._grips.may.any()
        self._settings[CONTRACTS] = self._settings[INTENTS] = may_be

    def _take_over_tables(self) -> None:
        """Judge by tables in which what rides on what, or may touch it, is new."""
        tables = self.tables
        pairs = all_pairs(tables)
        watch = self._watch
        needs = standing_needs(pairs, watch.model, watch.base, tables)
        self._watch = watch._replace(pairs=pairs, pair_need=needs)
        self._holding.watch = self._watch
        for name, table in (("pairs", pairs), ("pair_need", needs)):
            self._parts[1].put(Watch._fields.index(name), table)
        self._workspace.look[0] = largest_standing_need(tables, self._watch)
        self._names = replace(self._names, tables=snapshot(tables))
        self._expect_contracts()
        self._world_changed()

    def _world_changed(self) -> None:
        """Take over an index that was built anew; measure every pair afresh."""
        if self._workspace.octree is not self.index.state:
            self._open_ledger(self._workspace._replace(octree=self.index.state))
        self._memory[FORCE] = 1

    def _open_ledger(self, workspace: Workspace) -> None:
        """Tell the loop where everything lies."""
        self._workspace = workspace
        self._ledger = Ledger(workspace)
        self._lines = self._ledger.lines
        self._addresses[SELF] = self._lines.ctypes.data


def scratch_of(tables: SceneTables, capacity: int) -> dict[str, NDArray[Any]]:
    """Arrays of a workspace that are the scene's own, or scratch, by name.

    Args:
        tables: The scene.
        capacity: Near pairs there is room for.
    """
    count, bodies = len(tables.kinds), len(tables.parent)
    return {
        **{name: getattr(tables, name) for name in OF_SCENE},
        "margin": np.array([tables.margin]),
        "exact_of": tables.exact.of_primitive,
        "exact_kinds": tables.exact.kinds,
        "exact_rows": tables.exact.rows,
        "T_next": np.zeros((bodies, 12)),
        "body_moved": np.zeros(bodies, dtype=np.uint8),
        "moved": np.zeros(count, dtype=np.uint8),
        "candidates": np.zeros(count, dtype=np.int32),
        "seen": np.zeros(count, dtype=np.int64),
        "kept": np.zeros((capacity, layout.NEAR_WIDTH)),
        "memo": np.zeros((MEMO_SIZE, MEMO_WIDTH), dtype=np.int64),
        "memo_rows": np.zeros((MEMO_SIZE, WITNESS_WIDTH)),
        "planes": np.zeros(PLANE_COUNT, dtype=np.int64),
        "normals": np.zeros((PLANE_COUNT, 3)),
        "look_box": np.zeros(6),
    }


def largest_standing_need(tables: SceneTables, watch: Watch) -> float:
    """More than any pair must keep for other reasons than motion [m]."""
    errors = watch.model + watch.base
    return float(tables.buffers.max(initial=0.0) + 2.0 * errors.max(initial=0.0))
