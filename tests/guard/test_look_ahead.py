"""A plan announced to a guard: how long it is proven ahead, and when it is not."""

from itertools import product
from math import inf, nan

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

import armguard as ag
from approach import FIGURES, PERIOD
from armguard.errors import SceneError, TrajectoryError
from armguard.guard.ahead import AheadReason
from armguard.guard.levels import Level
from armguard.prove import frontier
from armguard.scene import Scene
from arms import link_pose, simple_arm, wall_scene
from grippers import Loop, guard_of, pick_scene

# Face of the wall, and what links keep from it [m].
FACE, KEPT = 0.35, 0.01
LENGTH, RADIUS, JOINTS = 0.4, 0.04, 3
STEP, ROWS = 1.0, 4

# Seed of a plan that comes too near to the wall.
NEAR = 1
START = 100.0


def scene_with_wall(**errors):
    scene = Scene(mode="path", buffer=KEPT)
    figures = {**FIGURES, "position_error": 0.0, **errors}
    scene.add_robot(simple_arm(JOINTS), name="arm", stopping=figures)
    wall = ag.Box(size=(4.0, 0.2, 2.0))
    scene.add(wall, name="wall", pose=ag.Pose(xyz=(0.0, FACE + 0.1, 0.5)))
    scene.add(ag.Sphere(radius=0.1), name="ball", present=False)
    return scene


SCENE = scene_with_wall()


@pytest.fixture(scope="module")
def made():
    return ag.Guard(SCENE, self_test=False)


@pytest.fixture
def guard(made):
    made.remove("ball")
    made.reset()
    return made


class Curves:
    """A plan of that arm, and what SciPy and trigonometry know of it."""

    def __init__(self, seed, turn=0.5, scale=0.0):
        rng = np.random.default_rng([seed, 5])
        self.rows = rng.uniform(-turn, turn, (ROWS, JOINTS))
        self.speeds = rng.uniform(-0.3, 0.3, (ROWS, JOINTS)) * scale
        self.rows[0] = self.speeds[0] = 0.0
        self.times = STEP * np.arange(ROWS)
        self.curve = CubicHermiteSpline(self.times, self.rows, self.speeds)

    @classmethod
    def swing(cls):
        """A swing of the straight arm beside the wall, and back."""
        found = cls(NEAR)
        found.rows = np.zeros((ROWS, JOINTS))
        found.rows[:, 0] = -1.2, 0.0, -1.0, -1.0
        found.speeds = np.zeros((ROWS, JOINTS))
        found.curve = CubicHermiteSpline(found.times, found.rows, found.speeds)
        return found

    def plan(self, scene):
        names = scene.q_names
        motion = ag.Trajectory(
            names, self.rows, self.times, "plan", velocities=self.speeds
        )
        return ag.Plan.of(motion, scene)

    def ends(self, times):
        """Both ends of all links in the plane at some times, (k, 2 · links, 2)."""
        turned = np.cumsum(self.curve(times), axis=1)
        ways = np.stack((np.cos(turned), np.sin(turned)), axis=2)
        joints = LENGTH * (np.cumsum(ways, axis=1) - ways)
        return np.concatenate((joints + 0.1 * ways, joints + LENGTH * ways), axis=1)

    def first_near_wall(self, kept=KEPT):
        """First time at which a link is nearer to the wall than it may be, or inf."""
        times = np.arange(0.0, self.times[-1], 2e-5)
        near = FACE - self.ends(times)[:, :, 1].max(axis=1) - RADIUS < kept
        return float(times[np.argmax(near)]) if near.any() else inf

    def cycle(self, guard, t, off=0.0):
        """A cycle at a time of the plan, with joints off the curve."""
        velocity = self.curve(min(t, self.times[-1]), 1)
        q = self.curve(min(t, self.times[-1])) + off
        return guard.step(q, START + t, velocity=velocity)


def test_trigonometry_has_the_links_where_the_model_has_them():
    curves, model = Curves(1), simple_arm(JOINTS)
    ends = curves.ends(np.array([0.6]))[0]
    positions = dict(
        zip(("joint1", "joint2", "joint3"), curves.curve(0.6), strict=True)
    )
    for k in range(JOINTS):
        T = link_pose(model, positions, f"link{k + 1}")
        for x, at in ((0.1, k), (LENGTH, JOINTS + k)):
            np.testing.assert_allclose(ends[at], (T @ [x, 0, 0, 1])[:2], atol=1e-12)


