"""The nearest velocity: optimal by its own conditions, checked, never a guess."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from armguard.guard.workspace import open_workspace
from armguard.kernel import kernel
from armguard.respond import daqp_interface, solver
from armguard.respond.programs import solve_programs
from armguard.respond.solver import TOLERANCE, nearest_velocity
from armguard.respond.state import open_response
from driven import wall_guard


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


def solved(given, native):
    """The same program, of a guard's robot, solved inside its cycle."""
    target, low, high, rows, limits = given
    n, k = len(target), len(limits)
    guard = wall_guard(joints=n)
    response = guard._response
    response.target[:], response.low[:], response.high[:] = target, low, high
    response.rows[:k], response.limits[:k], response.eased[:k] = rows, limits, limits
    response.notes[0].row_count = k
    if not native:
        unsolved = guard.solve_programs(1)
    else:
        unsolved = solve_once(guard._response_lines, guard._lines)
    return None if unsolved else response.target.copy()


@kernel(inline=False, entry=True)
def solve_once(response, lines):
    """Solve the program of the first robot."""
    w = open_workspace(lines)
    return solve_programs(1, open_response(response), w.motion)


@pytest.mark.parametrize("seed", range(20))
def test_daqp_says_the_same_by_either_way(seed):
    rng = np.random.default_rng(seed)
    given = program(rng, int(rng.integers(1, 6)), int(rng.integers(1, 30)))
    one, other = solved(given, native=True), solved(given, native=False)
    assert one is not None
    assert one.tobytes() == other.tobytes()


def test_nor_does_it_solve_by_either_way_what_has_no_solution():
    rows, limits = np.array([[1.0, 0.0], [-1.0, 0.0]]), np.array([-0.1, -0.1])
    given = np.zeros(2), -np.ones(2), np.ones(2), rows, limits
    assert solved(given, native=True) is None
    assert solved(given, native=False) is None


@pytest.mark.parametrize("where", [0, 3, 4])
def test_nor_what_is_no_number(where):
    given = [np.zeros(2), -np.ones(2), np.ones(2), np.eye(2), np.ones(2)]
    given[where] = np.full_like(given[where], np.nan)
    assert solved(given, native=True) is None


def test_an_unknown_version_is_solved_by_way_of_python(monkeypatch):
    monkeypatch.setattr(daqp_interface, "KNOWN", ("0.0.1",))
    assert not daqp_interface.daqp_memory(10, 1e-9, 300).any()
