"""Initial state of a guard, allocated once from a compiled scene."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.guard.clusters import MOST_CLUSTERS, Cluster
from armguard.guard.static_errors import static_errors, static_needs
from armguard.guard.watch import (
    DELAY_SHARE,
    DELAY_STEPS,
    FEW,
    HISTORY,
    JUDGED_ROOM,
    RESTING,
    SLOW_TIME_DEFAULT,
    Agreement,
    Given,
    JudgedStop,
    LastCycle,
    Repeated,
    Timing,
    Watch,
)
from armguard.lanes import WIDTH
from armguard.motion.state import PLANS, StopClock
from armguard.record import records
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# Commands stored beyond the pending ones: cycles may be early.
SPARE_COMMANDS = 8


def watch_of(tables: SceneTables) -> Watch:
    """Initial state for a scene, with all robots at rest."""
    robots, n = len(tables.robots), len(tables.q_names)
    last, timing = records((), LastCycle), records((), Timing)
    last.now = -np.inf
    timing.period, timing.late = tables.period, tables.late
    timing.slow_time = SLOW_TIME_DEFAULT
    tools = [tables.links[part.tool] for part in tables.robots]
    return Watch(
        **samples_at_rest(tables),
        **pairs_at_rest(tables),
        **commands_at_rest(tables),
        **sightings_at_start(tables),
        given=records((), Given),
        last=last,
        timing=timing,
        phase=np.full(robots, RESTING, dtype=np.int64),
        ordered=np.zeros(robots),
        must=np.zeros(robots, dtype=np.int64),
        cause=np.zeros(robots, dtype=np.int64),
        fastest=np.zeros(n),
        fastest_at=np.zeros(robots),
        rest_low=np.zeros(n),
        rest_high=np.zeros(n),
        rest_began=np.zeros(robots),
        rested=np.zeros(robots, dtype=np.int64),
        level=np.zeros(robots, dtype=np.int64),
        time_left=np.zeros(robots),
        disproved=np.zeros(n, dtype=np.int64),
        deficit=np.zeros(robots),
        relief=np.zeros(robots),
        relieved=np.zeros(robots, dtype=np.int64),
        relief_until=np.zeros(robots),
        tool_body=np.array([frame.body for frame in tools], dtype=np.int64),
        tool_point=np.array([frame.T_body_link[:3, 3] for frame in tools]),
        row=np.zeros(n),
        recover=np.zeros(robots, dtype=np.int64),
        evades=np.zeros(robots, dtype=np.int64),
        yields=np.ones(robots, dtype=np.int64),
        lagged=np.zeros(robots, dtype=np.int64),
    )


def samples_at_rest(tables: SceneTables) -> dict[str, Any]:
    """Initial measurements and what follows from them, by field of a `Watch`."""
    robots, n = len(tables.robots), len(tables.q_names)
    return {
        "stamps": np.zeros(robots),
        "velocity": np.zeros(n),
        "last_stamp": np.full(robots, -np.inf),
        "sample_count": np.zeros(robots, dtype=np.int64),
        "sample_t": np.zeros((robots, HISTORY)),
        "sample_q": np.zeros((n, HISTORY)),
        "stuck": records(n, Repeated),
        "looked_at": np.full(robots, -np.inf),
        "may_stand": joints_of_fingers(tables),
        "agreement": no_agreement(n),
    }


def pairs_at_rest(tables: SceneTables) -> dict[str, Any]:
    """Static needs, and initial judgements of pairs, by field of a `Watch`."""
    robots, n = len(tables.robots), len(tables.q_names)
    m = tables.moving_count
    errors = static_errors(tables)
    count = len(tables.kinds)
    return {
        **errors,
        **listed_pairs(tables, errors["link_error"], errors["robot_error"]),
        "robot_of": tables.robot_of_primitive,
        "look": np.zeros(tables.modelled),
        "ahead": np.zeros(m),
        "reserve": np.zeros(m),
        "tight": np.zeros(m, dtype=np.int64),
        "swept": np.zeros(
            (6, m if tables.modelled > FEW else WIDTH * -(-count // WIDTH))
        ),
        "grown": np.zeros(m),
        "judged_pairs": np.zeros((JUDGED_ROOM, 3), dtype=np.int64),
        "judged_left": np.zeros(JUDGED_ROOM),
        "judged_count": np.zeros(1, dtype=np.int64),
        "judged_stops": records(2 * PLANS * n, JudgedStop),
        "judged_clock": records(PLANS * robots, StopClock),
        "judged_settled": np.zeros(1),
    }


def commands_at_rest(tables: SceneTables) -> dict[str, Any]:
    """Initial commands and observed delays, by field of a `Watch`."""
    robots, n = len(tables.robots), len(tables.q_names)
    commands = commands_under_way(tables)
    return {
        "wanted": np.zeros(n),
        "sent": np.zeros((commands, n)),
        "sent_at": np.full(commands, -np.inf),
        "held": np.zeros((commands, robots), dtype=np.int64),
        "sent_count": np.zeros(1, dtype=np.int64),
        "commanded": np.zeros(n),
        "commanded_at": np.full(1, -np.inf),
        "under_way": np.zeros((n, 2)),
        "driven_to": np.zeros((n, 2)),
        "band": np.zeros((n, 2)),
        "followed": np.tile([-np.inf, np.inf], (n, DELAY_STEPS)),
        "delays": np.zeros(robots),
    }


def sightings_at_start(tables: SceneTables) -> dict[str, Any]:
    """Moving objects, none of them seen yet, by field of a `Watch`."""
    speeds = tables.top_speeds
    count = len(speeds) and len(tables.kinds)
    clusters = MOST_CLUSTERS if tables.sensing else 0
    return {
        "top_speed": speeds,
        "movers": np.flatnonzero(speeds[: tables.modelled]).astype(np.int32),
        "seen_at": np.full(count, -np.inf),
        "sighted_at": np.full(count, -np.inf),
        "object_velocity": np.zeros((len(speeds), 3)),
        "object_stale": ages_of_objects(count, tables),
        "clusters": records(clusters, Cluster),
        "cluster_evaded": np.zeros(clusters, dtype=np.int64),
        "evaded": np.zeros(len(speeds), dtype=np.int64),
        "doubt": np.zeros(count, dtype=np.int64),
    }


def no_agreement(joints: int) -> Any:
    """Initial `Watch.agreement`, before the first sample, shape (joints,)."""
    found = records(joints, Agreement)
    found.latest = found.earlier = np.nan
    return found


def ages_of_objects(count: int, tables: SceneTables) -> Floats:
    """Age beyond which a sighting of each primitive is refused, shape (count,) [s]."""
    found = np.full(count, np.inf)
    for item in tables.standing.values():
        found[item.first : item.first + item.count] = item.stale
    return found


def joints_of_fingers(tables: SceneTables) -> Longs:
    """1 where a joint moves a gripper's finger, shape (n,)."""
    found = np.zeros(len(tables.q_names), dtype=np.int64)
    for part in tables.holds.grippers:
        for finger in part.fingers:
            j = int(tables.q_index[tables.links[finger].body])
            if j >= 0:
                found[j] = 1
    return found


