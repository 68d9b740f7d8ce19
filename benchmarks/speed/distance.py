"""`bench distance`: nanoseconds a pair, compiled, beside Coal."""

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from itertools import combinations_with_replacement
from multiprocessing import get_context
from time import perf_counter_ns
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from armguard.address import array_at, pointer
from armguard.geometry import (
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Shape,
    Sphere,
    Triangle,
)
from armguard.geometry.pairs import measure
from armguard.geometry.shapes import ROW_WIDTH, shape_row
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.kernel import kernel
from arrays import Floats
from peers.shapes import CoalPair, coal_pair
from timing import Progress, quiet

# Pairs of each kind, and calls of each of them that are timed together.
CYCLES = 200
REPEATS = 100

# Times the whole is measured, each in a process of its own: the least of them has met
# no other work, nor a place in memory that makes a processor mispredict branches [-].
PASSES = 4

# How far apart the shapes' frames are: about as large as the shapes, a mixture of pairs
# apart, near and overlapping, as a guard meets them [m].
SPREAD = 0.6

SHAPES: dict[str, type[Shape]] = {
    "sphere": Sphere,
    "capsule": Capsule,
    "box": Box,
    "triangle": Triangle,
    "cylinder": Cylinder,
    "cone": Cone,
    "ellipsoid": Ellipsoid,
    "half-space": HalfSpace,
    "hull": Hull,
}

# A call's overhead is what Coal takes for this pair, less what we take for it: its
# formula is the same few operations for both.
SHORTEST = ("sphere", "sphere")

# Every other pair that both libraries measure.
KINDS = tuple(
    pair
    for pair in combinations_with_replacement(SHAPES, 2)
    if pair not in (SHORTEST, ("half-space", "half-space"))
)


def bench(cycles: int, progress: Progress) -> dict[str, Any]:
    """Time of a signed distance with witness points, pair by pair.

    Ours is timed in compiled code. Coal is timed from Python, its functor made before;
    the overhead of a call, measured beside every pair, is taken off.
    """
    passes: list[Floats] = []
    for number in range(PASSES):
        progress(f"pass {number + 1} of {PASSES}: {len(KINDS)} pairs of kinds")
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as process:
            passes += process.map(time_pairs, range(len(KINDS)), [cycles] * len(KINDS))
    least = [np.min(passes[k :: len(KINDS)], axis=0) for k in range(len(KINDS))]
    rows = [row_of(names, *found) for names, found in zip(KINDS, least, strict=True)]
    median = {
        name: float(np.median([row[f"{name}_ns"] for row in rows]))
        for name in ("ours", "coal")
    }
    return {
        "ours": {"median_us": median["ours"] / 1e3},
        "peers": {"coal": {"median_us": median["coal"] / 1e3}},
        "ratio": {"coal": float(np.median([r["ratio"] for r in rows]))},
        "call_overhead_taken_off_ns": float(np.median([found[2] for found in least])),
        "pairs_of_a_kind": cycles,
        "by_pair": rows,
    }


def row_of(
    names: tuple[str, str],
    ours: Floats,
    theirs: Floats,
    overhead: Floats,
    distances: Floats,
) -> dict[str, Any]:
    """Times of the pairs of two kinds; of Coal's the overhead is taken off."""
    coal = np.maximum(theirs - overhead, 1.0)
    ratio, apart = coal / ours, distances > 0.0
    return {
        "pair": "-".join(names),
        "ours_ns": float(np.median(ours)),
        "ours_p99_ns": float(np.percentile(ours, 99)),
        "coal_ns": float(np.median(coal)),
        "coal_p99_ns": float(np.percentile(coal, 99)),
        "ratio": float(np.median(ratio)),
        "ratio_apart": float(np.median(ratio[apart])),
        "ratio_overlapping": float(np.median(ratio[~apart])),
        "overlapping": float(np.mean(~apart)),
    }


def time_pairs(kind: int, count: int) -> Floats:
    """Time of each pair: ours, Coal's, the overhead [ns]; and distances [m]: (4, n)."""
    rng = np.random.default_rng(kind)
    out = np.zeros(10)
    found = np.empty((4, count))
    with quiet():
        for k in range(count):
            short_ours, short_coal = time_pair(SHORTEST, rng, out)
            ours, coal = time_pair(KINDS[kind], rng, out)
            found[:, k] = ours, coal, short_coal - short_ours, out[0]
    return found


def time_pair(
    names: tuple[str, str], rng: np.random.Generator, out: Floats
) -> tuple[float, float]:
    """Time of one random pair, ours and Coal's [ns]; `out` holds its witness row."""
    a, b = (sample(name, rng) for name in names)
    T_a, T_b = random_frame(rng), random_frame(rng)
    # Rows and answer side by side, as in a table.
    table = np.zeros((3, ROW_WIDTH))
    table[:2] = shape_row(a, T_a), shape_row(b, T_b)
    row_a, row_b, answer = (row.ctypes.data for row in table)
    pair = (int(a.kind), row_a, int(b.kind), row_b)
    repeat(*pair, 2, answer)
    out[:] = table[2, :WITNESS_WIDTH]
    peer = coal_pair(a, T_a, b, T_b)
    ours = timed(repeat, *pair, REPEATS, answer)
    return ours / REPEATS, timed(call_often, peer) / REPEATS


def timed(call: Callable[..., object], *arguments: Any) -> float:
    """Duration of a call, the least of three [ns]."""
    least = np.inf
    for _ in range(3):
        start = perf_counter_ns()
        call(*arguments)
        least = min(least, perf_counter_ns() - start)
    return least


def call_often(peer: CoalPair) -> None:
    """Ask Coal as often as our kernel asks itself."""
    functor, T_a, T_b, request, result, _ = peer
    for _ in range(REPEATS):
        result.clear()
        functor(T_a, T_b, request, result)


@kernel(inline=False, entry=True)
def repeat(kind_a: int, a: int, kind_b: int, b: int, count: int, out: int) -> float:
    """Measure a pair again and again; the sum keeps the compiler from skipping it.

    Rows are given by their addresses, as in a cycle.
    """
    row_a = array_at(pointer(a), (ROW_WIDTH,), np.float64)
    row_b = array_at(pointer(b), (ROW_WIDTH,), np.float64)
    witness = array_at(pointer(out), (WITNESS_WIDTH,), np.float64)
    total = 0.0
    for _ in range(count):
        measure(kind_a, row_a, kind_b, row_b, witness)
        total += witness[0]
    return total


def sample(name: str, rng: np.random.Generator) -> Shape:
    """A shape of the size of a robot's link."""
    if name == "hull":
        points = rng.normal(size=(64, 3))
        points *= 0.15 / np.linalg.norm(points, axis=1)[:, None]
        return Hull(points=points * rng.uniform(0.5, 1.5, 3))
    if name == "cone":
        # Pointed: Coal has no truncated ones.
        radius, height = rng.uniform(0.05, 0.2, 2)
        return Cone(radius=radius, height=height)
    shape: Shape = SHAPES[name].example(rng, 0.2)
    return shape


def random_frame(rng: np.random.Generator) -> Floats:
    """A random frame, shape (4, 4)."""
    q = rng.normal(size=4)
    T = np.eye(4)
    T[:3, :3] = Rotation.from_quat(q, scalar_first=True).as_matrix()
    T[:3, 3] = rng.uniform(-SPREAD / 2, SPREAD / 2, 3)
    return T
