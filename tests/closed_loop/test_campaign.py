"""The campaign resumes, adds up, and writes a page."""

from dataclasses import replace

import pytest

from closed_loop import plan as plans
from closed_loop.page import page
from closed_loop.plan import Plan
from closed_loop.runs import finished, run_plan
from closed_loop.settings import PROFILES, RATES, SUBSTEP, setting_of
from closed_loop.summary import bound, summed_up
from closed_loop.zeroing import TERMS

PLAN = Plan(guard="threshold", floor=0.02, duration=0.3)


@pytest.fixture(scope="module")
def episodes(tmp_path_factory):
    folder = tmp_path_factory.mktemp("closed_loop")
    return folder, run_plan(PLAN, 6, folder, processes=1)


def test_what_is_done_is_not_done_again(episodes, monkeypatch):
    folder, first = episodes
    assert [e["seed"] for e in first] == list(range(6))
    path = folder / f"{PLAN.name}.jsonl"
    path.write_text(path.read_text("utf-8")[:-40], encoding="utf-8")
    assert len(finished(path)) == 5
    asked = []

    def work(task):
        asked.append(task[1])
        return plans.work(task)

    monkeypatch.setattr("closed_loop.runs.work", work)
    again = run_plan(PLAN, 6, folder, processes=1)
    assert asked == [e["seed"] for e in first if e["seed"] not in {0, 1, 2, 3, 4}]
    for one, two in zip(first, again, strict=True):
        for measured in ("wall", "cycle_times"):
            one.pop(measured, None), two.pop(measured, None)
    assert first == again


def test_a_cut_line_does_not_spoil_the_next_one(tmp_path):
    path = tmp_path / f"{PLAN.name}.jsonl"
    path.write_text('{"seed": 0, "cont', encoding="utf-8")
    run_plan(PLAN, 1, tmp_path, processes=1)
    assert set(finished(path)) == {0}


def test_the_page_tells_every_kind_of_plan(episodes):
    _, found = episodes
    found = [{**e, "cycle_times": (1e-5, 2e-5, 3e-5), "wall": 0.1} for e in found]
    contact = {"time": 0.1, "a": "left/link7", "b": "rack", "depth": 0.001}
    found[0] = {**found[0], "contact": contact, "least": -0.001}
    real = replace(PLAN, guard="armguard")
    results = {}
    for plan in (
        real,
        replace(real, zero="command"),
        replace(real, large="command"),
        replace(real, weak_brake=0.7),
        replace(real, guard="reference"),
    ):
        results[plan.name] = summed_up(plan, found)
    slow = replace(real, guard="reference").name
    results[slow]["armguard"] = results[real.name]
    text = page(results)
    for words in (
        "CONTACT seed 0",
        "| command | nothing |",
        "| 0.7 |",
        "| reference |",
    ):
        assert words.replace("| 0.7 |", "0.7") in text or words in text
    assert results[real.name]["contacts"] == 1
    assert results[real.name]["breaches_of_floor"] >= 1


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
def test_the_guard_is_told_something_else_than_the_truth(term):
    truth, told = Plan(zero=term).truth_and_told(4)
    assert truth != told and truth.floor == told.floor == 0.0
    larger, same = Plan(large=term).truth_and_told(4)
    assert larger == same == truth