@pytest.mark.parametrize("seed", range(10))
def test_the_lead_is_that_of_a_dense_oracle_until_the_guard_stops(guard, seed):
    curves = Curves(seed, scale=float(seed % 2))
    guard.announce(curves.plan(SCENE), START, following_error=1e-9)
    near, leads = curves.first_near_wall(), []
    for t in np.arange(0.0, curves.times[-1], PERIOD):
        verdict = curves.cycle(guard, t)
        if verdict.level >= Level.STOP:
            assert verdict.ahead.reason is AheadReason.STOPPED
            assert not verdict.ahead.enough
            break
        ahead = verdict.ahead
        leads.append(ahead)
        if near == inf:
            assert (ahead.reason, ahead.lead) == (AheadReason.PROVEN, inf)
        else:
            assert ahead.reason is AheadReason.NEAR
            assert "wall" in (ahead.a, ahead.b)
            # Never later than it is, and at most a cycle before.
            assert near - t - PERIOD <= ahead.lead <= near - t + 4e-5
    assert leads
    # Every stop could be ordered while it was in time, before the guard's own.
    late = [one for one in leads if not one.enough]
    assert leads[0].enough
    if near < inf:
        assert late
        assert late[0].lead >= late[0].needed - 2.0 * PERIOD
    else:
        assert not late


def test_reaction_and_stop_are_those_of_the_declared_figures(monkeypatch):
    # Nothing is proven, so every robot counts.
    monkeypatch.setattr(frontier, "TILES", 0)
    scene = Scene(mode="path", buffer=KEPT)
    scene.add_robot(simple_arm(1), name="arm", stopping=FIGURES)
    guard = ag.Guard(scene, self_test=False)
    rows, times = np.array([[0.0], [1.0]]), np.array([0.0, 1.0])
    motion = ag.Trajectory(scene.q_names, rows, times, "turn")
    guard.announce(ag.Plan.of(motion, scene), 0.0, following_error=0.0)
    ahead = guard.step(rows[0], 0.0, velocity=np.zeros(1)).ahead
    # Until the drive obeys it may speed up; then it decelerates.
    reaction = FIGURES["sensing"] + FIGURES["command"] + PERIOD
    speed = 1.0 + FIGURES["acceleration"] * reaction
    stop = speed / FIGURES["deceleration"]
    assert ahead.needed == pytest.approx(reaction + stop, rel=1e-9)


def test_an_object_that_is_placed_is_met_in_the_next_cycle(guard):
    curves = Curves.swing()
    assert curves.first_near_wall() == inf
    guard.announce(curves.plan(SCENE), START, following_error=1e-9)
    for k in range(50):
        ahead = curves.cycle(guard, k * PERIOD).ahead
    assert ahead.reason is AheadReason.PROVEN
    # Where the tip of the arm is after a second.
    x, y = curves.ends(np.array([1.0]))[0, -1]
    guard.place("ball", ag.Pose(xyz=(x, y, 0.6)))
    times = np.arange(0.05, curves.times[-1], 2e-5)
    ends = curves.ends(times)
    one, other = ends[:, JOINTS - 1], ends[:, -1]
    along = other - one
    share = ((np.array([x, y]) - one) * along).sum(axis=1) / (along**2).sum(axis=1)
    foot = one + np.clip(share, 0.0, 1.0)[:, None] * along
    # The ball is in the plane of the last link.
    gap = np.linalg.norm(foot - (x, y), axis=1) - 0.1 - RADIUS
    near = float(times[np.argmax(gap < KEPT)])
    ahead = curves.cycle(guard, 0.05).ahead
    assert ahead.reason is AheadReason.NEAR
    assert {ahead.a, ahead.b} == {"arm/link3", "ball"}
    assert near - 0.05 - PERIOD <= ahead.lead <= near - 0.05 + 4e-5
    guard.remove("ball")
    assert curves.cycle(guard, 0.051).ahead.reason is AheadReason.PROVEN


def test_a_lead_is_no_longer_than_what_is_proven(guard, monkeypatch):
    monkeypatch.setattr(frontier, "TILES", 2)
    curves = Curves.swing()
    guard.announce(curves.plan(SCENE), START, following_error=1e-9)
    ends = []
    for k in range(40):
        if k == 30:
            guard.place("ball", ag.Pose(xyz=(3.0, 3.0, 3.0)))
        t = k * PERIOD
        ahead = curves.cycle(guard, t).ahead
        ends.append(t + ahead.lead)
        if ahead.lead < inf:
            assert ahead.reason is AheadReason.UNPROVEN
    before, after = ends[:30], ends[30:]
    for part in (before, after):
        assert part == sorted(part)
        # Two tiles of 0.2 rad each, of joints that turn at 0.5 rad/s at least.
        assert part[0] < part[1] < 2.0
    assert before[-1] == inf
    assert after[0] < 0.5 * curves.times[-1]
    guard.remove("ball")


