"""The proof of each cycle: what it lets through can stop, and what it stops must."""

from dataclasses import replace

import numpy as np
import pytest

from armguard import bay_scene
from armguard.errors import SceneError
from armguard.geometry import Box, Pose, Sphere
from armguard.guard import Level, Reason
from armguard.guard.watch import RUNNING
from armguard.kernel import kernel
from armguard.respond import Guard
from armguard.robot.stopping import stopping_figures
from armguard.scene import Scene
from armguard.scene.settings import IndexSettings
from arms import simple_arm, wall_scene

FIGURES = {
    "velocity": 1.5,
    "acceleration": 8.0,
    "deceleration": 4.0,
    "deceleration_most": 6.0,
    "ramp": 0.005,
    "settle": 0.001,
    "settle_time": 0.05,
    "brake_delay": 0.02,
    "brake_deceleration": 10.0,
    "position_error": 1e-4,
    "velocity_error": 0.005,
    "sensing": 0.002,
    "command": 0.004,
    "stale": 0.02,
}
PERIOD = 0.001


def path_bay(mode="path", index=None, **changes):
    """The bay with figures and a floor of 5 mm."""
    scene = bay_scene()
    figures = {**FIGURES, **changes}
    for name, robot in list(scene.robots.items()):
        stopping = stopping_figures(robot.model, **figures)
        scene._robots[name] = replace(robot, mode=mode, stopping=stopping)
    scene.mode, scene.buffer = mode, 0.005
    if index is not None:
        scene.index = index
    return scene


def arm_scene(mode="path", figures=FIGURES, **settings):
    """One planar arm, and a wall whose face is at y = 0.5."""
    scene = wall_scene(mode=mode, **settings)
    robot = scene.robots["arm"]
    stopping = stopping_figures(robot.model, **figures)
    scene._robots["arm"] = replace(robot, stopping=stopping)
    return scene


class Robot:
    """One arm that obeys as declared, or as little as a factor says."""

    def __init__(self, guard, q, figures=FIGURES, weak=1.0):
        self.guard, self.q = guard, np.array(q, dtype=float)
        self.v = np.zeros_like(self.q)
        self.f, self.weak = figures, weak
        self.t, self.ordered, self.braked = 0.0, None, None
        self.verdicts = []

    def cycle(self, desired):
        """One cycle: measure, ask, obey for a period."""
        verdict = self.guard.step(self.q, self.t, velocity=self.v, now=self.t)
        self.verdicts.append(verdict)
        level = verdict.level
        if level >= Level.BRAKE and self.braked is None:
            self.braked = self.t + self.f["brake_delay"]
        if level >= Level.STOP and self.ordered is None:
            self.ordered = self.t + self.f["command"]
        if level < Level.STOP and not self.v.any():
            self.ordered = self.braked = None
        for _ in range(10):
            dt = PERIOD / 10
            before = self.v.copy()
            if self.braked is not None and self.t >= self.braked:
                self.slow(self.f["brake_deceleration"] * dt)
            elif self.ordered is not None and self.t >= self.ordered:
                rising = min((self.t - self.ordered) / self.f["ramp"], 1.0)
                self.slow(self.weak * self.f["deceleration"] * rising * dt)
            else:
                change = np.clip(desired - self.v, -1, 1) * self.f["acceleration"] * dt
                self.v = np.clip(self.v + change, -self.f["velocity"], 1.5)
            self.q += 0.5 * dt * (before + self.v)
            self.t += dt
        return verdict

    def slow(self, change):
        self.v = np.sign(self.v) * np.maximum(np.abs(self.v) - change, 0.0)


def drive_at_wall(guard, cycles=1500, **changes):
    robot = Robot(guard, [0.2, 0.0, 0.0], **changes)
    for _ in range(cycles):
        robot.cycle(np.array([1.2, 0.0, 0.0]))
    return robot


@pytest.fixture(scope="module")
def wall_guard():
    return Guard(arm_scene())


