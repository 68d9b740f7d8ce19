"""A sample of the campaign: nothing is missed, and each part of the tube is needed."""

from collections import Counter

import pytest

from verifying.judge import judged
from verifying.plans import among_thin, cubic, skewed, straight

SEEDS = range(1, 7)


@pytest.mark.parametrize("kind", [straight, among_thin, cubic, skewed])
def test_dense_samples_find_nothing_that_a_proof_missed(kind):
    found = [judged(kind(seed), seed) for seed in SEEDS]
    for key in ("missed", "ends_off", "first_off"):
        assert sum(one[key] for one in found) == 0, key
    assert sum(one["intervals"] for one in found) > 3
    without: Counter[str] = Counter()
    for one in found:
        without.update(one["without"])
    # What is left out of the tube is missed.
    needed = {cubic: {"bow"}, skewed: {"bow", "following error", "skew"}}
    assert {name for name, count in without.items() if count} == needed.get(kind, set())
