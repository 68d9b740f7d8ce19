"""Cues: which way is safe, how urgent it is, and what a hand should feel."""

import numpy as np
import pytest

from approach import FIGURES, angle_at, ball_guard, moving
from armguard.guard import Level
from armguard.respond import Guard
from armguard.scene import bay_scene
from driven import two_arms, wall_guard


def cue_at(gap, speed=0.0):
    """Cue of the arm that turns towards the ball."""
    return moving(ball_guard(), gap, speed).cues["arm"]


def test_where_nothing_is_near_there_is_nothing_to_feel():
    guard = ball_guard(settings={"margin": 0.01})
    verdict = guard.step([-1.0], 0.0, velocity=[0.0])
    cue = verdict.cues["arm"]
    assert (cue.urgency, cue.time_to_contact) == (0.0, np.inf)
    for vector in (cue.escape, cue.force, cue.torque, cue.tool_escape):
        assert not vector.any()


def test_the_way_out_leads_away_and_the_force_with_it():
    cue = cue_at(0.012)
    assert cue.escape.tolist() == [-1.0]
    # From the ball to the arm, which lies below it in the plane.
    outward = np.array([np.sin(angle_at(0.012)), -np.cos(angle_at(0.012)), 0.0])
    assert cue.force / np.linalg.norm(cue.force) == pytest.approx(outward)
    # The force turns the arm back.
    assert cue.torque[2] < 0.0


def test_the_force_grows_as_the_arm_comes_nearer():
    forces = [np.linalg.norm(cue_at(gap).force) for gap in (0.05, 0.02, 0.01, 0.006)]
    assert forces[0] == 0.0
    assert (np.diff(forces) > 0.0).all()
    assert forces[-1] <= 10.0


def test_urgency_rises_with_the_time_that_is_left_and_is_full_at_a_stop():
    urgencies, level = [], Level.CLEAR
    for gap in np.linspace(0.4, 0.02, 40):
        verdict = moving(ball_guard(), gap, 0.8, age=FIGURES["sensing"])
        urgencies.append(verdict.cues["arm"].urgency)
        level = verdict.level
    assert urgencies[0] == 0.0
    # Where a sharper bound takes over, a little time is won.
    assert (np.diff(urgencies) >= -0.06).all()
    assert sum(np.diff(urgencies) > 0.0) > 10
    assert level is Level.STOP
    assert urgencies[-1] == 1.0


def test_the_way_out_opens_what_is_near_in_truth():
    guard = wall_guard()
    q = np.array([0.31, 0.2, 0.1])
    verdict = guard.step(q, 0.0, velocity=[0.0] * 3)
    cue = verdict.cues["arm"]
    before = verdict.nearest.distance
    after = guard.judge_at_rest(q + 0.01 * cue.escape).nearest
    assert np.linalg.norm(cue.escape) == pytest.approx(1.0)
    assert after is None or after.distance > before + 0.005


def test_where_the_tool_goes_is_a_difference_quotient():
    guard = wall_guard()
    q = np.array([0.31, 0.2, 0.1])
    cue = guard.step(q, 0.0, velocity=[0.0] * 3).cues["arm"]
    step = 1e-6

    def tool(q):
        angles = np.cumsum(q)
        return 0.4 * np.array([np.cos(angles[:2]).sum(), np.sin(angles[:2]).sum()])

    moved = (tool(q + step * cue.escape) - tool(q)) / step
    assert cue.tool_escape[:2] == pytest.approx(moved, abs=1e-5)


def test_the_torque_is_that_of_the_force_about_the_tool():
    guard = wall_guard()
    q = np.array([0.31, 0.2, 0.1])
    verdict = guard.step(q, 0.0, velocity=[0.0] * 3)
    cue = verdict.cues["arm"]
    near = [p for p in verdict.near if p.headroom < 0.02]
    assert near
    angles = np.cumsum(q)
    tool = 0.4 * np.array([np.cos(angles[:2]).sum(), np.sin(angles[:2]).sum()])
    # Every pair pushes down from the wall; what they do about z follows from where.
    pushes = [10.0 * min(1.0 - p.headroom / 0.02, 1.0) for p in near]
    total = min(sum(pushes), 10.0) / sum(pushes)
    torque = -sum(
        total * push * (p.point_a[0] - tool[0])
        for push, p in zip(pushes, near, strict=True)
    )
    assert cue.force[1] == pytest.approx(-min(sum(pushes), 10.0))
    assert cue.torque[2] == pytest.approx(torque)


def test_two_arms_feel_the_opposite():
    guard = two_arms(parked=0.84)
    q = np.array([0.92, -0.84])
    verdict = guard.step(q, 0.0, velocity=[0.0, 0.0])
    left, right = verdict.cues["left"], verdict.cues["right"]
    assert left.force == pytest.approx(-right.force)
    assert np.linalg.norm(left.force) > 0.0
    assert left.escape.tolist() == [1.0]
    assert right.escape.tolist() == [-1.0]


def test_they_are_data_and_go_into_json():
    verdict = moving(ball_guard(), 0.012, 0.0)
    cues = verdict.to_dict()["cues"]
    assert set(cues["arm"]) == {
        "urgency",
        "time_to_contact",
        "escape",
        "tool_escape",
        "force",
        "torque",
    }


def test_where_no_stops_are_predicted_there_are_none():
    guard = Guard(bay_scene())
    assert guard.step(guard.home).cues == {}