def test_levels_rise_in_order_and_the_arm_rests_before_the_wall(wall_guard):
    wall_guard.reset()
    robot = drive_at_wall(wall_guard)
    levels = [v.level for v in robot.verdicts]
    first = {level: levels.index(level) for level in set(levels)}
    assert first[Level.CLEAR] < first[Level.SLOW] < first[Level.STOP]
    assert Level.BRAKE not in first
    assert not robot.v.any()
    near = wall_guard.judge_at_rest(robot.q).nearest
    assert 0.005 <= near.distance <= 0.02
    stop = robot.verdicts[first[Level.STOP]]
    assert stop.reason is Reason.TOO_CLOSE
    assert stop.causes == {"arm": Reason.TOO_CLOSE}
    assert stop.speed_scale == {"arm": 0.0}
    assert stop.nearest.b == "wall"


def test_time_left_and_scale_fall_on_the_way(wall_guard):
    wall_guard.reset()
    robot = drive_at_wall(wall_guard, 700)
    levels = [v.level for v in robot.verdicts]
    before = robot.verdicts[: levels.index(Level.STOP)]
    slowed = [v for v in before if v.level is Level.SLOW]
    scales = np.array([v.speed_scale["arm"] for v in slowed])
    assert len(scales) > 20
    assert ((scales > 0.0) & (scales <= 1.0)).all()
    assert (np.diff(scales[-20:]) < 0.0).all()
    assert slowed[-1].headroom.s < 0.005


def test_a_stop_slower_than_declared_is_answered_by_the_brake(wall_guard):
    wall_guard.reset()
    robot = drive_at_wall(wall_guard, weak=0.7)
    levels = [v.level for v in robot.verdicts]
    assert Level.BRAKE in levels
    assert robot.verdicts[levels.index(Level.BRAKE)].reason is Reason.STOP_LAGS
    assert "arm/joint1" in robot.verdicts[-1].disproved
    near = wall_guard.judge_at_rest(robot.q).nearest
    assert near is None or near.distance > 0.0
    assert robot.verdicts[-1].level >= Level.BRAKE
    wall_guard.reset()
    assert wall_guard.step(robot.q, 9.0, velocity=np.zeros(3)).disproved == ()


def test_an_arm_that_moves_before_it_was_let_go_is_stopped_with_that_reason(wall_guard):
    wall_guard.reset()
    q, v = np.array([0.2, 0.0, 0.0]), np.array([0.3, 0.0, 0.0])
    verdict = wall_guard.step(q, 0.0, velocity=v, now=0.0)
    assert verdict.level is Level.STOP
    assert verdict.reason is Reason.MOVED_AT_REST
    assert verdict.causes == {"arm": Reason.MOVED_AT_REST}
    assert verdict.why == "'arm': stop, the arm moves while it should be held"
    # It goes on as if nothing had been said: the brake, and then whatever is outside.
    levels = []
    for k in range(1, 400):
        t = k * PERIOD
        levels.append(wall_guard.step(q + v * t, t, velocity=v, now=t).level)
    first = {level: levels.index(level) for level in set(levels)}
    assert first[Level.STOP] < first[Level.BRAKE] < first[Level.HARDWARE_STOP]


def test_a_swing_within_the_declared_one_is_no_failure_to_stop(wall_guard):
    wall_guard.reset()
    robot = Robot(wall_guard, [0.2, 0.0, 0.0])
    while robot.ordered is None:
        top = robot.v[0]
        robot.cycle(np.array([1.2, 0.0, 0.0]))
    while robot.v.any():
        robot.cycle(np.zeros(3))
    # Half a sine in 0.3 of the longest time, from where the arm came to rest.
    rest, began = robot.q.copy(), robot.t
    height = FIGURES["settle"] * top / FIGURES["velocity"]
    time = 0.3 * FIGURES["settle_time"]
    levels = []
    for k in range(60):
        t = began + k * PERIOD
        phase = np.pi * min(k * PERIOD / time, 1.0)
        q, v = rest.copy(), np.zeros(3)
        q[0] += height * np.sin(phase)
        v[0] = height * np.pi / time * np.cos(phase) if phase < np.pi else 0.0
        levels.append(wall_guard.step(q, t, velocity=v, now=t).level)
    assert max(levels) < Level.BRAKE


