"""Static errors: one row each, one term each, and none forgotten by a new figure."""

from dataclasses import fields

import numpy as np
import pytest

from armguard.guard.budget import Budget
from armguard.guard.static_errors import STATIC_ERRORS, static_errors
from armguard.scene.compile import compile_scene
from planar import EXACT, chain_scene
from sliding import slides

# Figures of a robot, and by how much its primitives may be displaced.
FIGURES = {"model_error": 0.003, "base_error": 0.002, "base_turn": 0.01}


def test_every_kind_has_the_term_of_its_place():
    terms = [field.name for field in fields(Budget)]
    first = terms.index(STATIC_ERRORS[0].term)
    kinds = [kind.term for kind in STATIC_ERRORS]
    assert terms[first : first + len(kinds)] == kinds


@pytest.mark.parametrize("figure", FIGURES)
def test_each_figure_is_in_one_kind_and_in_the_sum(figure):
    """Each figure alone displaces all primitives of its robot, by one term."""
    alone = dict.fromkeys(FIGURES, 0.0) | {figure: FIGURES[figure]}
    tables = compile_scene(
        chain_scene(("turn", "turn"), (9.0, 9.0), {**EXACT, **alone})
    )
    found = static_errors(tables)
    moved = found["static_error"].any(axis=1)
    assert moved.sum() == 1
    total = found["link_error"] + found["robot_error"]
    assert (total[tables.robot_of_primitive >= 0] > 0.0).all()
    np.testing.assert_array_equal(total, found["static_error"].sum(axis=0))


def test_a_guard_that_takes_over_keeps_the_errors_of_its_own_scene():
    """New figures count though the rest of the state is that of another guard."""
    before, after = slides({"model_error": 0.0}), slides({"model_error": 0.03})
    own = after._watch.link_error.copy()
    assert own.max() == 0.03
    after._saving.take_over(before._saving)
    np.testing.assert_array_equal(after._watch.link_error, own)
    np.testing.assert_array_equal(after._watch.static_error[0], own)
