"""Benchmarks: their shape and their honesty, never their times."""

from pathlib import Path

import numpy as np
import pytest

import armguard.scene as scene_package
from armguard.errors import UnknownNameError
from armguard.guard import Level
from armguard.respond import Guard
from armguard.scene import bay_scene, bay_task
from bench import print_result, run
from peers import available_peers, checked_pairs
from speed import sense, sensed
from speed.cycle import near_of
from speed.memory import drift
from speed.robots import SHELF, shelf
from timing import percentiles

# The scene file of the bay.
BAY = Path(scene_package.__file__).parent / "bay" / "bay.yaml"


def test_the_cycle_benchmark_has_the_promised_shape():
    answer = run("cycle", cycles=100)
    assert answer["name"] == "cycle"
    figures = {"median_us", "p99_us", "p999_us", "max_us"}
    assert set(answer["ours"]) == figures
    assert len(answer["peers"]) == 4
    for name, peer in answer["peers"].items():
        assert set(peer) == figures
        ratio = peer["median_us"] / answer["ours"]["median_us"]
        assert answer["ratio"][name] == pytest.approx(ratio)
    assert "ours.median_us" in print_result(answer)


def test_the_gripping_benchmark_measures_what_it_says():
    answer = run("gripping", cycles=20)
    assert answer["contracts"] == 2
    for part in ("far", "under_contract", "with_swap", "without_swap", "grasp"):
        assert answer[part]["median_us"] > 0.0


def test_the_batch_benchmark_measures_a_scene_of_the_users_beside_every_peer():
    answer = run("batch", cycles=64, scene=BAY)
    (found,) = answer["nanoseconds"].values()
    assert found["pairs"] == 371
    assert found["absent"] == []
    assert len(found["peers"]) == 4
    for threads in ("1 thread", "2 threads"):
        assert set(found[threads]["random rows"]) < set(found[threads]["about home"])
        for times in found[threads].values():
            assert all(0.0 < time < np.inf for time in times.values())
    assert "prove, a motion" in print_result(answer)


@pytest.mark.skipif(
    not SHELF.is_dir(), reason="the public planning scenes are not here"
)
def test_the_cycles_of_one_scene_are_measured_alone_and_the_shelf_is_tight():
    answer = run("robots", cycles=20, only="shelf")
    assert {row["scene"] for row in answer["rows"]} == {"shelf"}
    for row in answer["rows"]:
        assert row["tested"] > 1.0
        for name, longest in row["longest_us"].items():
            assert 0.0 < longest <= row["figures"][name]["max_us"]
    home = Guard(shelf("fixed"), self_test=False).home_verdict
    assert home.level < Level.STOP
    assert 0.021 < home.nearest.distance < 0.022


def test_an_unknown_scene_is_refused():
    with pytest.raises(UnknownNameError, match="no scene is named 'shelv'; known: bay"):
        run("robots", cycles=20, only="shelv")


def test_peers_find_the_same_near_pairs():
    """Four other checkers, given the same primitives, agree pair by pair."""
    guard = Guard(bay_scene())
    q = bay_task(2000).for_scene(bay_scene())[::25]
    ours = [near_of(guard, row) for row in q]
    assert any(ours)
    peers = list(available_peers(guard.tables))
    assert len(peers) == 4
    for peer in peers:
        assert [peer.near_pairs(row) for row in q] == ours, peer.name


def test_checked_pairs_are_as_many_as_the_tables_say():
    tables = Guard(bay_scene()).tables
    assert len(checked_pairs(tables)) == tables.checkable_pairs


def test_composed_rotations_drift_and_angles_do_not():
    found = drift(20_000)
    assert found["composed_float32_m"] > 1e-6 > found["composed_float64_m"]
    assert found["from_angles_m"] == 0.0


def test_percentiles_are_in_microseconds():
    assert percentiles(np.array([1000.0, 2000.0, 3000.0]))["median_us"] == 2.0


def test_an_unknown_benchmark_is_refused():
    with pytest.raises(UnknownNameError, match="did you mean 'cycle'"):
        run("cycel")


def test_the_benchmark_of_cells_measures_what_it_says(monkeypatch):
    case = {"around": sensed.CASES["around"]}
    monkeypatch.setattr(sensed, "CASES", case)
    answer = run("sensed", cycles=20)
    assert answer["around"]["cells"] > 1e5
    assert answer["around"]["at rest"] < 0.5
    assert answer["without"]["median_us"] > 0.0


def test_the_benchmark_of_sensors_measures_whole_frames(monkeypatch):
    monkeypatch.setattr(sense, "CELLS", (0.02,))
    monkeypatch.setattr(sense, "LEFT_OUT", 2)
    answer = run("sense", cycles=3)["20 mm"]
    assert 2 <= answer["camera"]["count"] <= 4
    assert answer["zones"]["count"] >= 2 * 24
    assert 0.0 < answer["zones"]["median_ms"] < answer["camera"]["median_ms"]
    assert answer["occupied_cells"] > 100
    assert 0.0 < answer["share_of_a_core"]


def test_the_benchmark_of_region_octrees_judges_both_ways_by_exact_distances():
    answer = run("regions", cycles=60)
    for scene in ("two Pandas", "bay"):
        assert answer[scene]["black_cells"] > 100_000
        for kind in ("random", "plan"):
            for way in ("primitives", "two trees"):
                found = answer[scene][kind][way]
                assert found["missed"] == found["outside"] == 0
                assert found["greatest_mm"] < np.sqrt(3.0) * answer["cell_mm"]
                assert found["needless"] < 60