def test_an_arm_that_does_not_stop_at_all_is_to_be_stopped_from_outside(wall_guard):
    wall_guard.reset()
    t, q = 0.0, np.array([0.2, 0.0, 0.0])
    levels = []
    for _ in range(900):
        verdict = wall_guard.step(q, t, velocity=np.array([1.0, 0, 0]), now=t)
        levels.append(verdict.level)
        t, q = t + PERIOD, q + np.array([PERIOD, 0, 0])
    assert levels.index(Level.BRAKE) < levels.index(Level.HARDWARE_STOP)


def test_a_stop_is_done_when_standstill_is_measured(wall_guard):
    wall_guard.reset()
    robot = drive_at_wall(wall_guard, 900)
    for _ in range(400):
        robot.cycle(np.zeros(3))
    # Near the wall, with an operator who might do anything: at rest, not let go, or let
    # go because a stop from there is proven.
    assert robot.verdicts[-1].level in (Level.RECOVER, Level.SLOW, Level.CAUTION)
    back = Robot(wall_guard, [0.2, 0.0, 0.0])
    back.t = robot.t
    wall_guard.reset()
    assert back.cycle(np.zeros(3)).level < Level.STOP


def test_speed_mode_stops_what_path_lets_pass():
    """Along the wall rather than at it: levers know no direction."""
    stopped = {}
    for mode in ("speed", "path"):
        robot = Robot(Guard(arm_scene(mode)), [0.3, -0.3, 0.0])
        while robot.t < 1.8:
            robot.cycle(np.array([0.8, -0.8, 0.0]))
        stopped[mode] = any(v.level >= Level.STOP for v in robot.verdicts)
    assert stopped == {"speed": True, "path": False}


def test_every_cycle_may_test_only_its_budget():
    guard = Guard(path_bay(), budget=2, self_test=False)
    rng = np.random.default_rng(0)
    spent = 0
    for k in range(300):
        q = guard.home + rng.uniform(-0.6, 0.6, 14)
        guard.reset()
        verdict = guard.step(q, k * PERIOD, velocity=rng.uniform(-1, 1, 14))
        assert verdict.counts.spans_tested <= 2 + 2
        spent += verdict.reason is Reason.BUDGET_SPENT
    assert spent > 0
    assert Level.STOP <= Guard(path_bay(), budget=0, self_test=False).step(q, 1.0).level


def test_octree_and_brute_force_say_the_same_bits():
    by_tree = Guard(path_bay())
    by_force = Guard(path_bay(index=IndexSettings(kind="brute_force")))
    rng = np.random.default_rng(1)
    q = by_tree.home
    for k in range(400):
        v = rng.uniform(-1.2, 1.2, 14)
        q = np.clip(q + 0.02 * v, by_tree.tables.lower, by_tree.tables.upper)
        for guard in (by_tree, by_force):
            if k % 20 == 0:
                guard.reset()
        one = by_tree.step(q, k * PERIOD, velocity=v)
        other = by_force.step(q, k * PERIOD, velocity=v)
        assert one.tobytes() == other.tobytes()


def test_a_large_scene_is_searched_in_boxes():
    def scene(kind):
        made = arm_scene(index=IndexSettings(kind=kind))
        rng = np.random.default_rng(5)
        for k in range(300):
            made.add(
                Sphere(radius=0.02),
                name=f"ball{k}",
                pose=Pose(xyz=tuple(rng.uniform((0.3, -2, 0), (3, 0.4, 1)))),
            )
        return made

    by_tree, by_force = Guard(scene("octree")), Guard(scene("brute_force"))
    rng = np.random.default_rng(2)
    far = 0
    for k in range(300):
        q, v = rng.uniform(-1.5, 1.5, 3), rng.uniform(-1.5, 1.5, 3)
        by_tree.reset()
        by_force.reset()
        one = by_tree.step(q, k * PERIOD, velocity=v)
        other = by_force.step(q, k * PERIOD, velocity=v)
        assert one.tobytes() == other.tobytes()
        far += one.counts.pairs_tested < other.counts.pairs_skipped
    assert far > 0