def test_more_pairs_than_a_cycle_can_judge_end_the_lead(guard, monkeypatch):
    curves = Curves(NEAR)
    near = curves.first_near_wall()
    assert near < inf
    monkeypatch.setattr(frontier, "MOST_PAIRS", 0)
    guard.announce(curves.plan(SCENE), START, following_error=1e-9)
    for t in (0.0, PERIOD):
        ahead = curves.cycle(guard, t).ahead
    assert ahead.reason is AheadReason.CROWDED
    assert ahead.lead <= near
    assert ahead.needed < inf


def test_a_place_that_the_arms_have_passed_is_not_looked_at_again(guard, monkeypatch):
    curves = Curves(NEAR)
    guard.announce(curves.plan(SCENE), START, following_error=1e-9)
    with monkeypatch.context() as small:
        small.setattr(frontier, "TILES", 0)
        ahead = curves.cycle(guard, 0.0).ahead
    assert (ahead.reason, ahead.lead) == (AheadReason.CROWDED, 0.0)
    ahead, near = curves.cycle(guard, PERIOD).ahead, curves.first_near_wall()
    assert ahead.reason is AheadReason.NEAR
    assert near - 2.0 * PERIOD <= ahead.lead <= near - PERIOD + 4e-5


def test_before_its_start_an_unproven_first_row_has_no_lead(guard, monkeypatch):
    monkeypatch.setattr(frontier, "TILES", 0)
    curves = Curves.swing()
    guard.announce(curves.plan(SCENE), START + 0.5, following_error=1e-9)
    ahead = guard.step(curves.rows[0], START, velocity=np.zeros(JOINTS)).ahead
    assert (ahead.reason, ahead.lead) == (AheadReason.CROWDED, 0.0)
    assert not ahead.enough


def test_errors_of_the_arm_count_as_they_do_in_the_guard():
    wrong = 0.05
    guard = ag.Guard(scene_with_wall(model_error=wrong), self_test=False)
    curves = Curves(NEAR)
    guard.announce(curves.plan(SCENE), START, following_error=1e-9)
    ahead = curves.cycle(guard, 0.0).ahead
    near = curves.first_near_wall(kept=KEPT + wrong)
    assert near < curves.first_near_wall() - 0.01
    assert ahead.lead <= near + 4e-5
    assert ahead.lead >= near - PERIOD


def test_the_error_of_measured_positions_counts():
    wrong, curves = 0.02, Curves(NEAR)
    guard = ag.Guard(scene_with_wall(position_error=wrong), self_test=False)
    guard.announce(curves.plan(SCENE), START, following_error=1e-9)
    ahead = curves.cycle(guard, 0.0).ahead
    planned, firsts = curves.curve, []
    for side in product((-wrong, wrong), repeat=JOINTS):
        curves.curve = lambda t, side=side: planned(t) + np.array(side)
        firsts.append(curves.first_near_wall())
    curves.curve = planned
    assert min(firsts) < curves.first_near_wall() - 0.01
    assert 0.9 * min(firsts) <= ahead.lead <= min(firsts) + 4e-5


def test_no_lead_is_claimed_where_the_plan_is_not_followed(guard):
    curves, off = Curves.swing(), 2e-6
    guard.announce(curves.plan(SCENE), START, following_error=off)
    still = np.zeros(JOINTS)
    for t, away, reason in (
        (0.000, 0.0, AheadReason.PROVEN),
        (0.001, 0.9 * off * np.array([1.0, -1.0, 1.0]), AheadReason.PROVEN),
        (0.002, 1.1 * off * np.array([0.0, 0.0, 1.0]), AheadReason.NOT_FOLLOWED),
        (0.003, 0.0, AheadReason.PROVEN),
    ):
        ahead = curves.cycle(guard, t, away).ahead
        assert ahead.reason is reason
        assert ahead.enough is (reason is AheadReason.PROVEN)
        assert ahead.lead == (inf if ahead.enough else 0.0)
    # It waits where the plan has gone on.
    for k in range(400):
        ahead = guard.step(curves.rows[0], START + 0.004 + k * PERIOD, velocity=still)
    assert ahead.ahead.reason is AheadReason.NOT_FOLLOWED


def test_before_its_start_a_plan_counts_from_its_first_row(guard):
    curves = Curves.swing()
    guard.announce(curves.plan(SCENE), START + 0.5, following_error=1e-9)
    still = np.zeros(JOINTS)
    ahead = guard.step(curves.rows[0], START, velocity=still).ahead
    assert (ahead.reason, ahead.lead) == (AheadReason.PROVEN, inf)


@pytest.mark.parametrize("stamp", [nan, inf, "soon", None])
def test_an_input_that_is_refused_ends_the_lead(guard, stamp):
    curves = Curves.swing()
    guard.announce(curves.plan(SCENE), START, following_error=1e-9)
    assert curves.cycle(guard, 0.0).ahead.enough
    bad = np.full(JOINTS, nan)
    for verdict in (guard.step(curves.rows[0], stamp), guard.step(bad, START + 0.001)):
        assert verdict.ahead.reason is AheadReason.STOPPED
        assert (verdict.ahead.lead, verdict.ahead.enough) == (0.0, False)


