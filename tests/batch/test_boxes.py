"""Boxes of joint positions: every pair that is too near somewhere in one is listed."""

import numpy as np
import pytest

import armguard as ag
from armguard.batch.tiles import BoxSearch


@pytest.mark.parametrize("width", [0.02, 0.1, 0.2])
def test_no_pair_that_is_too_near_in_a_box_is_left_out(width):
    checker = ag.Checker(ag.bay_scene())
    rng = np.random.default_rng(1)
    n = len(checker.lower)
    size = (3000, n)
    inside = rng.uniform(checker.lower, checker.upper, size)
    # The middle of each box is off by its whole half width, in the worst directions.
    near = checker.near(inside, checker.tables.buffers.max() - 1e-6)
    away = np.sign(near.gradient)
    halves = width * rng.random((len(near.row), n))
    middles = inside[near.row] + away * halves
    boxes, _ = BoxSearch(checker.world).pairs(middles, halves + 1e-12, 0.0, 1)
    listed = {tuple(row) for row in boxes.tolist()}
    needed = zip(range(len(near.row)), near.a.tolist(), near.b.tolist(), strict=True)
    missing = [pair for pair in needed if pair not in listed]
    assert len(near.row) > 1000
    assert not missing
