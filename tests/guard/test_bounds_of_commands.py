"""Commands of now and pending ones count with the worst that they let a slide do."""

import numpy as np
import pytest

from armguard.geometry import Pose
from armguard.guard import Reason
from sliding import APART, UNTOLD_CYCLE, at_gap, let_go, slides, worst_stop

PERIOD = 0.005

# Commands take long, and may change by 0.5 m/s in a cycle.
FIGURES = {"command": 0.048, "acceleration": 100.0, "settle": 0.02}

# Farther than any of these slides can get, and how fast they are [m], [m/s].
GAP, SPEED = 0.9, 0.3


def led(guard, desired, speeds, has_time=True, which_slide=0):
    """Commands for desired speeds, of a slide that is measured with other speeds.

    Args:
        guard: The guard.
        desired: Of each cycle [m/s].
        speeds: What is measured in it [m/s].
        has_time: Whether the guard is given the time of a cycle.
        which_slide: Which of the two it is; the second is on the other side.
    """
    sign = 1.0 - 2.0 * which_slide
    q, commands = at_gap(GAP, len(guard.q_names)), []
    let_go(guard)
    for k, (speed, measured) in enumerate(zip(desired, speeds, strict=True)):
        now = 5.0 + k * PERIOD
        motion, velocity = np.zeros(len(q)), np.zeros(len(q))
        motion[which_slide], velocity[which_slide] = sign * speed, sign * measured
        time = now if has_time else None
        commands.append(guard.filter(q, motion, now, velocity=velocity, now=time))
        q = q + velocity * PERIOD
    return commands


def needed(command):
    """Need of the nearest pair in the verdict of a command [m]."""
    pair = command.verdict.nearest
    return pair.distance - pair.headroom


@pytest.mark.parametrize("moving", [False, True])
def test_what_is_wanted_now_counts(moving):
    mover = {"top_speed": 0.5} if moving else {}
    guard = slides(FIGURES, mover=mover, period=PERIOD)
    if moving:
        guard.place("ball", Pose(xyz=(APART, 0.0, 0.0)), stamp=5.0)
    command = led(guard, [SPEED, 0.7], [SPEED, SPEED])[-1]
    commanded = command.velocity[0]
    assert commanded > 2.0 * SPEED
    need, rests = worst_stop(FIGURES, SPEED, FIGURES["command"] + PERIOD, commanded)
    if moving:
        need += 0.5 * (rests + PERIOD)
    assert needed(command) == pytest.approx(need, rel=1e-3)


# Figures of the slide, and whether the guard is given the time of a cycle.
UNDER_WAY = {
    "delay of commands": ({}, True),
    "error of tracking": ({"tracking_error": 0.2}, True),
    "age that is unknown": ({"sensing": 0.05}, False),
}


@pytest.mark.parametrize("which_slide", [0, 1])
@pytest.mark.parametrize("case", UNDER_WAY)
def test_a_command_counts_until_it_is_surely_replaced(case, which_slide):
    figures, known = UNDER_WAY[case]
    figures = {**FIGURES, **figures}
    guard = slides(*[{}] * which_slide, figures, period=PERIOD)
    age = 0.0 if known else figures["sensing"]
    # A burst: the greatest under way is neither the first nor the last.
    desired = [0.0] * 4 + [0.25] * 8 + [0.0] * 25
    commands = led(guard, desired, [0.1] * len(desired), known, which_slide)
    commanded = [abs(command.velocity[which_slide]) for command in commands]
    assert commanded[11] > 0.2
    error = figures.get("tracking_error", 0.0)
    reaction = (
        age + figures["command"] + PERIOD + UNTOLD_CYCLE * age * (1 - which_slide)
    )
    replaced = 0
    for k in range(12, len(desired)):
        # Those that were sent later than this may not be obeyed yet.
        first = int(np.floor(k - (age + figures["command"]) / PERIOD))
        driven = max(commanded[max(first, 0) : k + 1]) + error
        need, _ = worst_stop(figures, 0.1, reaction, driven)
        assert needed(commands[k]) == pytest.approx(need, rel=1e-3)
        replaced += driven == error
    assert 0 < replaced < len(desired) - 10


# A drive that takes its time, of which little else is unknown.
SLOW_DRIVE = {"command": 0.1, "acceleration": 8.0, "velocity_error": 1e-3}


def driven(guard, delays, desired, missed=None):
    """Commands of a slide that follows them, each command late by its delay.

    Args:
        guard: The guard.
        delays: Of each command [s].
        desired: Of each cycle [m/s].
        missed: What it is off them, of each cycle; nothing if None [m/s].
    """
    period, q, commands, sent = 1e-3, at_gap(5.0)[0], [], []
    let_go(guard)
    v = 0.0
    for k, speed in enumerate(desired):
        now = 5.0 + k * period
        due = [u for at, u in sent if at <= now + 1e-9]
        v = due[-1] if due else 0.0
        if missed is not None and v != 0.0:
            v += missed[k]
        command = guard.filter([q], [speed], now, velocity=[v], now=now)
        commands.append(command)
        sent.append((now + delays[k], command.velocity[0]))
        q += v * period
    return commands


def there_and_back(cycles=1200):
    """Desired speeds that rise and fall by 6 m/s², and turn at once [m/s]."""
    return np.interp(np.arange(cycles) % 400, [0, 100, 300, 400], [0.0, 0.6, -0.6, 0.0])


@pytest.mark.parametrize("share", [0.97, 1.03])
def test_a_drive_that_lags_is_seen_just_beyond_its_declared_delay(share):
    guard = slides(SLOW_DRIVE, period=1e-3)
    desired = there_and_back()
    delay = share * SLOW_DRIVE["command"]
    commands = driven(guard, np.full(len(desired), delay), desired)
    reasons = {command.verdict.reason for command in commands}
    assert (Reason.DRIVE_LAGS in reasons) == (share > 1.0)
    assert Reason.NOT_FOLLOWED not in reasons
    seen = max(command.verdict.drive_delays["left"] for command in commands)
    # In quarters of the declared delay, and never more than it is.
    assert seen == pytest.approx(0.1 if share > 1.0 else 0.075)


def test_a_drive_at_its_declared_delay_and_errors_never_lags():
    rng = np.random.default_rng(3)
    figures = {**SLOW_DRIVE, "tracking_error": 0.02}
    guard = slides(figures, period=1e-3)
    for kind in ("latest", "any", "turns"):
        desired = there_and_back(800) * rng.uniform(0.2, 2.0)
        delays = np.full(len(desired), figures["command"])
        if kind == "any":
            delays = rng.uniform(0.0, figures["command"], len(desired))
        missed = rng.uniform(-1.0, 1.0, len(desired)) * figures["tracking_error"]
        if kind == "turns":
            desired = rng.choice([-1.0, 0.0, 1.0], 40).repeat(20)
        commands = driven(guard, delays, desired, missed)
        for command in commands:
            assert command.verdict.reason < Reason.TOO_CLOSE
            assert command.verdict.drive_delays["left"] <= figures["command"]
