"""Campaigns can be believed: they resume, add up, and are never made smaller."""

import argparse
import dataclasses
import json
import time

import numpy as np
import pytest

import campaigns_due
import soak_campaign
from episodes import campaign as campaigns
from episodes import kernels, records
from episodes.campaign import Campaign, LeftOut
from episodes.records import Digest, Records, keep, read, rows_of


def episode(seed):
    """An episode that is left out, one with a contact, and others without."""
    if seed == 4:
        raise LeftOut("no start was found")
    return {"seed": seed, "least": 0.5 - seed, "contact": seed == 3, "spared": seed % 3}


def summed_up(_, episodes):
    return {
        "episodes": len(episodes),
        "contacts": sum(e["contact"] for e in episodes),
        "least_mm": min(e["least"] for e in episodes),
    }


def digest(e):
    return Digest(
        e["seed"],
        "contact" if e["contact"] else "",
        e["least"],
        {"spared": e["spared"]},
    )


@pytest.fixture
def toy(tmp_path):
    """Makes a campaign of one version, and the list of the seeds it runs."""

    def campaign(version="1", work=episode):
        asked = []

        def noted(seed):
            asked.append(seed)
            return work(seed)

        return asked, Campaign(
            results=tmp_path / "toy.json",
            kinds={"toy": noted},
            version=lambda kind: f"{kind} {version}",
            extreme={"least_mm": min},
            summed_up=summed_up,
            digest=digest,
            page=" ".join,
            is_broken=lambda figures: figures["contacts"] > 0,
            is_notable=lambda _: False,
            written=2,
        )

    return campaign


def run(campaign, count, **more):
    chosen = {"first": 0, "processes": 1, "seconds": None, "show": False, "again": 0}
    chosen |= {"page": False, **more}
    return campaign.do(argparse.Namespace(**chosen), {"toy": count})


def test_a_run_resumes_and_adds(toy):
    asked, campaign = toy()
    assert run(campaign, 3) == 0
    assert run(campaign, 6) == 1
    assert asked == list(range(6))
    found = campaign.records.kinds["toy"]
    assert found["seeds"] == [[0, 6]]
    assert (found["episodes"], found["contacts"], found["least_mm"]) == (5, 1, -4.5)
    assert found["kernels"] == kernels.kernels_of()


def test_what_came_of_each_episode_is_kept_as_text(toy):
    _, campaign = toy()
    run(campaign, 3)
    before = campaign.records.episodes.read_text("utf-8")
    run(campaign, 6)
    text = campaign.records.episodes.read_text("utf-8")
    # A longer run adds lines to those that are there.
    assert text.startswith(before) and len(text.splitlines()) == 4
    assert campaign.records.digests("toy") == {
        0: Digest(0, "", 0.5),
        1: Digest(1, "", -0.5, {"spared": 1}),
        2: Digest(2, "", -1.5, {"spared": 2}),
        3: Digest(3, "contact", -2.5),
        4: Digest(4, "left out: no start was found"),
        5: Digest(5, "", -4.5, {"spared": 2}),
    }


def test_ten_thousand_episodes_take_less_than_a_hundred_kilobytes(tmp_path):
    kept = Records(tmp_path / "toy.json", lambda _: "1", {})
    for first in range(0, 10_000, 100):
        some = [Digest(k, "", 12.3456, {"stops": k % 9 == 0}) for k in range(100)]
        some = [d._replace(seed=first + d.seed) for d in some]
        seeds = records.ranges_of(d.seed for d in some)
        kept.add("toy", {"episodes": 100, "seeds": seeds}, some)
    assert kept.episodes.stat().st_size < 100_000
    assert len(kept.digests("toy")) == 10_000


def test_a_smaller_run_never_takes_the_place_of_a_larger_one(toy):
    run(toy("1")[1], 3)
    _, other = toy("2")
    run(other, 2)
    old, new = rows_of(other.records.kinds["toy"])
    assert (old["episodes"], old["version"]) == (3, "toy 1")
    assert (new["episodes"], new["version"]) == (2, "toy 2")
    # A third version takes the place of the second, and the largest is still kept.
    _, third = toy("3")
    run(third, 1)
    old, new = rows_of(third.records.kinds["toy"])
    assert (old["episodes"], new["episodes"]) == (3, 1)
    run(third, 3)
    (only,) = rows_of(third.records.kinds["toy"])
    assert (only["episodes"], only["version"]) == (3, "toy 3")
    text = third.records.episodes.read_text("utf-8")
    versions = [json.loads(line)["version"] for line in text.splitlines()]
    assert set(versions) == {"toy 3"}