def test_an_old_measurement_ends_the_lead(guard):
    curves = Curves.swing()
    guard.announce(curves.plan(SCENE), START, following_error=1e-9)
    q, still = curves.rows[0], np.zeros(JOINTS)
    assert guard.step(q, START, velocity=still, now=START).ahead.enough
    late = START + 1.1 * FIGURES["stale"]
    assert not guard.step(q, START, velocity=still, now=late).ahead.enough


def test_a_grasp_ends_the_lead_until_the_plan_is_announced_again():
    scene = pick_scene()
    loop = Loop(guard_of(scene))
    assert loop.go({"arm/z": 0.1}, speed=0.08)
    assert loop.go({"arm/open_left": 0.02, "arm/open_right": 0.02}, speed=0.02)
    rows, times = np.array([loop.q, loop.q]), np.array([0.0, 10.0])
    rest = ag.Plan.of(ag.Trajectory(scene.q_names, rows, times, "rest"), scene)
    still = np.zeros_like(loop.q)
    loop.guard.announce(rest, loop.t, following_error=1e-3)
    before = loop.cycle(still).verdict.ahead
    assert before.reason is AheadReason.NEAR
    loop.guard.grasp("arm", "block")
    for _ in range(2):
        after = loop.cycle(still).verdict.ahead
        assert (after.reason, after.enough) == (AheadReason.CHANGED, False)
    loop.guard.announce(rest, loop.t, following_error=1e-3)
    # The block is on its table: only the guard knows that it may be.
    again = loop.cycle(still).verdict.ahead
    assert (again.reason, again.lead) == (AheadReason.NEAR, 0.0)
    assert {again.a, again.b} == {"block", "table"}


def test_a_plan_changes_no_number_of_a_verdict(guard):
    curves, found = Curves(NEAR), []
    for announced in (False, True):
        guard.reset()
        if announced:
            guard.announce(curves.plan(SCENE), START, following_error=1e-9)
        verdicts = [curves.cycle(guard, k * PERIOD) for k in range(300)]
        found.append([one.tobytes() for one in verdicts])
        assert (verdicts[0].ahead.reason is AheadReason.NO_PLAN) is not announced
    assert found[0] == found[1]


def test_a_filtered_command_has_the_lead_too(guard):
    curves = Curves.swing()
    guard.announce(curves.plan(SCENE), START, following_error=1e-9)
    still = np.zeros(JOINTS)
    command = guard.filter(curves.rows[0], still, START, velocity=still)
    assert command.verdict.ahead.reason is AheadReason.PROVEN
    guard.reset()
    command = guard.filter(curves.rows[0], still, START, velocity=still)
    assert command.verdict.ahead.reason is AheadReason.NO_PLAN


def test_words_and_numbers(guard):
    assert guard.step(guard.home, START).ahead.sentence == "no plan is announced"
    curves = Curves(NEAR)
    guard.announce(curves.plan(SCENE), START, following_error=1e-9)
    ahead = curves.cycle(guard, 0.001).ahead
    assert "a pair may be too near: arm/link" in ahead.sentence
    assert ahead.to_dict()["reason"] == "NEAR"
    assert ahead.to_dict()["enough"] is ahead.enough


def test_a_plan_that_cannot_be_announced_is_refused_in_words(guard):
    curves = Curves(NEAR)
    plan = curves.plan(SCENE)
    path = ag.Trajectory(SCENE.q_names, curves.rows, None, "path.csv")
    untimed = ag.Plan.of(path, SCENE)
    other = ag.bay_scene()
    rows = np.array([other.home, other.home])
    foreign = ag.Trajectory(other.q_names, rows, np.array([0.0, 1.0]), "other.csv")
    guard.reset()
    for bad, start, error, words in (
        (untimed, 0.0, 0.0, "path.csv: it has no times, so it has no lead; give times"),
        (plan, nan, 0.0, "start is nan; it must be a finite time"),
        (plan, 0.0, -1.0, "following_error is -1; it must be finite"),
        (plan, 0.0, {"left": 0.1}, "given for 'left', no robot or joint"),
        (ag.Plan.of(foreign, other), 0.0, 0.0, "14 joints, and the guard has 3; read"),
    ):
        with pytest.raises(TrajectoryError, match=words):
            guard.announce(bad, start, following_error=error)
    fixed = wall_scene()
    with pytest.raises(SceneError, match="every robot is 'fixed'"):
        ag.Guard(fixed, self_test=False).announce(plan, 0.0, following_error=0.0)
    assert guard.step(guard.home, START).ahead.reason is AheadReason.NO_PLAN
