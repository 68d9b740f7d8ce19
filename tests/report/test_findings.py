"""Findings of a report, counted a second time from the guard's own answers."""

import json
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from armguard import bay_scene
from armguard.cli.console import jsonable
from armguard.guard import Level, Reason
from armguard.guard.answer import names_of
from armguard.guard.layout import IN_HEADER
from armguard.guard.nuisance import Cause
from armguard.recording import open_recording
from armguard.recording.frames import Kind, text_frame
from armguard.recording.palette import State, state_of
from armguard.recording.recorded import RecordedGuard
from armguard.recording.recorder import Recorder, RecorderSettings
from armguard.recording.ring import RingReader, RingWriter
from armguard.report import Closeness, findings_of, gather
from armguard.report.cycles import state_shares, timeline
from armguard.report.incidents import Sense, sense_of
from armguard.scene import compile_scene
from armguard.view.recorded_view import Playback

from .conftest import BEGIN, CYCLES, EVIL, FAULT_AT, GAP, GAP_AT, PERIOD, Evening


@pytest.fixture(scope="module")
def names(evening: Evening):
    """Names of the scene's verdicts."""
    return names_of(compile_scene(evening.scene))


@pytest.fixture(scope="module")
def whole(evening: Evening, names):
    """Findings from frames as they are in the ring."""
    return gather(evening.frames, names)


@pytest.fixture(scope="module")
def filed(evening: Evening):
    """Findings from the file, of most cycles of which one pair is kept."""
    return findings_of(open_recording(evening.file))


@pytest.fixture(params=["whole", "filed"])
def findings(request: pytest.FixtureRequest):
    """Both."""
    return request.getfixturevalue(request.param)


def test_time_at_each_level_is_that_of_the_verdicts(evening: Evening, findings):
    count = Counter(verdict.level for verdict in evening.verdicts)
    times = findings.series.time_in(findings.series.level)
    assert count[Level.STOP] > 100
    for level in Level:
        assert times[level] == pytest.approx(count[level] * PERIOD, abs=1e-6)
    for r, robot in enumerate(("left", "right")):
        own = Counter(verdict.levels[robot] for verdict in evening.verdicts)
        times = findings.series.time_in(findings.series.levels[:, r])
        for level in Level:
            assert times[level] == pytest.approx(own[level] * PERIOD, abs=1e-6)
    reasons = Counter(verdict.reason for verdict in evening.verdicts)
    assert findings.reasons == reasons


def test_time_of_a_hold_is_shown_apart_and_as_on_the_time_line(evening, findings):
    series = findings.series
    for r, robot in enumerate(("left", "right")):
        own = Counter(
            state_of(verdict.levels[robot], robot in held)
            for verdict, held in zip(evening.verdicts, evening.held, strict=True)
        )
        assert own[State.HELD] > 100
        times = series.time_in(series.states[:, r])
        for state in State:
            assert times[state] == pytest.approx(own[state] * PERIOD, abs=1e-6)
    moves = np.flatnonzero(np.diff(series.state, prepend=-1))
    shown = Playback(evening.frames, 2).states
    assert [state for _, state in shown] == series.state[moves].tolist()
    assert [at for at, _ in shown] == pytest.approx(series.t[moves])


def test_stops_are_where_a_robot_begins_to_stop(evening: Evening, findings):
    expected = []
    before = dict.fromkeys(("left", "right"), Level.CLEAR)
    for cycle, verdict in enumerate(evening.verdicts):
        risen = tuple(
            robot
            for robot, level in verdict.levels.items()
            if level >= Level.STOP > before[robot]
        )
        if risen:
            nuisance = verdict.nuisance
            cause = None if nuisance is None else nuisance.cause
            expected.append((cycle, risen, cause, verdict.why))
        before = verdict.levels
    assert len(expected) >= 5
    found = [
        (h.cycle, h.robots, h.verdict.cause, h.verdict.why) for h in findings.stops
    ]
    assert found == expected
    counts = {count.cause: count.stops for count in findings.causes}
    for cause in (Cause.LATENCY, Cause.DATA):
        assert counts[cause] == sum(c is cause for _, _, c, _ in expected) > 0


