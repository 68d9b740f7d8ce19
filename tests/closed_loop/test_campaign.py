"""Figures of plans add up, and are written on a page."""

import re
from dataclasses import replace

import pytest

import closed_loop_campaign
from closed_loop.settings import PROFILES, RATES, SUBSTEP, TERMS, Plan, setting_of
from closed_loop_campaign import (
    EXTREME,
    bound,
    campaign_of,
    derived,
    digest,
    run_episode,
    summed_up,
    sums,
)
from episodes.campaign import LeftOut
from episodes.records import merged, read
from pages import page

PLAN = Plan(guard="threshold", floor=0.02, duration=0.3)


@pytest.fixture(scope="module")
def episodes():
    return [run_episode(PLAN, seed) for seed in range(6)]


def test_figures_of_parts_add_up_to_those_of_all(episodes):
    parts = [sums(PLAN, episodes[:2]), sums(PLAN, episodes[2:])]
    found = merged(*parts, EXTREME)
    found |= derived(PLAN, found)
    whole = summed_up(PLAN, episodes)
    assert found.keys() == whole.keys()
    for key, figure in whole.items():
        same = pytest.approx(figure) if isinstance(figure, float) else figure
        assert found[key] == same, key


def test_the_real_guard_has_the_episodes_of_the_reference():
    plan = Plan(guard="reference", duration=0.1)
    found = run_episode(plan, 3)
    assert found["beside"]["seed"] == 3
    figures = summed_up(plan, [found])
    assert figures["armguard"]["plan"]["guard"] == "armguard"
    assert figures["armguard"]["episodes"] == 1


def test_a_campaign_is_broken_by_contacts_of_a_guard_that_knew_the_truth(episodes):
    campaign = campaign_of({PLAN.name: PLAN})
    contact = {"time": 0.1, "a": "left/link7", "b": "rack", "depth": 0.001}
    touched = {**episodes[0], "contact": contact}
    assert not campaign.is_broken(summed_up(PLAN, episodes[1:2]))
    assert campaign.is_broken(summed_up(PLAN, [touched]))
    weak = replace(PLAN, weak_brake=0.7)
    assert not campaign.is_broken(summed_up(weak, [touched]))


def test_a_digest_has_what_was_counted_beside_contacts(episodes):
    changes = {"least": 0.03, "met_at_rest": 2, "joint_way": 1.23456}
    found = digest({**episodes[0], **changes})
    assert (found.seed, found.outcome, found.least) == (0, "", 30.0)
    assert found.counts == {"met_at_rest_as_well": 2, "joint_way": 1.2346}


def test_the_page_lists_every_kind_of_plan(episodes):
    more = {"cycle_times": (1e-5, 2e-5, 3e-5), "wall": 0.1, "saturated": 0.25}
    found = [{**e, **more} for e in episodes]
    contact = {"time": 0.1, "a": "left/link7", "b": "rack", "depth": 0.001}
    found[0] = {**found[0], "contact": contact, "least": -0.001}
    real = replace(PLAN, guard="armguard")
    results = {}
    found = [{**e, "beside": e} for e in found]
    for plan in (
        real,
        replace(real, zero="command"),
        replace(real, large="command"),
        replace(real, weak_brake=0.7),
        replace(real, guard="reference"),
        replace(real, plant="torque"),
        replace(real, swing="both"),
    ):
        results[plan.name] = summed_up(plan, found)
    text = page("closed_loop", results)
    for words in (
        "CONTACT seed 0",
        "| command | zero |",
        "| command | true |",
        "| 0.7 |",
        "| reference |",
        "| bay, limited torque | path |",
        "| bay, swing both ways | path |",
        "A motor gave all its torque in 25.0% of the time.",
    ):
        assert words in text
    assert results[real.name]["contacts"] == 1
    assert results[real.name]["breaches_of_floor"] >= 1


def test_a_plant_that_breaks_its_figures_is_left_out_with_the_figure(
    episodes, monkeypatch
):
    broke = {**episodes[0], "broke": "stop, too far"}
    contact = {"time": 0.1, "a": "left/link7", "b": "rack", "depth": 0.001}
    monkeypatch.setattr(closed_loop_campaign, "work", lambda _: broke)
    with pytest.raises(LeftOut, match=r"own figures \(stop, too far\)$"):
        run_episode(PLAN, 0)
    broke["contact"] = contact
    with pytest.raises(LeftOut, match="and something touched"):
        run_episode(PLAN, 0)


def test_brakes_are_counted(episodes):
    found = summed_up(PLAN, [{**e, "brakes": 2} for e in episodes])
    assert found["brakes"] == 2 * len(episodes)
    real = summed_up(replace(PLAN, guard="armguard"), episodes)
    row = page("closed_loop", {PLAN.name: real})
    assert "| false brakes |" in row


@pytest.mark.parametrize("plant", ["exact", "torque"])
@pytest.mark.parametrize("swing", ["onwards", "both"])
def test_a_plan_is_named_by_its_plant(plant, swing):
    name = Plan(plant=plant, swing=swing).name
    assert ("torque" in name, "swing-both" in name) == (
        plant == "torque",
        swing == "both",
    )


@pytest.mark.parametrize("name", ["closed_loop", "gripping_campaign", "soak"])
def test_published_pages_agree_with_their_figures(name):
    """But for which rows were measured with the kernels of today."""

    def of_any_kernels(text):
        return re.sub(r" \*(?= \||\.|$)|(?<=than )[0-9a-f]{8}", "", text, flags=re.M)

    docs = closed_loop_campaign.DOCS
    text = (docs / f"{name}.md").read_text("utf-8")
    made = page(name, read(docs / f"{name}.json"))
    assert of_any_kernels(made) == of_any_kernels(text)


def test_unintended_grasps_are_a_row_of_their_own():
    docs = closed_loop_campaign.DOCS
    found = read(docs / "gripping_campaign.json")["unintended"]
    assert found["episodes"] >= 1000 and found["touched_not_meant"] == 0
    assert sum(found["of_each"].values()) == found["episodes"]
    text = (docs / "gripping_campaign.md").read_text("utf-8")
    assert f"\n| unintended | {found['episodes']:,} | 0 |" in text


def test_bounds_of_rare_events():
    assert bound(0, 100_000) == pytest.approx(3e-5, rel=0.01)
    assert bound(0, 0) is None and bound(3, 3) is None
    assert bound(1, 100) > bound(0, 100)


def test_settings_lie_on_the_grid_and_come_in_turns():
    names = {setting_of("bay", "path", k).name for k in range(60)}
    assert len(names) == len(PROFILES) * len(RATES)
    for period, late, _ in RATES:
        for time in (period, late):
            assert abs(time / SUBSTEP - round(time / SUBSTEP)) < 1e-9


@pytest.mark.parametrize("term", TERMS)
def test_the_declared_figures_differ_from_the_truth(term):
    truth, wrong = Plan(zero=term).truth_and_declared(4)
    assert truth != wrong and truth.floor == wrong.floor == 0.0
    larger, same = Plan(large=term).truth_and_declared(4)
    assert larger == same == truth