def test_an_object_that_moves_counts_with_its_speed_and_age():
    scene = arm_scene()
    scene.add(
        Sphere(radius=0.05), name="cart", pose=Pose(xyz=(3, -3, 0)), top_speed=0.5
    )
    guard = Guard(scene)
    q = np.array([0.0, 0.0, 0.0])
    unseen = guard.step(q, 0.0, velocity=np.zeros(3))
    assert unseen.reason is Reason.OBJECT_UNSEEN
    with pytest.raises(SceneError, match="moves"):
        guard.place("cart", Pose(xyz=(0.8, -0.11, 0.4)))
    needed = []
    for age in (0.0, 0.1, 0.2):
        guard.reset()
        guard.place("cart", Pose(xyz=(0.8, -0.11, 0.4)), stamp=1.0)
        verdict = guard.step(q, 1.0 + age, velocity=np.zeros(3))
        needed.append(verdict.budget.needed)
        assert verdict.nearest.b == "cart"
        assert verdict.budget.object >= 0.5 * age
    assert needed[1] - needed[0] == pytest.approx(0.05, abs=1e-3)
    assert needed[2] - needed[1] == pytest.approx(0.05, abs=1e-3)
    # Without a time of the cycle, the object too may be as old as the arm.
    budgets = []
    for now in (None, 1.1):
        guard.reset()
        guard.place("cart", Pose(xyz=(0.8, -0.11, 0.4)), stamp=1.0)
        verdict = guard.step(q, 1.1, velocity=np.zeros(3), now=now)
        budgets.append(verdict.budget.object)
    assert budgets[0] - budgets[1] >= 0.5 * FIGURES["sensing"]


def test_mixed_modes_guard_one_scene():
    scene = Scene(mode="path", buffer=0.005)
    for name, y, mode in (("left", 0.0, "path"), ("right", 2.0, "fixed")):
        model = simple_arm()
        scene.add_robot(
            model,
            name=name,
            base=Pose(xyz=(0, y, 0)),
            mode=mode,
            stopping=stopping_figures(model, **FIGURES),
        )
    guard = Guard(scene)
    q = guard.home
    assert guard.step(q, 0.0, velocity=np.zeros(6)).level < Level.STOP
    # The fixed one is where the other's way leads to.
    q[3] = -1.4
    verdicts = []
    for k in range(1, 900):
        q[0] = 0.3 + min(k * PERIOD, 0.7)
        v = np.zeros(6)
        v[0] = 1.0
        verdicts.append(guard.step(q, k * PERIOD, velocity=v, now=k * PERIOD))
    stopped = [v for v in verdicts if v.levels["left"] >= Level.STOP]
    assert stopped
    assert stopped[0].levels["right"] < Level.STOP


def test_velocity_is_estimated_within_its_bounds(wall_guard):
    wall_guard.reset()
    rng = np.random.default_rng(4)
    t, q, v = 0.0, np.array([0.0, 0.2, -0.2]), np.zeros(3)
    first = wall_guard.step(q, t)
    assert first.reason is Reason.NO_VELOCITY
    motion = wall_guard._motion
    widths = []
    for _ in range(400):
        a = rng.uniform(-8, 8, 3)
        for _ in range(10):
            before = v
            v = np.clip(v + a * PERIOD / 10, -1.0, 1.0)
            q = q + 0.5 * PERIOD / 10 * (before + v)
        t += PERIOD
        measured = q + rng.uniform(-1, 1, 3) * FIGURES["position_error"]
        wall_guard.step(measured, t, now=t)
        assert (motion.v_low <= v + 1e-9).all()
        assert (v <= motion.v_high + 1e-9).all()
        widths.append(motion.v_high - motion.v_low)
    assert np.median(widths) < 0.2


def test_a_robot_without_figures_is_refused_with_the_remedy():
    scene = Scene(mode="path")
    scene.add_robot(simple_arm(), name="arm")
    with pytest.raises(SceneError, match="stopping"):
        Guard(scene)