def test_what_is_left_out_is_counted_by_its_reason(toy, monkeypatch):
    monkeypatch.setattr(campaigns, "PATIENCE", 0.05)

    def slow(seed):
        if seed == 1:
            time.sleep(20.0)
        return episode(seed)

    _, campaign = toy(work=slow)
    run(campaign, 6)
    assert campaign.records.kinds["toy"]["left_out"] == {
        "it took longer than 0.05 s": 1,
        "no start was found": 1,
    }


def test_a_defect_of_an_episode_is_not_left_out(toy):
    def broken(_):
        raise KeyError("a defect")

    _, campaign = toy(work=broken)
    with pytest.raises(KeyError):
        run(campaign, 1)


def test_known_episodes_are_run_again_and_compared(toy):
    run(toy()[1], 6)
    assert run(toy()[1], 0, again=6) == 0
    _, other = toy(work=lambda seed: {**episode(2), "seed": seed})
    assert run(other, 0, again=6) == 1


def test_a_row_is_carried_over_where_enough_of_its_episodes_are_the_same(
    toy, monkeypatch
):
    monkeypatch.setattr(campaigns, "COMPARED", 4)
    monkeypatch.setattr(records, "kernels_of", lambda: "old")
    run(toy("1")[1], 6)
    monkeypatch.setattr(records, "kernels_of", lambda: "new")
    _, other = toy("2", work=lambda seed: {**episode(seed), "least": 1.0})
    assert run(other, 0, again=6) == 1
    _, same = toy("2")
    assert run(same, 0, again=3) == 0
    assert same.records.version_of("toy") == "toy 1"
    assert run(same, 0, again=4) == 0
    found = same.records.kinds["toy"]
    assert (found["version"], found["kernels"]) == ("toy 2", "new")
    assert found["carried"] == [{"kernels": "old", "compared": 4}]
    assert list(same.records.digests("toy")) == list(range(6))
    # More are added to it, and what it was carried over from is kept.
    asked, more = toy("2")
    run(more, 8)
    assert asked == [6, 7]
    found = more.records.kinds["toy"]
    assert found["carried"] == [{"kernels": "old", "compared": 4}]
    assert kernels.cell_of(found) == "new = old in 4 *"


def test_episodes_are_shown_and_nothing_is_written(toy, capsys):
    _, campaign = toy()
    assert run(campaign, 0, show=True, first=3, episodes=1) == 1
    assert '"contact": true' in capsys.readouterr().out
    assert run(campaign, 0, show=True, first=4, episodes=1) == 0
    assert not campaign.results.exists() and not campaign.records.episodes.exists()


def test_a_smaller_measurement_changes_nothing(tmp_path):
    path = tmp_path / "found.json"
    assert keep(path, "thin", {"lines": 100}, 100)
    assert keep(path, "wide", {"lines": 1}, 1)
    assert not keep(path, "thin", {"lines": 2}, 2)
    assert read(path)["thin"] == {"lines": 100}
    assert keep(path, "thin", {"lines": 101}, 101)
    assert read(path)["thin"] == {"lines": 101}
    assert read(path)["runs"]["thin"]["kernels"] == kernels.kernels_of()


def test_rows_of_other_kernels_are_marked(tmp_path):
    today = kernels.kernels_of()
    assert kernels.cell_of({"kernels": today}) == today[:8]
    assert kernels.cell_of({"kernels": "0123456789abcdef"}) == "01234567 *"
    assert kernels.cell_of({}) == "not recorded *"
    only = kernels.kernels_of("geometry")
    assert only != today
    assert kernels.cell_of({"kernels": only, "of": ["geometry"]}) == only[:8]


def test_rows_of_other_kernels_are_due(tmp_path):
    today = {"kernels": kernels.kernels_of(), "version": "1"}
    old = {"episodes": 7, "kernels": "0123456789abcdef", "version": "0"}
    kinds = {
        "bay": {"episodes": 3, **today, "before": old},
        "pandas": {"episodes": 5, **today},
        "movers": {"episodes": 2},
    }
    records.replace(tmp_path / "evading.json", json.dumps(kinds))
    keep(tmp_path / "motion.json", "thin", {}, 1.0)
    motion = read(tmp_path / "motion.json")
    motion["clocks"] = {}
    records.replace(tmp_path / "motion.json", json.dumps(motion))
    assert list(campaigns_due.due(tmp_path)) == [
        ("evading bay", 7, "0123456789abcdef", 'make evading ARGS="--kind bay"'),
        ("evading movers", 2, "not recorded", 'make evading ARGS="--kind movers"'),
        ("motion clocks", 0, "not recorded", 'make motion ARGS="--part clocks"'),
    ]


