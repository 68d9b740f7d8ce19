"""Plans on a public problem: solved by both checkers, and judged between their rows."""

import numpy as np
import pytest

import armguard as ag
import batch_planning
from batch_planning import OURS, Coal, contestants, planned, public_problem

needs_public = pytest.mark.skipif(
    not batch_planning.PUBLIC.is_dir(), reason="the public planning scenes are not here"
)


@pytest.fixture(scope="module")
def problem():
    return public_problem("table_pick_panda", 1)


@pytest.fixture(scope="module")
def coal(problem):
    return Coal(problem.tables)


@needs_public
def test_coal_has_the_same_primitives_as_the_checker(problem, coal):
    """A depth is the same to Coal's tolerance; the scene has boxes and cylinders."""
    checker = ag.Checker(problem.tables)
    rng = np.random.default_rng(7)
    q = problem.goal + rng.normal(0.0, 0.2, (40, len(problem.goal)))
    ours = checker.distances(q).distance
    theirs = np.array([-coal.depth(row) for row in q])
    np.testing.assert_allclose(theirs, ours, atol=2e-5)
    assert (ours < 0.0).any()
    assert (ours > 0.0).any()
    touching = np.array([coal.touches(row) for row in q])
    np.testing.assert_array_equal(touching, ours < 0.0)


@needs_public
def test_every_contestant_plans_and_a_proven_plan_touches_nothing(problem, coal):
    found = contestants(problem.tables, coal)
    for name, one in found.items():
        _, plan = planned(problem, one, 1, 60.0)
        np.testing.assert_array_equal(plan[[0, -1]], [problem.start, problem.goal])
        if name == OURS:
            assert coal.deepest(plan) == 0.0


@needs_public
def test_an_overlap_between_two_rows_is_found():
    shelf = public_problem("bookshelf_small_panda", 1)
    coal = Coal(shelf.tables)
    straight = np.array([shelf.start, shelf.goal])
    assert not any(coal.touches(q) for q in straight)
    assert coal.deepest(straight) > 0.01
