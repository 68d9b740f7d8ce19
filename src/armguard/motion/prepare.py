"""Arrays of the stop prediction, allocated once from a compiled scene."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.lanes import WIDTH
from armguard.motion import figures as place
from armguard.motion.chains import (
    Chains,
    anchor,
    chains,
    primitive_levers,
    strokes,
)
from armguard.motion.figures import JointFigures, RobotFigures
from armguard.motion.joint_rows import JointRow
from armguard.motion.joint_stop import JointStop
from armguard.motion.outermost import led_beyond, true_limits
from armguard.motion.state import (
    BOX_LEVELS,
    GRID,
    NODES,
    PLANS,
    Ball,
    Effort,
    JointColumn,
    JointSwing,
    LinePart,
    Motion,
    PathSpan,
    StopClock,
)
from armguard.record import records
from armguard.robot.stopping import StopTable
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]

MODES = {"fixed": place.FIXED, "speed": place.SPEED, "path": place.PATH}


def motion_of(tables: SceneTables, budget: int) -> Motion:
    """Arrays of the stop prediction for a scene.

    Args:
        tables: The scene.
        budget: Greatest number of intervals that a cycle may test.
    """
    m, b, n = tables.moving_count, len(tables.parent), len(tables.q_names)
    found, effort = chains(tables), records((), Effort)
    depth = found.joints.shape[1]
    effort.budget = budget
    return Motion(
        parent=tables.parent,
        joint_kind=tables.joint_kind,
        q_index=tables.q_index,
        gain=tables.gain,
        T_parent_joint=tables.T_parent_joint,
        axis=tables.axis,
        joints=found.joints,
        length=found.length,
        shared=found.shared,
        levers=found.levers,
        exact_levers=exact_levers(tables, found.joints, found.length),
        joint_figures=joint_figures(tables),
        robot_figures=robot_figures(tables),
        curves=stop_curves(tables),
        robot_of_joint=robot_of_joint(tables),
        q=np.zeros(n),
        v_low=np.zeros(n),
        v_high=np.zeros(n),
        driven=np.zeros((PLANS * n, 2)),
        clock=records(PLANS * len(tables.robots), StopClock),
        span=records((), PathSpan),
        effort=effort,
        up=records(PLANS * n, JointStop),
        down=records(PLANS * n, JointStop),
        middle=np.zeros((PLANS + GRID, b)),
        width=np.zeros((PLANS + GRID, b)),
        spread=np.zeros((PLANS + GRID, b)),
        grid_stamp=np.zeros(GRID, dtype=np.int64),
        axes=np.zeros((b, 6)),
        reach=np.zeros((PLANS, m)),
        speed=np.zeros(b),
        rate=np.zeros(m),
        blur=by_levers("position_error", tables, found),
        push=by_levers("acceleration", tables, found),
        balls=records(m, Ball),
        twists=np.zeros((2 * b, 6)),
        loose=np.zeros((2, m)),
        middle_T=np.zeros((b, 12)),
        middle_axes=np.zeros((b, 6)),
        middle_balls=np.zeros((m, 3)),
        **halved_scratch(n, b),
        sizes=np.zeros(b),
        corner_T=np.zeros((b, 12)),
        columns=records(2 * depth, JointColumn),
        lever_rows=records(depth, JointRow),
        hessian=np.zeros((depth, WIDTH * depth)),
        swings=records(n, JointSwing),
    )


def robot_of_joint(tables: SceneTables) -> NDArray[np.int32]:
    """Robot of each joint, shape (n,)."""
    counts = [part.joint_count for part in tables.robots]
    return np.repeat(np.arange(len(counts), dtype=np.int32), counts)


def halved_scratch(n: int, b: int) -> dict[str, Any]:
    """Scratch for stop paths halved in time and in joint positions, by field.

    Args:
        n: Count of joints.
        b: Count of bodies.
    """
    return {
        "node_stamp": np.zeros(PLANS * NODES, dtype=np.int64),
        "node_q": np.zeros((PLANS * NODES, n)),
        "node_T": np.zeros((PLANS * NODES * b, 12)),
        "node_axes": np.zeros((PLANS * NODES * b, 6)),
        "node_way": np.zeros((PLANS * NODES, b)),
        "node_wide": np.zeros((PLANS * NODES, b)),
        "node_grow": np.zeros((PLANS * NODES, b)),
        **{
            f"q_{name}": np.zeros(n) for name in ("half", "node", "way", "wide", "grow")
        },
        "box_line": whole_lines(),
        "box_place": np.zeros((BOX_LEVELS + 1, b)),
        "box_part": np.ones((BOX_LEVELS + 1, b)),
        "box_axes": np.zeros((b, 6)),
    }


def whole_lines() -> Any:
    """Whole lines of intervals, for each box, shape (BOX_LEVELS + 1,)."""
    lines = records(BOX_LEVELS + 1, LinePart)
    lines.half = 1.0
    return lines


def exact_levers(
    tables: SceneTables, joints: NDArray[np.int32], length: NDArray[np.int32]
) -> Floats:
    """Levers of the exact shapes of links that move, shape (e, depth) [m]."""
    levers = np.zeros((len(tables.exact.kinds), joints.shape[1]))
    body_of: dict[int, int] = {}
    for i in range(tables.moving_count):
        first, count = tables.exact.of_primitive[i]
        for e in range(first, first + count):
            body_of[e] = int(tables.bodies[i])
    for e, body in body_of.items():
        chain = joints[body, : length[body]].tolist()
        levers[e, : len(chain)] = primitive_levers(
            anchor(int(tables.exact.kinds[e]), tables.exact.rows[e]),
            chain,
            tables.joint_kind,
            tables.T_parent_joint,
            tables.axis,
            strokes(
                chain,
                tables.joint_kind,
                tables.gain,
                tables.q_index,
                *true_limits(tables),
            ),
        )
    return levers


# Figures of joints that are not fields of `StoppingFigures`.
DERIVED = ("led_beyond", "curve", "swing_share", "speed_up_way", "return_way")


def joint_figures(tables: SceneTables) -> Any:
    """`JointFigures` of each joint, shape (n,); zeros for robots without figures."""
    rows = records(len(tables.q_names), JointFigures)
    rows["led_beyond"] = led_beyond(tables)
    for part in tables.robots:
        own = rows[part.first_joint : part.first_joint + part.joint_count]
        if part.stopping is None:
            continue
        for name in set(own.dtype.names).difference(DERIVED):
            own[name] = getattr(part.stopping, name)
        own["curve"] = [name in part.stopping.tables for name in part.joints]
        own["swing_share"] = own["settle"] / own["velocity"]
        with np.errstate(divide="ignore"):
            own["speed_up_way"] = 1.0 / own["acceleration"]
            own["return_way"] = own["speed_up_way"] + 1.0 / own["deceleration_most"]
    return rows


def by_levers(figure: str, tables: SceneTables, found: Chains) -> Floats:
    """Bound on the effect of a joint figure on each primitive's points, shape (m,).

    An acceleration [m/s²], or a position error [m].
    """
    by_joint = joint_figures(tables)[figure]
    by_body = np.abs(tables.gain[:, 0]) * by_joint[tables.q_index]
    most = np.zeros(tables.moving_count)
    for i, body in enumerate(tables.bodies[: tables.moving_count]):
        count = found.length[body]
        most[i] = found.levers[i, :count] @ by_body[found.joints[body, :count]]
    return most


def robot_figures(tables: SceneTables) -> Any:
    """`RobotFigures` of each robot, shape (r,)."""
    rows = records(len(tables.robots), RobotFigures)
    for row, part in zip(rows, tables.robots, strict=True):
        row["mode"] = MODES[part.mode]
        row["first_joint"], row["joint_count"] = part.first_joint, part.joint_count
        if part.stopping is not None:
            for name in rows.dtype.names[3:]:
                row[name] = getattr(part.stopping, name)
    return rows


def stop_curves(tables: SceneTables) -> Floats:
    """Measured stops at even speeds, times then distances, (n, 2 · CURVE_POINTS)."""
    curves = np.zeros((len(tables.q_names), 2 * place.CURVE_POINTS))
    for part in tables.robots:
        if part.stopping is None:
            continue
        for k, name in enumerate(part.joints):
            if name in part.stopping.tables:
                curves[part.first_joint + k] = curve_row(
                    part.stopping.tables[name], float(part.stopping.velocity[k])
                )
    return curves


def curve_row(table: StopTable, top: float) -> Floats:
    """Table of measured stops at even speeds up to the top one, (2 · CURVE_POINTS,).

    The time of each piece between two even speeds is that of the next higher measured
    speed. The distance follows the straight lines between the measured ones, raised
    where a measured one is above the line between two even speeds.
    """
    even = np.linspace(0.0, top, place.CURVE_POINTS)
    step = even[1]
    times = np.array([table.at(v + step)[0] for v in even])
    ways = np.array([table.at(v)[1] for v in even])
    for v, way in zip(table.speeds, table.travels, strict=True):
        if 0.0 < v < top:
            k = min(int(v / step), place.CURVE_POINTS - 2)
            line = float(np.interp(v, even[k : k + 2], ways[k : k + 2]))
            ways[k : k + 2] += max(way - line, 0.0)
    return np.concatenate([times, ways])
