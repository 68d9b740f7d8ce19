"""Overlap of polyhedra by clipped edges agrees with the sign of their distance."""

import numpy as np
import pytest

from accuracy import clipping
from armguard.geometry.shapes import Box


def test_clipped_edges_and_the_distance_agree():
    found = clipping.compared(seed=1, count=60)
    assert found["wrong"] == 0
    assert found["pairs"] > 400
    assert min(found["overlapping"], found["near"]) > 100


@pytest.mark.parametrize("error", [-1e-6, 1e-6])
def test_a_distance_that_is_off_by_a_micrometre_is_contradicted(monkeypatch, error):
    exact = clipping.measured

    def off(pair):
        return exact(pair) + error

    monkeypatch.setattr(clipping, "measured", off)
    assert clipping.compared(seed=1, count=60)["wrong"] > 20


def test_edges_that_pass_through_and_boxes_within_boxes_overlap():
    T = np.eye(4)
    large, small, rod = (
        clipping.polyhedron(Box(size=size)).at(T)
        for size in ((1.0, 1.0, 1.0), (0.2, 0.2, 0.2), (0.1, 0.1, 3.0))
    )
    assert clipping.keeps_a_part(small, large)
    assert not clipping.keeps_a_part(large, small)
    assert clipping.keeps_a_part(rod, large)
    T[:3, 3] = 2.0, 0.0, 0.0
    beside = clipping.polyhedron(Box(size=(0.9, 0.9, 0.9))).at(T)
    assert not clipping.keeps_a_part(beside, large)
    assert not clipping.keeps_a_part(large, beside)
