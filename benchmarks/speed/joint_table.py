"""`bench joint_table`: the joint-space table beside the octree and brute force.

Times of the table itself are those of its thread, so that other processes disturb them
less. All distances of the random configurations are measured one by one: what is
within the margin has to be a candidate.
"""

from dataclasses import replace
from time import thread_time
from typing import Annotated, Any, NamedTuple

import numpy as np

from armguard.geometry.pairs import measure
from armguard.geometry.place import place_row
from armguard.guard.world_at_home import build_index
from armguard.guard.world_at_home import world_at_home as placed_world
from armguard.index import JointTable, World
from armguard.index.joint_cells import (
    BITS,
    JointCells,
    locate_cells,
    table_candidates,
)
from armguard.index.octree_state import Residency
from armguard.kernel import kernel
from armguard.record import Records
from armguard.respond import Guard
from armguard.robot.kinematics import forward_kinematics
from armguard.scene import SceneTables, bay_scene
from armguard.scene.compile import compile_scene
from armguard.table import (
    IntVector,
    Ledger,
    LongVector,
    Matrix,
    Vector,
    opener,
    table,
)
from arrays import Floats
from speed.scenes import crowded_bay, sway
from timing import Progress, percentiles, quiet, time_in_turns

CYCLES = 2000

# Random configurations for each cycle, and in one call.
CONFIGURATIONS, CHUNK = 5000, 100_000

# Configurations in which queries are timed.
QUERIES = 20_000

KINDS = ("joint_table", "octree", "brute_force")
SIZES = (35, 100, 200, 1_000, 10_000)


@table
class Trial(NamedTuple):
    """A scene and its joint-space table.

    Attributes:
        parent: See `SceneTables`, to `local_rows`.
        joint_kind: Kinds of joints.
        q_index: Places in q.
        gain: Multipliers and offsets.
        T_parent_joint: Joint frames.
        axis: Joint axes.
        bodies: Body of each primitive.
        local_rows: Primitives in the frames of their bodies.
        T: Scratch for poses, shape (b, 12).
        witness: Scratch for a witness row, shape (10,).
        out: Scratch for candidates, shape (p,).
        counts: Pairs within the margin, those of them that are no candidates, and
            candidates with a bit; they are added up, shape (3,).
        world: The primitives.
        cells: The table.
        residency: Which primitives are present.
    """

    parent: IntVector
    joint_kind: IntVector
    q_index: IntVector
    gain: Matrix
    T_parent_joint: Matrix
    axis: Matrix
    bodies: IntVector
    local_rows: Matrix
    T: Matrix
    witness: Vector
    out: IntVector
    counts: LongVector
    world: World
    cells: JointCells
    residency: Annotated[Records[Residency], 1]


open_trial = opener(Trial)


