"""`bench distance`: nanoseconds a pair, compiled, beside Coal."""

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from itertools import combinations_with_replacement
from multiprocessing import get_context
from time import perf_counter_ns
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from armguard.address import pointer
from armguard.benchmark.machine import describe_machine
from armguard.benchmark.peers.coal_pairs import CoalPair, coal_pair
from armguard.benchmark.timing import quiet
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

Floats = NDArray[np.float64]
Progress = Callable[[str], None]

# Pairs of each kind, and calls of each of them that are timed together.
PAIRS = 200
REPEATS = 100

# Times the whole is measured, each in a process of its own: the least of them has met
# no other work, nor a place in memory that makes a processor mispredict branches [-].
PASSES = 4

# How far apart the shapes' frames are: about as large as the shapes, a mixture of pairs
# apart, near and overlapping, as a guard meets them [m].
SPREAD = 0.6

SHAPE_NAMES = (
    "sphere",
    "capsule",
    "box",
    "triangle",
    "cylinder",
    "cone",
    "ellipsoid",
    "half-space",
    "hull",
)

# A call's overhead is what Coal takes for this pair, less what we take for it: its
# formula is the same few operations for both.
SHORTEST = ("sphere", "sphere")

# Every other pair that both libraries measure.
KINDS = tuple(
    pair
    for pair in combinations_with_replacement(SHAPE_NAMES, 2)
    if pair not in (SHORTEST, ("half-space", "half-space"))
)


def bench_distance(cycles: int | None, progress: Progress) -> dict[str, Any]:
    """Time of a signed distance with witness points, pair by pair.

    Ours is timed in compiled code. Coal is timed from Python, its functor made before;
    the overhead of a call, measured beside every pair, is taken off.

    Args:
        cycles: Pairs of each kind.
        progress: Called with a sentence before each kind.
    """
    count = PAIRS if cycles is None else cycles
    passes: list[Floats] = []
    for number in range(PASSES):
        progress(f"pass {number + 1} of {PASSES}: {len(KINDS)} pairs of kinds")
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as process:
            passes += process.map(time_pairs, range(len(KINDS)), [count] * len(KINDS))
    rows = []
    overheads = []
    for k, names in enumerate(KINDS):
        ours, theirs, overhead, distances = np.min(passes[k :: len(KINDS)], axis=0)
        coal = np.maximum(theirs - overhead, 1.0)
        overheads.append(overhead)
        apart = distances > 0.0
        rows.append(
            {
                "pair": f"{names[0]}-{names[1]}",
                "ours_ns": float(np.median(ours)),
                "ours_p99_ns": float(np.percentile(ours, 99)),
                "coal_ns": float(np.median(coal)),
                "coal_p99_ns": float(np.percentile(coal, 99)),
                "ratio": float(np.median(coal / ours)),
                "ratio_apart": float(np.median((coal / ours)[apart])),
                "ratio_overlapping": float(np.median((coal / ours)[~apart])),
                "overlapping": float(np.mean(~apart)),
            }
        )
    median = {key: float(np.median([r[f"{key}_ns"] for r in rows])) for key in NAMES}
    return {
        "name": "distance",
        "machine": describe_machine(),
        "ours": {"median_us": median["ours"] / 1e3},
        "peers": {"coal": {"median_us": median["coal"] / 1e3}},
        "ratio": {"coal": float(np.median([r["ratio"] for r in rows]))},
        "call_overhead_taken_off_ns": float(np.median(overheads)),
        "pairs_of_a_kind": count,
        "by_pair": rows,
    }


NAMES = ("ours", "coal")


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

    Rows are handed over as the cycle does it, by their addresses.
    """
    row_a = numba.carray(pointer(a), (ROW_WIDTH,), np.float64)
    row_b = numba.carray(pointer(b), (ROW_WIDTH,), np.float64)
    witness = numba.carray(pointer(out), (WITNESS_WIDTH,), np.float64)
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
    makers: dict[str, type[Shape]] = {
        "sphere": Sphere,
        "capsule": Capsule,
        "box": Box,
        "triangle": Triangle,
        "cylinder": Cylinder,
        "ellipsoid": Ellipsoid,
        "half-space": HalfSpace,
    }
    if name == "cone":
        # Pointed: Coal has no truncated ones.
        radius, height = rng.uniform(0.05, 0.2, 2)
        return Cone(radius=radius, height=height)
    shape: Shape = makers[name].example(rng, 0.2)
    return shape


def random_frame(rng: np.random.Generator) -> Floats:
    """A random frame, shape (4, 4)."""
    q = rng.normal(size=4)
    w, x, y, z = q / np.linalg.norm(q)
    T = np.eye(4)
    T[:3, :3] = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )
    T[:3, 3] = rng.uniform(-SPREAD / 2, SPREAD / 2, 3)
    return T