def test_a_nan_is_a_needless_stop_and_counted_as_a_fault(findings):
    (halt,) = findings.stops_that_were(Sense.NEEDLESS)
    assert halt.cycle == FAULT_AT
    assert halt.verdict.reason is Reason.NOT_FINITE
    assert "left/joint1" in halt.verdict.why
    # The refused cycle has a time of its own, so the one after it is not late.
    assert findings.faults == 1


def test_near_misses_hold_every_stop_and_every_pair_too_near(
    evening: Evening, findings
):
    near = [
        (t, verdict)
        for t, verdict in zip(evening.times, evening.verdicts, strict=True)
        if verdict.level >= Level.STOP
        or verdict.headroom.m < 0.0
        or verdict.headroom.s < 0.0
    ]
    spans: list[list[float]] = []
    for t, _ in near:
        if spans and t - BEGIN - spans[-1][1] <= 1.0:
            spans[-1][1] = t - BEGIN
        else:
            spans.append([t - BEGIN, t - BEGIN])
    assert [[m.began, m.ended] for m in findings.near_misses] == spans
    assert len(spans) >= 2
    for miss in findings.near_misses:
        own = [v.headroom.m for t, v in near if miss.began <= t - BEGIN <= miss.ended]
        assert miss.least_headroom == pytest.approx(min(own), abs=1e-12)
    first = next(v for _, v in near if v.level >= Level.STOP)
    reported = findings.near_misses[0].verdict
    assert reported.why == first.why
    assert reported.distance == first.nearest.distance
    assert reported.needed == pytest.approx(first.budget.needed, abs=1e-9)
    assert EVIL in findings.near_misses[1].verdict.why


def test_what_counts_as_a_near_miss_may_be_chosen(evening: Evening, names):
    strict = gather(evening.frames, names, closeness=Closeness(0.02, 0.05))
    near = [
        verdict
        for verdict in evening.verdicts
        if verdict.level >= Level.STOP
        or verdict.headroom.m < 0.02
        or verdict.headroom.s < 0.05
    ]
    times = np.array(evening.times) - BEGIN
    inside = sum(
        int(((times >= m.began) & (times <= m.ended)).sum()) for m in strict.near_misses
    )
    assert inside >= len(near)
    every = [v.headroom.m for v in evening.verdicts if v.nearest is not None]
    assert min(m.least_headroom for m in strict.near_misses) == pytest.approx(
        min(every)
    )


def test_the_closest_pairs_are_those_of_all_near_pairs(evening: Evening, whole):
    least: dict[frozenset[str], float] = {}
    cycles: Counter[frozenset[str]] = Counter()
    for verdict in evening.verdicts:
        seen = set()
        for pair in verdict.near:
            key = frozenset((pair.a, pair.b))
            least[key] = min(least.get(key, np.inf), pair.distance)
            seen.add(key)
        cycles.update(seen)
    found = {frozenset((p.a, p.b)): p for p in whole.closest}
    assert {key: p.distance for key, p in found.items()} == least
    assert {key: p.cycles for key, p in found.items()} == cycles
    first = whole.closest[0]
    assert first.distance == min(least.values())
    at = evening.verdicts[first.cycle]
    assert any(pair.distance == first.distance for pair in at.near)
    assert evening.times[first.cycle] - BEGIN == first.at


def test_the_file_lists_the_same_pairs_as_far_as_it_holds_them(whole, filed):
    assert filed.whole < whole.whole == CYCLES
    pairs = {(p.a, p.b): p for p in whole.closest}
    for pair in filed.closest:
        other = pairs[pair.a, pair.b]
        assert pair.distance >= other.distance
        assert pair.headroom >= other.headroom
    least = min(p.headroom for p in whole.closest)
    assert min(p.headroom for p in filed.closest) == least


def test_gaps_are_reported_and_count_for_no_level(findings):
    series = findings.series
    assert series.gaps.tolist() == [GAP_AT]
    assert series.missing == 0
    assert series.judged == pytest.approx(CYCLES * PERIOD)
    assert series.duration == pytest.approx(CYCLES * PERIOD + GAP)
    (gap,) = findings.to_dict()["gaps"]
    assert gap["t"] == pytest.approx(GAP_AT * PERIOD)
    assert gap["length"] == pytest.approx(GAP + PERIOD)


