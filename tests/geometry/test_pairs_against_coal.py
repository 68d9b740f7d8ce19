"""Pairs of spheres, capsules and boxes against Coal: one hundred thousand in all.

The other kinds are judged in test_accuracy.py.
"""

from itertools import combinations_with_replacement

import coal
import numpy as np
import pytest

from armguard.geometry.pairs import measure
from armguard.geometry.shapes import shape_row
from coal_shapes import coal_request, coal_shape
from oracle import signed_distance
from worlds import SIMPLE, random_pose, random_shape

PAIRS_EACH = 17_000

# Agreement that is required [m].
AGREEMENT = 1e-9


@pytest.mark.parametrize(
    "kinds",
    list(combinations_with_replacement(SIMPLE, 2)),
    ids=lambda k: f"{k[0].name}-{k[1].name}",
)
def test_distances_agree_with_coal(kinds):
    rng = np.random.default_rng([int(kinds[0]), int(kinds[1])])
    request = coal_request()
    out = np.zeros(10)
    overlapping = 0
    for _ in range(PAIRS_EACH):
        size = 10.0 ** rng.uniform(-2.0, 0.0)
        # A third of the pairs is drawn close together, most of them overlapping.
        spread = 0.2 * size if rng.random() < 0.33 else 0.8
        shapes = [random_shape(rng, kind, size) for kind in kinds]
        poses = [random_pose(rng, spread) for _ in kinds]
        rows = [shape_row(s, T) for s, T in zip(shapes, poses, strict=True)]
        measure(int(kinds[0]), rows[0], int(kinds[1]), rows[1], out)
        result = coal.DistanceResult()
        frames = [coal.Transform3s(T[:3, :3], T[:3, 3]) for T in poses]
        theirs = coal.distance(
            coal_shape(shapes[0]),
            frames[0],
            coal_shape(shapes[1]),
            frames[1],
            request,
            result,
        )
        overlapping += out[0] < 0.0
        if abs(theirs - out[0]) > AGREEMENT:
            # Which one is wrong? A third opinion decides.
            judge = signed_distance(shapes[0], poses[0], shapes[1], poses[1])
            assert out[0] == pytest.approx(judge, abs=1e-7), (shapes, poses, theirs)
    assert overlapping > PAIRS_EACH // 20