def test_every_published_file_is_looked_through():
    docs = campaigns_due.DOCS
    # Proofs have no seeds, and rates of batches decide nothing. What is due of mutants
    # is listed by `make mutants ARGS=--due`.
    others = {
        "allowed-pairs",
        "batch",
        "coverage",
        "fleet",
        "following",
        "joint_table",
        "mutants",
        "regions",
        "sense",
        "sensing",
        "sensor_faults",
        "sensors",
    }
    names = {path.stem for path in docs.glob("*.json")} - others
    assert names <= set(campaigns_due.COMMANDS)
    assert all(len(row) == 4 for row in campaigns_due.due(docs))


def test_a_soak_goes_on_where_it_was_left(tmp_path, monkeypatch):
    """Shorter runs and runs with other kernels take nothing from a longer one."""
    asked = []

    def million(seed):
        asked.append(seed)
        return {
            "seed": seed,
            "counts": {"HOLD": seed},
            "growth_kib": 4,
            "in_a_row": soak_campaign.CYCLES * (len(asked)),
            "same": True,
            "worked_s": 1.0,
        }

    def soak(version):
        return dataclasses.replace(
            soak_campaign.CAMPAIGN,
            results=tmp_path / "soak.json",
            kinds={"step": million},
            version=lambda _: version,
        )

    def steps(campaign, count):
        chosen = {"first": 0, "processes": 1, "seconds": None, "show": False}
        chosen |= {"again": 0, "page": False}
        return campaign.do(argparse.Namespace(**chosen), {"step": count})

    first = soak("1")
    assert steps(first, 3) == 0
    text = first.records.episodes.read_text("utf-8")
    assert len(text.splitlines()) == 3
    # A shorter run has nothing to do; a longer one adds what is missing.
    steps(first, 2)
    steps(first, 5)
    assert asked == [0, 1, 2, 3, 4]
    assert first.records.episodes.read_text("utf-8").startswith(text)
    found = first.records.kinds["step"]
    assert (found["cycles"], found["seeds"]) == (5_000_000, [[0, 5]])
    assert [
        d.counts.get("HOLD", 0) for d in first.records.digests("step").values()
    ] == [*range(5)]
    # With other kernels it begins anew, and the longer row is kept beside it.
    other = soak("2")
    steps(other, 1)
    old, new = rows_of(other.records.kinds["step"])
    assert (old["cycles"], new["cycles"]) == (5_000_000, 1_000_000)
    assert other.records.digests("step", "1").keys() == set(range(5))
    page = (tmp_path / "soak.md").read_text("utf-8")
    assert "| step | 5,000,000 |" in page and "| step | 1,000,000 |" in page


@pytest.mark.parametrize("kind", soak_campaign.KINDS)
def test_a_soak_counts_exceptions_and_compares_with_a_new_guard(kind, monkeypatch):
    monkeypatch.setattr(soak_campaign, "CYCLES", 400)
    monkeypatch.setattr(soak_campaign, "WARM", 100)
    made, mode = soak_campaign.KINDS[kind]
    soak = made(mode)
    found = soak_campaign.summed_up(kind, [soak.episode(0), soak.episode(1)])
    assert (found["exceptions"], found["not_as_new"]) == (0, 0)
    assert found["most_in_a_row"] == 800
    monkeypatch.setattr(type(soak.guard), kind, lambda *_, **__: 1 / 0)
    assert soak.chunk(np.random.default_rng(0), 10) == {"raised ZeroDivisionError": 10}
    assert soak_campaign.is_broken({**found, "exceptions": 10})
    assert soak_campaign.is_broken({**found, "most_growth_kib": 1025})


@pytest.mark.parametrize("kind", soak_campaign.KINDS)
def test_an_episode_of_a_soak_depends_on_its_seed_alone(kind, monkeypatch):
    monkeypatch.setattr(soak_campaign, "CYCLES", 1200)
    monkeypatch.setattr(soak_campaign, "WARM", 100)
    made, mode = soak_campaign.KINDS[kind]

    def digests(seeds):
        soak = made(mode)
        found = {seed: soak.episode(seed) for seed in seeds}
        # The guard itself lives on: its memory is compared over all of them.
        assert found[seeds[-1]]["in_a_row"] == 1200 * len(seeds)
        return {seed: soak_campaign.digest(found[seed]) for seed in sorted(seeds)}

    assert digests([0, 1, 2]) == digests([2, 0, 1])
    assert digests([1]) == {1: digests([0, 1])[1]}


def test_the_version_of_a_campaign_has_all_that_decides_its_episodes():
    names = {path.relative_to(records.BENCHMARKS).as_posix() for path in
             records.sources_of("reach.runs")}  # fmt: skip
    assert {"closed_loop/truth.py", "closed_loop/watch.py", "reach/goals.py"} <= names
    assert {"peers/__init__.py", "peers/mujoco_margin.py"} <= names
    assert not {"reach/summary.py", "episodes/campaign.py", "pages.py"} & names
    one, other = records.version_of("reach.runs"), records.version_of("motions.thin")
    assert one("bay") != one("pandas") and one("bay") != other("bay")
