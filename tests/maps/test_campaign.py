"""A sample of the campaign: nothing free touches, and each error counts in the map."""

import pytest

from mapping.judge import judged_map, judged_schedule


@pytest.mark.parametrize("apart", [1.0, 1.2])
def test_samples_find_nothing_that_a_map_calls_free_and_touches(apart):
    found = judged_map(apart, 1, samples=120)
    assert found["false_free"] == 0
    assert found["found"] >= 0.95 * found["clear"]
    assert found["touching"] > 0 or apart > 1.0
    assert found["unknown"] < 0.04


def test_executions_with_the_worst_errors_have_no_contact_and_no_deadlock():
    for seed in (0, 1):
        found = judged_schedule(1.0, seed)
        assert found["interlocks"] >= 1
        assert found["contacts"] == found["deadlocks"] == 0
        assert found["quickest"] < 0.65 * found["one_after_another"]
        assert found["executed"] <= 1.06 * found["quickest"]


@pytest.mark.parametrize("left_out", ["following error", "skew"])
def test_an_error_that_the_map_does_not_know_leads_to_contacts(left_out):
    assert judged_schedule(1.0, 1, left_out)["contacts"] > 0