def test_cycles_that_are_missing_are_counted(evening: Evening, names):
    frames = [f for f in evening.frames if not 700 <= f.cycle < 710]
    found = gather(frames, names)
    assert found.series.missing == 10
    assert len(found.series.t) == CYCLES - 10


def test_times_and_tails_are_those_of_the_cycles(evening: Evening, findings):
    took = sorted(verdict.cycle_time for verdict in evening.verdicts)
    reported = findings.to_dict()["cycle_time"]
    for name, share in (("p50", 0.5), ("p99", 0.99), ("p999", 0.999)):
        assert reported[name] == pytest.approx(took[int(np.ceil(share * CYCLES)) - 1])
    assert reported["most"] == pytest.approx(took[-1])
    assert reported["count"] == CYCLES
    answers = findings.to_dict()["answer_time"]
    assert answers["most"] == pytest.approx(7e-4, rel=1e-3)
    assert answers["p50"] == pytest.approx(4e-4, rel=1e-3)
    misses = sum(
        max(1e-4 * (1 + k % 7), verdict.cycle_time) > PERIOD
        for k, verdict in enumerate(evening.verdicts)
    )
    assert findings.misses == misses


def test_a_late_answer_is_a_deadline_miss(evening: Evening, names):
    frames = [
        replace(f, received=f.ended - 0.0041) if f.cycle == 5 else f
        for f in evening.frames
        if f.kind is Kind.CYCLE
    ]
    quick = [replace(f, cycle_time=1e-5) for f in frames]
    assert gather(quick, names).misses == 1


def test_ages_are_those_of_the_verdicts(evening: Evening, findings):
    ages = findings.ages()
    for robot in ("left", "right"):
        own = [verdict.ages[robot] for verdict in evening.verdicts]
        assert ages[robot].most == pytest.approx(max(own))
        assert ages[robot].p50 == pytest.approx(float(np.median(own)))


def test_a_time_line_loses_no_peak(findings):
    series = findings.series
    for buckets in (1, 7, 400, 100_000):
        line = timeline(series, buckets)
        assert len(line.t) <= buckets
        finite = series.headroom[np.isfinite(series.headroom)]
        assert np.nanmin(line.headroom) == finite.min()
        assert np.nanmax(line.cycle_time) == series.cycle_time.max()
        assert np.nanmin(line.time_left) == series.time_left.min()
        assert np.nanmax(line.states) == series.state.max()
    assert np.isnan(timeline(series, 1000).states).any()


def test_shares_of_states_are_those_of_the_whole(findings):
    series = findings.series
    edges, shares = state_shares(series, 200)
    (whole,) = state_shares(series, 1)[1].T
    times = series.time_in(series.state)
    for state, part in zip(State, whole, strict=True):
        assert part == pytest.approx(times[state] / series.judged)
    sums = shares.sum(axis=0)
    assert ((np.abs(sums - 1.0) < 1e-9) | (sums == 0.0)).all()
    assert 6 <= (sums == 0.0).sum() <= 8
    assert edges[-1] == series.duration


def test_events_are_listed_without_what_every_recording_repeats(findings):
    calls = Counter(event.text.get("call") for event in findings.events)
    assert calls == {"engage": 8, "place": 1}
    assert findings.wall == 1.7e9 + BEGIN


def test_findings_are_json(findings):
    text = json.dumps(jsonable(findings.to_dict()), allow_nan=False)
    answer = json.loads(text)
    assert answer["cycles"] == CYCLES
    assert sum(answer["stops_by_sense"].values()) == len(answer["stops"])
    assert answer["stops"][0]["why"] == findings.stops[0].verdict.why
    miss = answer["near_misses"][0]
    assert miss["told"]["why"] == findings.near_misses[0].verdict.why
    assert "verdict" not in miss