def bench(cycles: int, progress: Progress) -> dict[str, Any]:
    """Build, memory, queries, moved objects, omitted pairs, and whole cycles."""
    tables = compile_scene(bay_scene())
    build_table(tables)
    start = thread_time()
    index = build_table(tables)
    built = thread_time() - start
    trial = trial_of(tables, index)
    progress("queries")
    asked = queries(tables, trial)
    progress("moved objects")
    moved = refreshes(index)
    progress("omitted pairs")
    omitted = omissions(cycles * CONFIGURATIONS, tables, trial, progress)
    sizes = []
    for size in SIZES:
        progress(f"the indices at {size} primitives")
        sizes.append(against_others(size, max(cycles // 4, 10)))
    return {
        "build_s": built,
        **index.statistics(),
        **asked,
        **moved,
        **omitted,
        "against_octree_and_brute_force": sizes,
    }


def build_table(tables: SceneTables) -> JointTable:
    """The table of a scene with its robots at home."""
    world = placed_world(tables, np.zeros((len(tables.parent), 12)))
    settings = replace(tables.index, kind="joint_table")
    index = build_index(replace(tables, index=settings), world)
    assert isinstance(index, JointTable)
    return index


def trial_of(tables: SceneTables, index: JointTable) -> Trial:
    """The arrays of a scene and its table."""
    return Trial(
        **{name: getattr(tables, name) for name in Trial._fields[:8]},
        T=np.zeros((len(tables.parent), 12)),
        witness=np.zeros(10),
        out=np.zeros(len(tables.kinds), dtype=np.int32),
        counts=np.zeros(3, dtype=np.int64),
        world=index.world,
        cells=index.cells,
        residency=index.residency,
    )


@kernel(inline=False, entry=True)
def count_pairs(q: Floats, reach: float, lines: Any) -> None:
    """Measure all pairs of a link and a primitive with a bit, and add up the counts.

    Args:
        q: Configurations, shape (k, n).
        reach: Distance up to which a pair has to be a candidate [m].
        lines: Ledger of a `Trial`.
    """
    t = open_trial(lines)
    cells, world = t.cells, t.world
    for k in range(q.shape[0]):
        forward_kinematics(
            q[k],
            t.parent,
            t.joint_kind,
            t.q_index,
            t.gain,
            t.T_parent_joint,
            t.axis,
            t.T,
        )
        locate_cells(q[k], cells)
        for i in range(cells.link_of.shape[0]):
            link = cells.link_of[i]
            if link < 0:
                continue
            body = t.bodies[i]
            place_row(world.kinds[i], t.local_rows[i], t.T[body], world.rows[i])
            for c in range(cells.columns.shape[0]):
                j = cells.columns[c]
                measure(
                    world.kinds[i],
                    world.rows[i],
                    world.kinds[j],
                    world.rows[j],
                    t.witness,
                )
                bit = cells.bits[cells.row[link], c // BITS] >> (c % BITS) & 1
                t.counts[2] += bit
                if t.witness[0] <= reach:
                    t.counts[0] += 1
                    t.counts[1] += 1 - bit


@kernel(inline=False, entry=True)
def locate_all(q: Floats, lines: Any) -> int:
    """Find the cells of all links in configurations of shape (k, n); a check sum."""
    t = open_trial(lines)
    found = 0
    for k in range(q.shape[0]):
        locate_cells(q[k], t.cells)
        found += t.cells.row[0]
    return found


@kernel(inline=False, entry=True)
def query_all(q: Floats, lines: Any) -> int:
    """Do the same, and list the candidates of every link; their number."""
    t = open_trial(lines)
    found = 0
    for k in range(q.shape[0]):
        locate_cells(q[k], t.cells)
        for i in range(t.cells.link_of.shape[0]):
            if t.cells.link_of[i] >= 0:
                found += table_candidates(i, t.cells, t.residency, t.out)
    return found


def queries(tables: SceneTables, trial: Trial) -> dict[str, float]:
    """Time of the cells of a configuration and of a link's candidates [us]."""
    rng = np.random.default_rng(1)
    shape = (QUERIES, len(tables.lower))
    q = rng.uniform(tables.lower, tables.upper, shape)
    ledger = Ledger(trial)
    times = {}
    for name, call in (("locate", locate_all), ("query", query_all)):
        call(q[:10], ledger.lines)
        start = thread_time()
        call(q, ledger.lines)
        times[name] = thread_time() - start
    links = int((trial.cells.link_of >= 0).sum())
    return {
        "configuration_located_us": times["locate"] / QUERIES * 1e6,
        "link_queried_us": times["query"] / (QUERIES * links) * 1e6,
    }


def refreshes(index: JointTable) -> dict[str, float]:
    """Time until the table is right again after one object moved [ms]."""
    times, rows = [], index.world.rows
    for i in index.cells.columns.tolist():
        for way in (0.1, -0.1):
            rows[i, 3] += way
            start = thread_time()
            index.update(i)
            index.refresh()
            times.append(thread_time() - start)
    return {
        "object_moved_mean_ms": float(np.mean(times)) * 1e3,
        "object_moved_max_ms": float(np.max(times)) * 1e3,
    }


def omissions(
    count: int, tables: SceneTables, trial: Trial, progress: Progress
) -> dict[str, Any]:
    """Pairs within the margin in random configurations that are no candidates."""
    rng = np.random.default_rng(2)
    ledger = Ledger(trial)
    left = count
    while left > 0:
        shape = (min(left, CHUNK), len(tables.lower))
        q = rng.uniform(tables.lower, tables.upper, shape)
        count_pairs(q, tables.margin, ledger.lines)
        left -= len(q)
        if left % (10 * CHUNK) == 0:
            progress(f"{count - left} configurations, {trial.counts[1]} omitted")
    links = int((trial.cells.link_of >= 0).sum())
    return {
        "configurations": count,
        "pairs_within_the_margin": int(trial.counts[0]),
        "omitted": int(trial.counts[1]),
        "candidates_of_a_link": float(trial.counts[2] / (count * links)),
    }


def against_others(size: int, cycles: int) -> dict[str, Any]:
    """Whole cycles in the crowded bay with each index, in turns, and their counts."""
    guards = []
    for kind in KINDS:
        scene = crowded_bay(size)
        scene.index = replace(scene.index, kind=kind, cube=None)
        guards.append(Guard(scene))
    tables = guards[0].tables
    q = sway(tables, cycles)
    rng = np.random.default_rng(3)
    random = rng.uniform(tables.lower, tables.upper, (50, len(tables.lower)))
    verdicts = [[guard.step(row) for row in random] for guard in guards]
    same = all(
        len({v.tobytes() for v in row}) == 1 for row in zip(*verdicts, strict=True)
    )
    with quiet():
        passes = 5 if size <= 200 else 1
        times = time_in_turns([guard.step for guard in guards], q, passes=passes)
    row: dict[str, Any] = {"primitives": size, "same_verdicts": same}
    for kind, guard, t, found in zip(KINDS, guards, times, verdicts, strict=True):
        counts = [v.counts for v in found]
        row[f"{kind}_median_us"] = percentiles(t)["median_us"]
        row[f"{kind}_candidate_pairs"] = float(
            np.mean([c.pairs_tested + c.pairs_filtered + c.pairs_apart for c in counts])
        )
        row[f"{kind}_bytes"] = guard.index.statistics()["bytes"]
    return row
