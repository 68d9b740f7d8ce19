"""Figures of smoothness, on motions of which they are known."""

import numpy as np
import pytest

from reach.trial import chatter, held_back, jerk, share_blocked

DT = 0.001


def test_the_jerk_of_a_parabola_of_speed_is_its_own():
    t = np.arange(200) * DT
    rms, peak = jerk(np.stack([0.5 * 7.0 * t * t], axis=1), DT)
    assert rms == pytest.approx(7.0, rel=1e-6) and peak == pytest.approx(7.0, rel=1e-6)


def test_chatter_counts_changes_of_sign_only_where_it_is_asked():
    commanded = np.zeros((1001, 1))
    commanded[::2] = 0.01
    everywhere = np.ones(1001, dtype=bool)
    assert chatter(commanded, np.array([8.0]), DT, everywhere) == pytest.approx(
        1000, rel=0.01
    )
    assert chatter(commanded, np.array([8.0]), DT, ~everywhere) == 0.0
    smooth = np.sin(np.arange(1001) * 2.0 * np.pi * 2.0 * DT)[:, None]
    assert chatter(smooth, np.array([8.0]), DT, everywhere) == pytest.approx(4, abs=1)


def test_what_is_held_back_and_what_is_blocked():
    asked = np.ones((4, 2))
    commanded = np.array([[1.0, 1.0], [0.5, 1.0], [0.05, 0.05], [-1.0, 1.0]])
    assert held_back(commanded, asked).tolist() == [False, True, True, True]
    assert share_blocked(commanded, asked) == 0.5
