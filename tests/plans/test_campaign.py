"""A sample of the campaign: nothing is missed, and each part of the tube is needed."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

import armguard as ag
from armguard.guard import look_ahead
from armguard.maps.coordination import Coordinator
from armguard.prove.paving import Paver
from verifying import ahead
from verifying.judge import judged
from verifying.one_engine import CELL, SIZE, asked, compared, disagreements, ways_of
from verifying.plans import among_thin, cubic, skewed, straight
from verifying.states import ROBOTS, bay, random_states

SEEDS = range(1, 7)

# An error of one way, which a state at a buffer shows [m].
WRONG = 1e-6


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


@pytest.mark.parametrize("name", ["bay", "two Pandas"])
def test_all_ways_give_the_same_answer(name):
    found = asked(name, 1, 60)
    assert disagreements(found) == 0
    assert found["border"] >= 30
    parts = found["distances"] | found["answers"]
    assert len(parts) == 10
    for one in parts.values():
        assert min(one.get(key, 99) for key in ("compared", "clear", "near")) > 10


def other_ways():
    """The ways of the bay, with an error in one of them; and rows that show it."""
    near, moved = bay(), bay()
    near.buffer -= WRONG
    rack = moved.objects["rack"]
    far = ag.Pose(xyz=(rack.pose.xyz[0] + WRONG, *rack.pose.xyz[1:]))
    moved.remove("rack")
    moved.add(list(rack.shapes), name="rack", pose=far)
    yield {"checker": ag.Checker(near)}, {"checker"}
    wrong = {"checker, near pairs", "checker, nearest"}
    yield {"checker": ag.Checker(moved)}, wrong
    yield {"paver": Paver(ag.Checker(near))}, {"plan, by pair"}
    yield {"coordinator": Coordinator(near, ROBOTS)}, {"map"}
    near.buffer -= CELL
    trees = ag.RegionTrees(near, (0.0, 0.0, 1.3), CELL, SIZE)
    yield {"trees": trees}, {"region octrees"}


def test_an_error_of_any_way_is_found():
    ways, rng = ways_of("bay"), np.random.default_rng(5)
    rows = random_states(ways.checker, 60, rng)
    for change, wrong in other_ways():
        found = compared(replace(ways, **change), rows, np.random.default_rng(6))
        parts = found["distances"] | found["answers"]
        differ = {name for name, one in parts.items() if one["disagree"]}
        assert wrong <= differ <= wrong | {"checker"}


@pytest.mark.parametrize("seed", [0, 1, 8])
def test_leads_of_plans_in_the_bay_end_when_coal_finds_a_pair_too_near(seed):
    found = ahead.announced(seed)
    assert found["near"] == 1
    assert found["cycles"] > 1000
    assert [found[key] for key in ahead.LEADS] == [0, 0, 0]
    assert found["lead_error"] <= ahead.guard().tables.period


def test_a_lead_that_is_off_is_found(monkeypatch):
    with monkeypatch.context() as coarse:
        coarse.setattr(look_ahead, "RESOLUTION", 20.0)
        assert ahead.announced(2)["too_short"] > 1000
    # Coal finds pairs too near sooner than the guard knows of.
    with monkeypatch.context() as wide:
        wide.setattr(ahead.oracle(), "buffers", ahead.oracle().buffers + 0.002)
        assert ahead.announced(2)["too_long"] > 1000
    with monkeypatch.context() as slow:
        slow.setattr(look_ahead.LookAhead, "_follows", lambda *_: False)
        assert ahead.announced(2)["late"] == 1
