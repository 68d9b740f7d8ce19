"""What is thrown at arms, who judges what came of it, and whether it can be evaded."""

import numpy as np
import pytest

from episodes.classes import percentile
from episodes.records import Records
from evading.episode import run_episode
from evading.places import PERIOD, Findings, Place, Projectile
from evading.throws import BEFORE, Search, drawn_throw, spread_out
from evading_campaign import CAMPAIGN, EXTREME, is_broken, share, summed_up

BALL = Projectile((0.06, 0.06, 0.06), (0.0, 0.0, 0.0), False, 0.6)


@pytest.fixture(scope="module")
def thrown():
    """The bay with a ball that comes at an arm at rest or at work, and the throw."""
    place = Place("bay", BALL, evade=True)
    return place, drawn_throw(np.random.default_rng(4), place, BALL, 0.5)


def test_the_judge_finds_the_contacts_of_arms_that_do_not_evade():
    episodes = [run_episode("bay", seed, evade=False) for seed in range(3)]
    assert all(e["hit"] is not None and e["mover_least"] <= 0.0 for e in episodes)
    assert all(e["hit_at"] == pytest.approx(e["until_hit"], abs=0.1) for e in episodes)
    found = summed_up(episodes)
    assert found["evaded"] == found["other_evaded"] == 0
    assert found["evadable"] > 0
    assert is_broken(found)


def test_arms_that_evade_touch_nothing_else():
    episodes = list(CAMPAIGN.run("bay", range(3)))
    found = summed_up(episodes)
    assert found["episodes"] == 3
    assert found["secondary"] == 0
    assert found["evaded"] > 0


def test_an_arm_evades_a_slow_object_that_only_cameras_see():
    (episode,) = CAMPAIGN.run("sensed-bay", [1])
    assert episode["evadable"] and episode["evaded"]
    assert episode["touched"] == []
    assert run_episode("bay", 1, sensed=True, evade=False)["hit"] is not None


def test_a_projectile_touches_the_arm_it_is_thrown_at_when_it_is_said_to(thrown):
    place, throw = thrown
    for off, sign in ((-0.03, 1.0), (0.03, -1.0)):
        time = BEFORE + throw.until_hit + off
        place.judge.put(throw.nominal(time), throw.mover(time))
        gap = place.judge.gap_to(place.judge.arm(throw.robot))
        assert sign * gap > 0.0
    assert throw.mover(0.5 * BEFORE) is None
    assert throw.mover(throw.duration) is None


def test_the_judge_separates_the_projectile_from_all_else(thrown):
    place, throw = thrown
    found = Findings()
    place.judge.look(throw.q, None, 0.0, found)
    assert found.hit is None
    time = BEFORE + throw.until_hit + 0.05
    place.judge.look(throw.nominal(time), throw.mover(time), time, found)
    assert found.hit.link.split("/")[0] == place.robots[throw.robot]
    assert found.mover < 0.0
    assert found.touched == {}
    # An arm whose joints are all turned far runs into something sooner or later.
    rng = np.random.default_rng(1)
    for _ in range(200):
        place.judge.look(rng.uniform(*place.limits), None, 1.0, found)
    assert found.touched
    assert found.others < 0.0


def test_a_way_of_the_search_is_as_fast_as_declared_and_ends_where_it_should(thrown):
    place, throw = thrown
    still = np.zeros_like(throw.q)
    search = Search(place, throw, (BEFORE, throw.q, still), np.random.default_rng(0))
    own = search.own
    for way in list(search.ways())[::7]:
        times = np.arange(0.0, 4.0, 1e-3)
        rows = np.array([way.at(t) for t in times])[:, own]
        speeds = np.diff(rows, axis=0) / 1e-3
        gains = np.diff(speeds, axis=0) / 1e-3
        assert rows[0] == pytest.approx(0.0, abs=1e-12)
        assert rows[-1] == pytest.approx(way.step[own], abs=1e-9)
        assert (np.abs(speeds) <= search.speed + 1e-9).all()
        assert (np.abs(gains) <= np.maximum(search.up, search.down) + 1e-6).all()


def test_the_search_finds_no_way_past_what_comes_at_once(thrown):
    place, throw = thrown
    # It acts only when the projectile is a cycle from touching the arm.
    late = BEFORE + throw.until_hit - PERIOD
    state = (late, throw.nominal(late), np.zeros_like(throw.q))
    search = Search(place, throw, state, np.random.default_rng(0))
    assert not search.finds()
    assert search.tried > 400


def test_times_are_looked_at_from_far_apart_to_near():
    times = spread_out(10)
    assert sorted(times) == list(range(11))
    assert list(times[:3]) == [10, 0, 8]


def test_the_same_seed_gives_the_same_episode():
    one, other = (next(CAMPAIGN.run("bay", [2])) for _ in range(2))
    for episode in (one, other):
        for measured in ("worked_s", "cycle_us", "slowest_cycle_us"):
            del episode[measured]
    assert one == other


def test_figures_are_added_up_and_known_again(tmp_path):
    episodes = list(CAMPAIGN.run("bay", range(3)))
    path = tmp_path / "found.json"
    records = Records(path, lambda place: f"{place} 1", EXTREME)
    records.add("bay", CAMPAIGN.figures_of("bay", episodes[:1]))
    again = Records(path, lambda place: f"{place} 1", EXTREME)
    assert list(again.todo("bay", 0, 4)) == [1, 2, 3]
    found, whole = (
        again.add("bay", CAMPAIGN.figures_of("bay", episodes[1:])),
        CAMPAIGN.figures_of("bay", episodes),
    )
    assert found.pop("version") == "bay 1" and found.pop("kernels")
    for key in ("simulated_s", "worked_s"):
        assert found.pop(key) == pytest.approx(whole.pop(key))
    assert found == whole


def test_a_secondary_contact_or_too_few_evaded_break_the_promise():
    figures = {"secondary": 0, "evadable": 100, "evaded": 95}
    assert share(figures) == 0.95
    assert not is_broken(figures)
    assert is_broken({**figures, "secondary": 1})
    assert is_broken({**figures, "evaded": 94})
    assert percentile({"10": 98, "20": 1, "300": 1}, 0.5) == 10
    assert percentile({"10": 98, "20": 1, "300": 1}, 0.99) == 20
