"""`bench regions`: whole arms beside region octrees of 10 mm; processor time.

The exact distances of the same primitives judge both comparisons.
"""

from time import thread_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

import armguard as ag
from armguard.scene.bay import bay_scene
from armguard.scene.compile import compile_scene
from armguard.scene.restricted import restricted
from armguard.scene.tables import SceneTables
from armguard.scene.two_pandas import two_pandas_scene
from arrays import Floats
from timing import Progress

CYCLES = 10_000

# Edge of a cell [m], cells along an edge of the cube, and its middle in each scene [m].
CELL, SIZE = 0.01, 512
SCENES = {
    "two Pandas": (two_pandas_scene, (0.0, 0.0, 0.5)),
    "bay": (bay_scene, (0.0, 0.0, 1.3)),
}

# Straight motions that a plan consists of.
MOTIONS = 20


def bench(cycles: int, progress: Progress) -> dict[str, Any]:
    """Rates of both comparisons, and where they differ from exact distances."""
    answer: dict[str, Any] = {"cell_mm": 1e3 * CELL, "configurations": cycles}
    for name, (make, centre) in SCENES.items():
        progress(f"comparing {cycles} configurations of {name}, each in two ways")
        answer[name] = of_scene(compile_scene(make()), centre, cycles)
    return answer


def of_scene(
    t: SceneTables, centre: tuple[float, float, float], count: int
) -> dict[str, Any]:
    """Figures of one scene."""
    trees = ag.RegionTrees(t, centre, CELL, SIZE)
    words = [one.claims.occupied.words for one in trees.trees]
    black = sum(int(np.bitwise_count(each).sum()) for each in words)
    checker, rng = ag.Checker(with_static_objects(t)), np.random.default_rng(7)
    rows = {"random": rng.uniform(t.lower, t.upper, (count, len(t.q_names)))}
    rows["plan"] = plan_of(checker, t, rng, count)
    answer: dict[str, Any] = {"trees": len(trees.trees), "black_cells": black}
    for kind, q in rows.items():
        exact = checker.clear(q)
        answer[kind] = {"clear_exactly": float(exact.mean())}
        for way, rasterised in (("primitives", False), ("two trees", True)):
            trees.compare(q[:2], rasterised=rasterised)
            begin = thread_time()
            found = trees.compare(q, rasterised=rasterised)
            seconds = thread_time() - begin
            outside = ~found.clear & (found.cell[:, 0] < 0)
            needless = exact & ~found.clear & ~outside
            answer[kind][way] = {
                "per_s": count / seconds,
                "seconds": seconds,
                "missed": int((~exact & found.clear).sum()),
                "needless": int(needless.sum()),
                "greatest_mm": 1e3 * farthest(checker, t, q[needless]),
                "outside": int(outside.sum()),
                "visited": float(found.visited.mean()),
                "visited_share": float(found.visited.mean()) / black,
            }
    return answer


def with_static_objects(t: SceneTables) -> SceneTables:
    """The pairs of a moving link and something static alone."""
    static = np.ones(len(t.groups), dtype=np.intp)
    static[: t.moving_count] = t.robot_of_primitive < 0
    return restricted(t, static, lambda a, b: a + b == 1)


def plan_of(
    checker: ag.Checker, t: SceneTables, rng: np.random.Generator, count: int
) -> Floats:
    """Steps along straight motions between configurations that are clear."""
    tried = rng.uniform(t.lower, t.upper, (400 * MOTIONS, len(t.q_names)))
    knots = tried[checker.clear(tried)][: MOTIONS + 1]
    assert len(knots) > 1
    at = np.linspace(0.0, len(knots) - 1.0, count)
    columns = [np.interp(at, np.arange(len(knots)), each) for each in knots.T]
    return np.ascontiguousarray(np.column_stack(columns))


def farthest(checker: ag.Checker, t: SceneTables, q: Floats) -> float:
    """Greatest distance beyond its buffer of the pair with the least such [m]."""
    worst = 0.0
    for row in q:
        near: NDArray[np.float64] = above_buffers(checker, t, row)
        worst = max(worst, float(near.min(initial=1.0)))
    return worst


def above_buffers(checker: ag.Checker, t: SceneTables, row: Floats) -> Floats:
    """Distances of near pairs less their buffers, by exact shapes of primitives [m]."""
    found = checker.near(row[None], float(t.buffers.max()) + 0.05)
    return np.asarray(found.distance - t.buffers[t.groups[found.a], t.groups[found.b]])