def commands_under_way(tables: SceneTables) -> int:
    """Size of the ring of sent commands: greatest count of pending ones, and spares.

    It suffices for drives with the longest tested delay.
    """
    figures = [part.stopping for part in tables.robots if part.stopping is not None]
    most = DELAY_SHARE * DELAY_STEPS
    longest = max(
        (most * f.command + f.stale + f.sensing for f in figures), default=0.0
    )
    return int(np.ceil(longest / tables.period)) + SPARE_COMMANDS


def listed_pairs(tables: SceneTables, link: Floats, robot: Floats) -> dict[str, Any]:
    """Every checked pair of a small scene, else none, by field of a `Watch`.

    For few primitives, testing all pairs is faster than a search in the index.

    Args:
        tables: The scene.
        link: See `Watch.link_error`.
        robot: See `Watch.robot_error`.
    """
    few = tables.modelled <= FEW and tables.index.kind != "brute_force"
    pairs = all_pairs(tables) if few else np.zeros((0, 2), dtype=np.int32)
    lane = pairs[:, 1] % WIDTH
    first = np.stack([pairs[:, 0], pairs[:, 1] - lane], axis=1)
    # A block begins where a pair differs from the one before it.
    block = np.cumsum((np.diff(first, axis=0, prepend=-1) != 0).any(axis=1)) - 1
    blocks = np.zeros((len(np.unique(block)), 3), dtype=np.int32)
    needs = np.zeros((len(blocks), WIDTH))
    blocks[block, :2] = first
    np.bitwise_or.at(blocks[:, 2], block, 1 << lane)
    needs[block, lane] = static_needs(pairs, link, robot, tables)
    return {"pair_blocks": blocks, "block_need": needs}


def all_pairs(tables: SceneTables) -> NDArray[np.int32]:
    """Every checked pair in ascending order, shape (c, 2).

    In each pair a primitive that a robot moves is first.
    """
    p, m = tables.modelled, tables.moving_count
    i, j = np.triu_indices(p, 1)
    wanted = (i < m) & (tables.checked[tables.groups[i], tables.groups[j]] != 0)
    pairs = np.stack([i[wanted], j[wanted]], axis=1).astype(np.int32)
    behind = tables.robot_of_primitive[pairs[:, 0]] < 0
    pairs[behind] = pairs[behind, ::-1]
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]


def largest_static_need(tables: SceneTables, watch: Watch) -> float:
    """Upper bound of the static need of any pair, without object motion [m]."""
    errors = watch.link_error + watch.robot_error
    return float(tables.buffers.max(initial=0.0) + 2.0 * errors.max(initial=0.0))
