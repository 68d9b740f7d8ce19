"""A robot's time to contact is that of its first pair, as if all were looked at."""

import numpy as np
import pytest

from armguard.guard.contact_times import contact_time, lever_time, time_to_contact
from armguard.guard.workspace import open_workspace
from armguard.kernel import kernel
from sliding import at_gap, let_go, slides
from speed.filter import crowded_guard

CYCLES = 200


@kernel(inline=False, entry=True)
def look_at_all(lines, times):
    """Write when each near pair can touch, by levers alone and with directions."""
    w = open_workspace(lines)
    v, m = w.watch, w.motion
    for k in range(int(w.header.near_count)):
        near = w.near[k]
        times[k, 0] = near.time_to_contact = lever_time(near, w, v, m)
        times[k, 1] = contact_time(near, w, v, m)


@kernel(entry=True)
def time_of(distance, speed, push):
    return time_to_contact(distance, speed, push)


@pytest.mark.parametrize("time", [1e-3, 0.2, 3.0])
@pytest.mark.parametrize("push", [0.0, 0.3, 8.0])
@pytest.mark.parametrize("speed", [0.0, 0.1, 1.5])
def test_a_pair_touches_when_its_speed_and_what_is_added_to_it_have_closed_it(
    speed, push, time
):
    distance = speed * time + 0.5 * push * time**2
    known = time if distance > 0.0 else 0.0
    assert time_of(distance, speed, push) == pytest.approx(known)
    assert time_of(-1e-9, speed, push) == 0.0
    assert time_of(1e-9, 0.0, 0.0) == np.inf


@pytest.mark.parametrize("joints", [1, 2])
def test_by_levers_a_pair_touches_when_its_joints_get_there_all_errors_considered(
    joints,
):
    error, age, speed, push = 0.01, 0.004, 0.5, 8.0
    figures = {"position_error": error, "model_error": 0.003, "acceleration": push}
    guard = slides(*[figures] * joints, buffer=0.005, period=0.001)
    let_go(guard)
    velocity = [speed, -speed][:joints]
    guard.step(at_gap(0.5, joints), 5.0 - age, velocity=velocity, now=5.0)
    times = np.zeros((1, 2))
    look_at_all(guard._lines, times)
    # Each side comes as near, and is as far off.
    left = 0.5 - joints * (error + 0.003)
    root = np.roots([0.5 * joints * push, joints * speed, -left])
    assert times[0, 0] == pytest.approx(root.max() - age, rel=1e-6)


def test_no_pair_that_is_passed_over_is_sooner_than_a_reported_one():
    guard = crowded_guard(lambda sentence: None)
    n = len(guard.q_names)
    phases = np.random.default_rng(2).uniform(0.0, 2.0 * np.pi, n)
    q, velocity = guard.home, np.zeros(n)
    later = passed_over = 0
    for k in range(CYCLES):
        desired = 0.15 * np.sin(2.0 * np.pi * 0.7 * k * 1e-3 + phases)
        command = guard.filter(q, desired, k * 1e-3, velocity=velocity)
        near = command.verdict.near
        times = np.zeros((len(near), 2))
        look_at_all(guard._lines, times)
        assert np.all(times[:, 0] <= times[:, 1])
        for name, cue in command.verdict.cues.items():
            own = [f"{name}/" in f"{p.a} {p.b}" for p in near]
            assert cue.time_to_contact == times[own, 1].min(initial=np.inf)
        reported = np.array([p.time_to_contact for p in near])
        assert np.all((reported == times[:, 0]) | (reported == times[:, 1]))
        later += np.sum(times[:, 0] < times[:, 1])
        passed_over += np.sum(reported < times[:, 1])
        velocity = command.velocity
        q = q + velocity * 1e-3
    assert 0 < passed_over < later
