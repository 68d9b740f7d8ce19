"""The nearest velocity: optimal by its own conditions, checked, never a guess."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from armguard.respond import solver
from armguard.respond.solver import TOLERANCE, nearest_velocity


def program(rng, n, k):
    """A program that the origin solves."""
    rows = rng.normal(size=(k, n))
    rows /= np.linalg.norm(rows, axis=1)[:, None]
    limits = np.abs(rng.normal(size=k)) * 0.2
    low, high = -rng.uniform(0.1, 1.0, n), rng.uniform(0.1, 1.0, n)
    return rng.normal(size=n), low, high, rows, limits


@pytest.mark.parametrize("seed", range(40))
def test_the_answer_meets_the_conditions_of_an_optimum(seed):
    rng = np.random.default_rng(seed)
    n, k = int(rng.integers(1, 15)), int(rng.integers(1, 30))
    target, low, high, rows, limits = program(rng, n, k)
    found = nearest_velocity(target, low, high, rows, limits)
    assert found is not None
    assert (found >= low).all()
    assert (found <= high).all()
    assert (rows @ found <= limits + TOLERANCE).all()
    # Karush-Kuhn-Tucker: the way to the target is a sum, with weights that are not
    # negative, of the normals of all that is met.
    met = [
        *rows[limits - rows @ found < 1e-7],
        *np.eye(n)[high - found < 1e-7],
        *-np.eye(n)[found - low < 1e-7],
    ]
    if not met:
        assert found == pytest.approx(target, abs=1e-9)
        return
    weights = lsq_linear(np.array(met).T, target - found, bounds=(0.0, np.inf)).x
    residual = np.array(met).T @ weights - (target - found)
    assert np.abs(residual).max() < 1e-6


def test_a_program_without_a_solution_has_none():
    rows = np.array([[1.0, 0.0], [-1.0, 0.0]])
    limits = np.array([-0.1, -0.1])
    box = np.ones(2)
    assert nearest_velocity(np.zeros(2), -box, box, rows, limits) is None


@pytest.mark.parametrize("where", range(3))
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_what_is_no_number_is_not_solved(where, value):
    given = [np.zeros(2), np.array([[1.0, 0.0]]), np.array([0.5])]
    given[where] = np.full_like(given[where], value)
    target, rows, limits = given
    box = np.ones(2)
    assert nearest_velocity(target, -box, box, rows, limits) is None


@pytest.mark.parametrize(
    "answer",
    [
        (np.array([np.nan, 0.0]), 0.0, 1, {}),
        (np.array([0.9, 0.0]), 0.0, 1, {}),
        (np.zeros(2), 0.0, -1, {}),
    ],
)
def test_an_answer_is_believed_only_if_it_keeps_what_it_must(monkeypatch, answer):
    monkeypatch.setattr(solver.daqp, "solve", lambda *_, **__: answer)
    rows, limits, box = np.array([[1.0, 0.0]]), np.array([0.5]), np.ones(2)
    assert nearest_velocity(np.array([1.0, 0.0]), -box, box, rows, limits) is None


def test_the_same_program_has_the_same_bits():
    given = program(np.random.default_rng(3), 7, 12)
    one, other = nearest_velocity(*given), nearest_velocity(*given)
    assert one is not None
    assert other is not None
    assert one.tobytes() == other.tobytes()
