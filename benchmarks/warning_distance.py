"""How close an operator may work: clearance at the first slow and at the stop, by mode.

Writes docs/warning_distance.json and docs/images/warning_distance.png. Each approach is
a straight line in joint space from a random pose of the bay, one arm at a time, with
its tool at a given speed, driven until the guard orders a stop. What is counted is the
distance of the pair it is ordered for, by the same approaches in each mode.
"""

import json
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from armguard import Guard, Level, bay_scene
from armguard.cli.console import progress_bar
from armguard.robot.kinematics import forward_kinematics
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]

DOCS = Path(__file__).parents[1] / "docs"
MODES = ("path", "speed", "fixed")
SPEEDS = (0.1, 0.25, 0.4, 0.6)
APPROACHES = 40
PERIOD = 1e-3

# Poses from which approaches start are so far from the nearest thing [m]; of so many
# random ways the one is taken that leads nearest within a little [m].
NEAREST, FARTHEST = 0.15, 0.35
WAYS = 40
AHEAD = 0.02

# A way is driven no farther than this [m of the tool].
LONGEST = 0.6
COLOURS = {"path": "#0072B2", "speed": "#D55E00", "fixed": "#009E73"}


def tool(tables: SceneTables, q: Floats, arm: int) -> Floats:
    """Position of the last link of an arm, shape (3,) [m]."""
    T = np.zeros((len(tables.parent), 12))
    forward_kinematics(
        q,
        tables.parent,
        tables.joint_kind,
        tables.q_index,
        tables.gain,
        tables.T_parent_joint,
        tables.axis,
        T,
    )
    last = len(tables.parent) // 2 * (arm + 1) - 1
    return T[last, [3, 7, 11]]


def approaches(guard: Guard, count: int) -> list[tuple[int, Floats, Floats]]:
    """Arms, poses that are clear, and directions in which the tool moves."""
    rng = np.random.default_rng(11)
    tables, found = guard.tables, []
    while len(found) < count:
        q = guard.home + rng.uniform(-0.6, 0.6, 14)
        q = np.clip(q, tables.lower + 0.1, tables.upper - 0.1)
        near = guard.judge_at_rest(q).nearest
        if near is None or not NEAREST < near.distance < FARTHEST:
            continue
        arm = 0 if near.a.startswith("left/") else 1
        ways = [unit_way(tables, q, arm, rng) for _ in range(WAYS)]
        ahead = [distance_at(guard, q + AHEAD * way) for way in ways]
        best = int(np.argmin(ahead))
        if ahead[best] < near.distance - 0.3 * AHEAD:
            found.append((arm, q, ways[best]))
    return found


def unit_way(
    tables: SceneTables, q: Floats, arm: int, rng: np.random.Generator
) -> Floats:
    """Joint velocities of one arm that move its tool at 1 m/s, shape (n,)."""
    way = np.zeros(14)
    way[7 * arm : 7 * arm + 7] = rng.normal(size=7)
    step = tool(tables, q + 1e-6 * way, arm) - tool(tables, q, arm)
    return way * (1e-6 / float(np.linalg.norm(step)))


def distance_at(guard: Guard, q: Floats) -> float:
    """Least distance of a configuration [m]."""
    near = guard.judge_at_rest(q).nearest
    return FARTHEST if near is None else near.distance


def drive(guard: Guard, q: Floats, v: Floats, pace: float) -> tuple[float, float]:
    """Least distance when the arm is slowed first and when it is stopped [m]."""
    guard.reset()
    tables = guard.tables
    slow = np.inf
    q = q.copy()
    speed = np.zeros_like(v)
    for k in range(int((LONGEST / pace + 0.3) / PERIOD)):
        # It gets up to speed within the declared acceleration.
        share = min(k * PERIOD * 4.0 / max(np.abs(v).max(), 1e-9), 1.0)
        speed = share * v
        verdict = guard.step(q, k * PERIOD, velocity=speed, now=k * PERIOD)
        if verdict.reason >= 100:
            break
        if verdict.level >= Level.SLOW and slow == np.inf and verdict.nearest:
            slow = verdict.nearest.primitive_distance
        if verdict.level >= Level.STOP:
            near = verdict.nearest
            distance = np.nan if near is None else near.primitive_distance
            return (min(slow, 9.0), distance)
        q = q + PERIOD * speed
        if not ((q >= tables.lower) & (q <= tables.upper)).all():
            break
    return (np.nan, np.nan)


def main() -> None:
    """Measure, write, plot."""
    guards = {mode: Guard(bay_scene(mode)) for mode in MODES}
    ruler = bay_scene()
    ruler.set_margin(FARTHEST)
    ways = approaches(Guard(ruler), APPROACHES)
    results: dict[str, Any] = {}
    with progress_bar("approaching", len(SPEEDS) * len(ways)) as advance:
        for speed in SPEEDS:
            rows = []
            for _, q, direction in ways:
                found = [
                    drive(guards[mode], q, speed * direction, speed) for mode in MODES
                ]
                if all(np.isfinite(f[1]) for f in found):
                    rows.append([f[1] for f in found])
                advance(1)
            table = np.array(rows)
            results[f"{speed:g}"] = {
                "approaches": len(table),
                **{
                    mode: {
                        "mean_mm": float(1e3 * table[:, k].mean()),
                        "median_mm": float(1e3 * np.median(table[:, k])),
                    }
                    for k, mode in enumerate(MODES)
                },
                "path_over_speed": float(table[:, 0].mean() / table[:, 1].mean()),
            }
    (DOCS / "warning_distance.json").write_text(json.dumps(results, indent=1) + "\n")
    plot(results)
    print(json.dumps(results, indent=1))


def plot(results: dict[str, Any]) -> None:
    """Mean clearance at the stop against the tool's speed."""
    figure, axes = plt.subplots(figsize=(6.4, 4.0), layout="constrained")
    speeds = [float(s) for s in results]
    for mode in MODES:
        means = [results[s][mode]["mean_mm"] for s in results]
        axes.plot(speeds, means, "o-", color=COLOURS[mode], label=mode)
    axes.set_xlabel("speed of the tool [m/s]")
    axes.set_ylabel("mean distance when the stop is ordered [mm]")
    axes.set_ylim(bottom=0)
    axes.grid(alpha=0.3)
    axes.legend(title="mode")
    figure.savefig(DOCS / "images" / "warning_distance.png", dpi=130)


if __name__ == "__main__":
    main()