def test_what_is_proven_keeps_its_distance_whatever_happens():
    """Random states of the bay; admissible futures keep what the verdict promised."""
    scene = path_bay()
    scene._margin = 0.5
    guard = Guard(scene)
    ruler = bay_scene()
    ruler._margin = 1.0
    measure = Guard(ruler)
    rng = np.random.default_rng(9)
    f = FIGURES
    free = f["command"] + PERIOD
    least, proven = np.inf, 0
    assert list(guard.tables.labels) == list(measure.tables.labels)
    for _ in range(120):
        q = guard.home + rng.uniform(-0.7, 0.7, 14)
        q = np.clip(q, guard.tables.lower, guard.tables.upper)
        v = rng.uniform(-1, 1, 14) * rng.choice([0.2, 0.6, 1.2])
        guard.reset()
        guard._watch.phase[:] = RUNNING
        verdict = guard.step(q, 1.0, velocity=v, now=1.0)
        if verdict.reason >= Reason.NOT_FINITE:
            continue
        # What each pair of primitives must keep; NaN where nothing is promised.
        near = verdict._answer.near
        near = near[near["headroom"] >= 0.0]
        promised = np.full(2 * [len(guard.tables.labels)], np.nan)
        promised[pairs_of(near)] = near["buffer"] + near["headroom"]
        for _ in range(12):
            for row in future(rng, q, v, free):
                near = measure.judge_at_rest(row)._answer.near
                spare = near["outer"] - promised[pairs_of(near)]
                spare = spare[~np.isnan(spare)]
                proven += len(spare)
                least = min(least, spare.min(initial=np.inf))
    assert proven > 1000
    assert least >= -1e-9


def future(rng, q, v, free):
    """Joint positions of an admissible continuation, a few moments of it."""
    f = FIGURES
    x = q + rng.uniform(-1, 1, 14) * f["position_error"]
    speed = np.clip(v + rng.uniform(-1, 1, 14) * f["velocity_error"], -1.5, 1.5)
    push = rng.choice([-1.0, 0.0, 1.0], 14) * f["acceleration"]
    brake = rng.choice([f["deceleration"], f["deceleration_most"]], 14)
    dt = 5e-4
    rows = np.zeros((252, len(x)))
    driven = round(free / dt)
    count = write_moments(x, speed, push, brake, f["ramp"], driven, dt, rows)
    return rows[:count]


@kernel(entry=True)
def write_moments(x, speed, push, brake, ramp, driven, dt, rows):
    """Every fortieth position of joints that are driven for some steps, then stop."""
    count = 0
    for k in range(10_000):
        share, moving = min((k - driven + 0.5) * dt / ramp, 1.0), False
        for j in range(len(x)):
            before = speed[j]
            if k < driven:
                speed[j] = min(max(before + push[j] * dt, -1.5), 1.5)
            else:
                less = max(abs(before) - brake[j] * share * dt, 0.0)
                speed[j] = less if before > 0.0 else -less
            moving = moving or speed[j] != 0.0
            x[j] += 0.5 * dt * (before + speed[j])
        if k >= driven and not moving:
            break
        for j in range(len(x)):
            rows[count, j] = x[j]
            # The next row is the last one, unless another moment follows.
            rows[count + 1, j] = x[j]
        if k % 40 == 39:
            count += 1
    return count + 1


def pairs_of(near):
    """Primitives of near pairs, as indices of a matrix."""
    return near["first"].astype(int), near["second"].astype(int)


def test_a_box_before_the_arm_is_not_there_for_the_past(wall_guard):
    """What is appended to the scene after the guard was made does not concern it."""
    scene = arm_scene()
    guard = Guard(scene)
    scene.add(Box(size=(0.2, 0.2, 0.2)), name="late")
    wall_guard.reset()
    q, v = np.array([0.1, 0.0, 0.0]), np.zeros(3)
    one, other = guard.step(q, 1.0, velocity=v), wall_guard.step(q, 1.0, velocity=v)
    assert one.tobytes() == other.tobytes()
