"""The service's benchmark: its shape and its honesty, never its times."""

import numpy as np
import pytest

from armguard.recording.counters import BUCKETS, bucket_of
from speed.service import ServiceBench, bench_service
from speed.service_figures import from_buckets, lateness, print_service
from speed.service_loops import Arms
from speed.service_processes import BenchmarkError, kept, line_of, running

FIGURES = {"median_us", "p99_us", "p999_us", "max_us"}


@pytest.fixture(scope="module")
def answer():
    bench = ServiceBench(
        seconds=2.0, rate=250.0, view=False, record=False, self_test=False
    )
    return bench_service(bench, lambda sentence: None)


def test_every_target_is_printed_beside_its_measurement(answer):
    for row in answer["targets"][:5]:
        assert np.isfinite([row["target"], row["measured"]]).all()
        assert row["met"] == (row["measured"] <= row["target"])
        assert row["figure"] in print_service(answer)


def test_all_loops_were_measured_in_the_same_run(answer):
    for name in (
        "round_trip",
        "echo",
        "in_to_handed_out",
        "in_to_sent",
        "judging",
        "waking",
    ):
        assert set(answer[name]) >= FIGURES
        assert answer[name]["median_us"] > 0.0
    for name in ("bare", "alone"):
        assert set(answer["loops"][name]) > FIGURES
        assert answer["loops"][name]["cycles"] >= 250


def test_the_service_counted_what_the_client_saw(answer):
    seen, counters = answer["answers"], answer["counters"]
    assert counters["states"] >= 500
    # What was in the warm-up the service counts and the client does not.
    assert 0 < seen["answers"] <= counters["cycles"]
    assert answer["in_to_sent"]["count"] == sum(
        count for _, count in answer["in_to_sent_histogram"]
    )
    assert answer["in_to_sent"]["count"] <= counters["cycles"]
    misses = answer["misses"]
    assert misses["of_these_stops"] == misses["answers_that_said_so"]
    assert misses["answers_that_said_so"] <= misses["counted"]


def test_arms_were_driven_and_memory_was_looked_at(answer):
    assert answer["task_s"] > 1.0
    assert answer["memory"]["service"]["start_kib"] > 10_000


def test_a_histogram_of_the_service_is_read_as_it_was_written():
    counts = np.zeros(BUCKETS, np.int64)
    for k in range(1, 1001):
        counts[bucket_of(k * 1000)] += 1
    found = from_buckets(counts)
    assert found["count"] == 1000
    for name, exact in (("median_us", 500), ("p99_us", 990), ("max_us", 1000)):
        assert exact <= found[name] <= 1.07 * exact


def test_a_bare_loop_misses_what_the_service_would_miss():
    due = np.arange(5) * 1_000_000
    woke = due + np.array([10_000, 20_000, 5_500_000, 4_600_000, 3_700_000])
    found = lateness([np.column_stack([due, woke])], 5_000_000)
    assert found["share_missed"] == 0.25
    assert found["max_us"] == 5500.0


def test_memory_that_grows_is_not_flat():
    steady = [(float(k), 300_000.0, 9) for k in range(100)]
    assert kept(steady)["flat"]
    grows = [(t, memory + 60.0 * t, files) for t, memory, files in steady]
    assert not kept(grows)["flat"]
    assert kept(grows)["growth_kib_per_minute"] == pytest.approx(3600.0)
    leaks = [(t, memory, files + int(t) // 10) for t, memory, files in steady]
    assert not kept(leaks)["flat"]


def test_the_error_about_a_dead_process_has_its_last_line(tmp_path):
    words = ("armguard", "serve", "no-such-scene", "--port", "0")
    with pytest.raises(BenchmarkError, match="no-such-scene"):
        with running(*words, log=tmp_path / "log") as process:
            line_of(process, 60.0)


def test_arms_follow_commands_as_fast_as_they_can():
    arms = Arms()
    start = arms.q.copy()
    arms.measure(0.0)
    arms.command[:] = 0.4
    for k in range(1, 101):
        arms.measure(k * 1e-3)
    # 50 ms to speed up, 50 ms at full speed.
    assert np.allclose(arms.v, 0.4)
    assert np.allclose(arms.q - start, 0.4 * 0.025 + 0.4 * 0.05)
    arms.rest()
    assert arms.resting
    assert np.allclose(arms.q - start, 0.03 + 0.4**2 / 16.0)
