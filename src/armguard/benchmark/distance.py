"""`bench distance`: nanoseconds a pair, compiled, beside Coal."""

from collections.abc import Callable
from time import perf_counter_ns
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.benchmark.machine import describe_machine
from armguard.benchmark.peers.coal_pairs import CoalPair, coal_pair
from armguard.benchmark.timing import quiet
from armguard.geometry import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    Hull,
    Shape,
    Sphere,
    Triangle,
)
from armguard.geometry.pairs import measure
from armguard.geometry.shapes import shape_row
from armguard.kernel import kernel

Floats = NDArray[np.float64]
Progress = Callable[[str], None]

# Pairs of each kind, and calls of each of them that are timed together.
PAIRS = 300
REPEATS = 100

# How far apart the shapes' frames are: about as large as the shapes, a mixture of pairs
# apart, near and overlapping, as a guard meets them [m].
SPREAD = 0.5

KINDS = (
    ("sphere", "sphere"),
    ("capsule", "capsule"),
    ("capsule", "box"),
    ("box", "box"),
    ("hull", "hull"),
    ("capsule", "hull"),
    ("capsule", "triangle"),
    ("capsule", "cylinder"),
    ("box", "cylinder"),
    ("cylinder", "cylinder"),
    ("ellipsoid", "ellipsoid"),
    ("sphere", "hull"),
)

# The pair whose formula is so short that what its call takes is the call itself.
OVERHEAD_PAIR = ("sphere", "sphere")


def bench_distance(cycles: int | None, progress: Progress) -> dict[str, Any]:
    """Time of a signed distance with witness points, pair by pair.

    Ours is timed in compiled code. Coal is timed from Python, its functor made before;
    the time of its shortest pair, all of it call overhead, is taken off.

    Args:
        cycles: Pairs of each kind.
        progress: Called with a sentence before each kind.
    """
    count = PAIRS if cycles is None else cycles
    rows: list[dict[str, Any]] = []
    overhead = 0.0
    for names in KINDS:
        progress(f"{names[0]} against {names[1]}")
        ours, theirs = time_pairs(names, count)
        if names == OVERHEAD_PAIR:
            overhead = float(np.median(theirs))
            continue
        coal = np.maximum(theirs - overhead, 1.0)
        rows.append(
            {
                "pair": f"{names[0]}-{names[1]}",
                "ours_ns": float(np.median(ours)),
                "ours_p99_ns": float(np.percentile(ours, 99)),
                "coal_ns": float(np.median(coal)),
                "coal_p99_ns": float(np.percentile(coal, 99)),
                "ratio": float(np.median(coal) / np.median(ours)),
            }
        )
    median = {key: float(np.median([r[f"{key}_ns"] for r in rows])) for key in NAMES}
    return {
        "name": "distance",
        "machine": describe_machine(),
        "ours": {"median_us": median["ours"] / 1e3},
        "peers": {"coal": {"median_us": median["coal"] / 1e3}},
        "ratio": {"coal": float(np.median([r["ratio"] for r in rows]))},
        "call_overhead_taken_off_ns": overhead,
        "pairs_of_a_kind": count,
        "by_pair": rows,
    }


NAMES = ("ours", "coal")


def time_pairs(names: tuple[str, str], count: int) -> tuple[Floats, Floats]:
    """Time of each of `count` pairs, ours and Coal's, in turns [ns]."""
    rng = np.random.default_rng(5)
    out = np.zeros(10)
    ours, theirs = np.empty(count), np.empty(count)
    with quiet():
        for k in range(count):
            a, b = (sample(name, rng) for name in names)
            T_a, T_b = random_frame(rng), random_frame(rng)
            row_a, row_b = shape_row(a, T_a), shape_row(b, T_b)
            pair = (int(a.kind), row_a, int(b.kind), row_b)
            repeat(*pair, 2, out)
            peer = coal_pair(a, T_a, b, T_b)
            ours[k] = timed(repeat, *pair, REPEATS, out)
            theirs[k] = timed(call_often, peer)
    return ours / REPEATS, theirs / REPEATS


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
    functor, T_a, T_b, request, result = peer
    for _ in range(REPEATS):
        result.clear()
        functor(T_a, T_b, request, result)


@kernel(inline=False)
def repeat(
    kind_a: int, a: Floats, kind_b: int, b: Floats, count: int, out: Floats
) -> float:
    """Measure a pair again and again; the sum keeps the compiler from skipping it."""
    total = 0.0
    for _ in range(count):
        measure(kind_a, a, kind_b, b, out)
        total += out[0]
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
    }
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