def test_the_model_is_listed_with_hashes_and_assumptions(filed):
    facts = filed.model
    left, right = facts["robots"]
    assert (left["name"], right["name"]) == ("left", "right")
    assert left["response"] == "stop"
    assert left["assumed"] > 0
    assert len(left["fingerprint"]) == 16
    assert facts["period"] == PERIOD
    assert facts["allowed"]["adjacent"] == 14
    assert facts["claims"]["count"] == 0


def test_a_recording_without_a_cycle_says_so(names):
    nothing = gather([], names)
    assert nothing.problems == ["there is no cycle in it"]
    assert nothing.series.duration == 0.0
    json.dumps(jsonable(nothing.to_dict()), allow_nan=False)


def test_cycles_of_another_scene_are_left_out_and_reported(evening: Evening, names):
    foreign = replace(evening.frames[-1], q=np.zeros(3), kind=Kind.CYCLE)
    found = gather([*evening.frames, foreign], names)
    assert found.problems == ["left out, since not of the scene in the file: 1 cycles"]
    assert len(found.series.t) == CYCLES


def test_a_run_after_a_restart_of_the_machine_follows_the_first(
    evening: Evening, names
):
    again = [
        replace(f, monotonic=f.monotonic - 90.0, ended=f.ended - 90.0, wall=f.wall + 60)
        for f in evening.frames
    ]
    found = gather([*evening.frames, *again], names)
    series = found.series
    assert len(series.t) == 2 * CYCLES
    assert (np.diff(series.t) > 0.0).all()
    assert series.t[CYCLES] == pytest.approx(60.0, abs=1e-6)
    assert (
        "another run of the machine begins 47.5 s after cycle 2999"
        in (found.problems[0])
    )
    alone = gather(evening.frames, names)
    assert len(found.stops) == 2 * len(alone.stops)
    assert len(found.near_misses) == 2 * len(alone.near_misses)
    for first, second in zip(
        alone.near_misses, found.near_misses[len(alone.near_misses) :], strict=True
    ):
        assert second.began - first.began == pytest.approx(60.0, abs=1e-6)


def test_a_reason_of_a_newer_version_is_left_out_and_reported(evening: Evening, names):
    (last,) = [f for f in evening.frames if f.cycle == CYCLES - 1]
    numbers = last.verdict.copy()
    numbers[IN_HEADER.reason] = 99.0
    newer = replace(last, verdict=numbers, cycle=CYCLES)
    found = gather([*evening.frames, newer], names)
    assert "a newer one does" in found.problems[0]
    assert len(found.series.t) == CYCLES


def test_files_of_another_scene_are_left_out_by_name(evening: Evening, tmp_path):
    (tmp_path / "recording-1.mcap").write_bytes(evening.file.read_bytes())
    (tmp_path / "recording-2.mcap").write_bytes(evening.file.read_bytes())
    ring = RingWriter(tmp_path / "ring", 1 << 20)
    reader = RingReader(tmp_path / "ring")
    RecordedGuard(evening.guard, ring).describe(bay_scene(), {"version": "0.1.0"})
    other = Recorder(tmp_path / "other", RecorderSettings())
    for row in reader.unread():
        other.take(row)
    other.take(text_frame(Kind.EVENT, 0, 0.0, 0.0, {"call": "reset"}))
    other.end()
    (file,) = (tmp_path / "other").glob("recording-*.mcap")
    file.rename(tmp_path / "recording-3.mcap")
    found = findings_of(open_recording(tmp_path))
    assert len(found.series.t) == 2 * CYCLES
    reported = (
        "left out, since of another scene than recording-1.mcap: recording-3.mcap"
    )
    assert reported in found.problems


@pytest.mark.parametrize("cause", [None, *Cause])
def test_every_cause_has_a_sense(cause):
    senses = {sense_of(cause, 0.001), sense_of(cause, None)}
    if cause is None:
        assert senses == {Sense.UNKNOWN}
    elif cause is Cause.ORDERED:
        assert senses == {Sense.ORDERED}
    elif cause in (Cause.TRUE_NEED, Cause.FIGURES):
        assert senses == {Sense.NEEDED}
    else:
        assert senses == {Sense.EARLY, Sense.NEEDLESS}
