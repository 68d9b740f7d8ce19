"""A loop at another rate than its scene declares gets both figures and the key."""

import logging
import re

import numpy as np
import pytest

from approach import ball_scene
from armguard import Action, Guard, Level, Reason, bay_scene
from armguard.guard.pace import IN_A_ROW, Pace, late_sentence

RATES = (30.0, 50.0, 100.0, 125.0, 250.0, 500.0, 1000.0)


def loop(guard, rate, cycles, speed=0.05):
    """Arms that follow their commands at some rate; the commands."""
    q, v = guard.home, 0.0 * guard.home
    commands = []
    for k in range(cycles):
        desired, now = np.full(len(q), speed), k / rate
        command = guard.filter(q, desired, now, velocity=v, now=now)
        v = command.velocity
        q = q + v / rate
        commands.append(command)
    return commands, q


def scene_of(period):
    """The scene of one arm and a ball, with cycles of some length [s]."""
    return ball_scene(settings={"period": period})


@pytest.mark.parametrize("rate", RATES)
def test_at_the_declared_rate_it_moves_and_is_never_stopped(rate, caplog):
    guard = Guard(scene_of(1.0 / rate), self_test=False)
    commands, q = loop(guard, rate, 100, -0.05)
    assert {c.verdict.level for c in commands} <= {Level.CLEAR, Level.CAUTION}
    assert {c.action for c in commands} == {Action.FOLLOW}
    assert (np.abs(q - guard.home) > 0.9 * 0.05 * 99 / rate - 0.01).all()
    assert not caplog.records


@pytest.mark.parametrize("rate", RATES[:-1])
def test_at_a_lower_rate_both_figures_and_the_key_are_named(rate, caplog):
    guard = Guard(scene_of(0.001), self_test=False)
    with caplog.at_level(logging.WARNING, logger="armguard"):
        commands, _ = loop(guard, rate, 100)
    assert commands[1].verdict.reason is Reason.CYCLE_LATE
    said = commands[1].verdict.why
    assert said.startswith(
        f"stop: {1e3 / rate:.1f} ms since the last cycle, but the scene declares "
        "period 1.0 ms (+ late 0.0 ms): set Scene(period="
    )
    assert len(caplog.records) == 1
    warning = caplog.records[0].getMessage()
    assert warning.startswith(f"cycles come every {1e3 / rate:.1f} ms, ")
    for sentence in (said, warning):
        # What it says to set is enough, and no more than that.
        code = re.search(r"Scene\(period=([\d.]+)\)", sentence)
        keys = re.search(r"`cycle: \{period: ([\d.]+)\}`", sentence)
        assert code[1] == keys[1]
        assert 1.0 / rate * (1.0 - 1e-6) <= float(code[1]) < 1.01 / rate
    again = Guard(scene_of(float(code[1])), self_test=False)
    commands, _ = loop(again, rate, 100, -0.05)
    assert max(c.verdict.level for c in commands) < Level.STOP


def test_fifty_hertz_with_the_arms_of_the_bay():
    scene = bay_scene("path")
    scene.period = 0.02
    commands, q = loop(Guard(scene, self_test=False), 50.0, 100, 0.005)
    assert {c.verdict.level for c in commands} <= {Level.CLEAR, Level.CAUTION}
    assert (np.abs(q - scene.home) > 0.009).all()


def answers(*passed):
    """Answers of cycles that came so long after the one before; 0 if in time."""
    rows = np.zeros((len(passed), 3))
    rows[:, 0] = np.where(np.array(passed) > 0.0, int(Reason.CYCLE_LATE), 0)
    rows[:, 2] = passed
    return rows


@pytest.mark.parametrize(
    "passed",
    [
        [0.02] * (IN_A_ROW - 1),
        [0.02] * (IN_A_ROW - 1) + [0.0] + [0.02] * (IN_A_ROW - 1),
        [0.02, 0.04] * IN_A_ROW,
    ],
)
def test_late_cycles_now_and_then_are_no_slower_loop(passed, caplog):
    pace = Pace(0.001, 0.0)
    for row in answers(*passed):
        pace.note(row)
    assert not caplog.records


def test_jitter_is_reported_as_late(caplog):
    pace = Pace(0.001, 0.0005)
    for row in answers(*[0.0195, 0.0205] * IN_A_ROW):
        pace.note(row)
    (record,) = caplog.records
    assert "period 1.0 ms (+ late 0.5 ms)" in record.getMessage()
    assert "Scene(period=0.02, late=0.0005)" in record.getMessage()
    assert "`cycle: {period: 0.02, late: 0.0005}`" in record.getMessage()


def test_a_late_cycle_of_a_service_names_the_rate_to_set():
    assert "--rate 50;" in late_sentence(0.02, 0.001, 0.0)
    assert "--rate 29.94;" in late_sentence(1.0 / 30.0, 0.001, 0.0)
