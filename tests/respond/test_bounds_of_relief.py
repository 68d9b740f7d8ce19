"""How far a robot that leaves is relieved: by where it began, and by what comes itself.

A ball on a slide and one in its way: all that is near is on one line.
"""

from contextlib import suppress

import numpy as np
import pytest

from armguard.geometry import Pose, Sphere
from armguard.guard import Level, Reason
from armguard.guard.objects import SightingError
from armguard.guard.proofs import prove_pair
from armguard.guard.relief import SINK, is_driven_nearer, relief_of
from armguard.guard.watch import RECOVERING, RESTING, RUNNING
from armguard.guard.workspace import open_workspace
from armguard.kernel import kernel
from armguard.motion.pair_state import PROVEN, UNPROVEN
from armguard.motion.state import NEXT
from armguard.respond import Action, Blocked, Changed, Guard
from armguard.respond.leaving import lead_away
from armguard.respond.state import open_response
from armguard.scene import Scene
from sliding import APART, EXACT, RADIUS, at_gap, slide, slides

# Greatest speed of the ball [m/s], error of tracking of a slide [m/s].
COMES, MISSES = 0.2, 0.1

# Distance that the scene requires at rest [m].
FLOOR = 0.005

PERIOD = 0.001


@kernel(entry=True)
def relief_at(spare, floor, lines):
    """What is taken off the need of the first near pair [m]."""
    w = open_workspace(lines)
    v, m = w.watch, w.motion
    return relief_of(0, 1, w.near[0], spare, floor, w, v, m)


@kernel(entry=True)
def driven_nearer(r, lines):
    """Whether a robot is driven nearer to the other side of the first near pair."""
    w = open_workspace(lines)
    return is_driven_nearer(r, 0, 1, w.near[0], w)


def looked_at(*figures, mover=None):
    """A guard after a cycle in which slides rest, and the address of its tables."""
    guard = slides(*figures, mover=mover, buffer=FLOOR, period=PERIOD)
    if mover:
        guard.place("ball", Pose(xyz=(APART, 0.0, 0.0)), 0.0)
    still = np.zeros(len(figures))
    command = guard.filter(
        at_gap(0.1, len(figures)), still, 0.0, velocity=still, now=0.0
    )
    assert command.verdict.nearest.distance == pytest.approx(0.1)
    guard._watch.phase[0] = RECOVERING
    return guard, guard._lines.ctypes.data


def leaving(guard, speed=1.0):
    """Have the first slide lead away at a speed [m/s]."""
    guard._watch.wanted[0] = -speed


@pytest.mark.parametrize("comes", [0.0, COMES])
def test_relief_ends_where_the_recovery_began_and_an_object_can_be(comes):
    guard, lines = looked_at({}, mover={"top_speed": comes} if comes else None)
    leaving(guard)
    watch = guard._watch
    watch.relief[0] = 0.02
    watch.relief_until[0] = 1e3
    # Far more lacks than did when it began.
    assert relief_at(-0.5, FLOOR, lines) == pytest.approx(0.02 + SINK, abs=1e-12)
    # Until then the way of what comes was counted; what it goes on for is added.
    watch.relief_until[0] = -1.0
    earlier = relief_at(-0.5, FLOOR, lines)
    watch.relief_until[0] = -1.1
    later = relief_at(-0.5, FLOOR, lines)
    assert later - earlier == pytest.approx(0.1 * comes, abs=1e-12)
    assert earlier >= 0.02 + SINK + 1.0 * comes


def test_what_surely_does_not_touch_gives_up_its_floor_and_no_more():
    guard, lines = looked_at({})
    leaving(guard)
    guard._watch.relief[0] = 0.1
    for spare in (-0.97 * FLOOR, -FLOOR + 1e-6):
        assert relief_at(spare, FLOOR, lines) == min(SINK - spare, FLOOR)
    assert relief_at(-FLOOR - 1e-6, FLOOR, lines) == SINK + FLOOR + 1e-6


@pytest.mark.parametrize(("part", "touches"), [(0.97, True), (1.03, False)])
def test_errors_along_the_normal_decide_whether_a_pair_surely_does_not_touch(
    part, touches
):
    error, along, distance = 0.01, 0.6, 0.1
    scene = Scene(buffer=FLOOR, margin=1.0, period=PERIOD)
    figures = {**EXACT, "position_error": error}
    scene.add_robot(slide(), name="left", stopping=figures, response="deflect")
    apart = 2.0 * RADIUS + distance
    # The ball is at the side: of a joint's error only a part brings it nearer.
    pose = Pose(xyz=(along * apart, np.sqrt(1.0 - along**2) * apart, 0.0))
    scene.add(Sphere(radius=RADIUS), name="ball", pose=pose)
    guard = Guard(scene, self_test=False)
    still = np.zeros(1)
    command = guard.filter(still, still, 0.0, velocity=still, now=0.0)
    assert command.verdict.nearest.distance == pytest.approx(distance)
    watch = guard._watch
    watch.phase[0], watch.relief[0] = RECOVERING, 0.1
    leaving(guard)
    spare = part * along * error - FLOOR
    relief = relief_at(spare, FLOOR, guard._lines.ctypes.data)
    assert relief == pytest.approx(error - spare + SINK if touches else FLOOR)


def test_a_pair_that_may_touch_already_needs_no_distance_below_zero():
    figures = {"position_error": 0.02, "acceleration": 8.0}
    guard = slides(figures, buffer=FLOOR, period=PERIOD)
    for k in range(40):
        now = k * PERIOD
        command = guard.filter(at_gap(6e-4), [-0.3], now, velocity=[0.0], now=now)
    assert command.verdict.level is Level.RECOVER
    assert command.velocity[0] < 0.0
    assert command.verdict.nearest.why == (
        "left/ball 1 mm from ball: too close, but opening"
    )


def test_relief_needs_commands_and_a_motion_that_is_under_way():
    for commanded, segment in ((1.0, 0), (0.0, 0), (1.0, 1)):
        guard, lines = looked_at({})
        leaving(guard)
        guard._watch.relief[0] = 0.1
        guard._watch.given.commanded = commanded
        guard._motion.span.segment = segment
        relieved = relief_at(-0.02, FLOOR, lines) > 0.0
        assert relieved == (commanded != 0.0 and segment == 0)


@pytest.mark.parametrize(("speed", "surely"), [(0.97, False), (1.03, True)])
def test_relief_needs_a_command_that_opens_whatever_the_drive_misses(speed, surely):
    guard, lines = looked_at({"tracking_error": MISSES})
    guard._watch.relief[0] = 0.1
    leaving(guard, speed * MISSES)
    assert (relief_at(-0.02, FLOOR, lines) > 0.0) == surely


@pytest.mark.parametrize(("speed", "surely"), [(0.97, False), (1.03, True)])
def test_what_the_other_drive_misses_counts_while_it_is_driven(speed, surely):
    guard, lines = looked_at({"tracking_error": MISSES}, {"tracking_error": MISSES})
    watch = guard._watch
    watch.relief[0] = 0.1
    watch.under_way[:] = 0.0
    watch.phase[1] = RUNNING
    leaving(guard, speed * 2.0 * MISSES)
    assert (relief_at(-0.02, FLOOR, lines) > 0.0) == surely
    watch.phase[1] = RESTING
    leaving(guard, speed * MISSES)
    assert (relief_at(-0.02, FLOOR, lines) > 0.0) == surely


@pytest.mark.parametrize(
    ("low", "high", "wanted", "nearer"),
    [
        (0.0, 0.0, 0.0, False),
        (0.0, 0.2, 0.1, False),
        (-1e-6, 0.2, 0.1, True),
        (0.0, 0.2, -1e-6, True),
        (0.1, 0.2, -1e-6, True),
        (-0.2, -0.1, 1e-6, True),
        (0.1, 0.2, 1e-6, False),
    ],
)
def test_the_other_robot_must_not_be_driven_nearer(low, high, wanted, nearer):
    # The second slide comes nearer with negative velocities.
    guard, lines = looked_at({}, {})
    watch = guard._watch
    watch.relief[0] = 0.1
    leaving(guard)
    watch.phase[1] = RUNNING
    watch.under_way[1] = low, high
    watch.wanted[1] = wanted
    assert driven_nearer(1, lines) == nearer
    assert (relief_at(-0.02, FLOOR, lines) == 0.0) == nearer
    # The first one, the other way round.
    watch.under_way[0] = -high, -low
    watch.wanted[0] = -wanted
    assert driven_nearer(0, lines) == nearer


@kernel(entry=True)
def proven(lines):
    """How the first near pair is proven, and what it has left [m]."""
    w = open_workspace(lines)
    return prove_pair(0, 1, NEXT, NEXT, w.near[0], w)


@pytest.mark.parametrize("spare", [-1e-4, 1e-4])
def test_of_what_is_evaded_no_more_is_proven_than_that_it_is_far_enough(spare):
    """As far as it may come until the slide rests, which has two cycles of reserve."""
    guard = slides(
        {"settle_time": 0.5}, mover={"top_speed": COMES}, buffer=FLOOR, period=PERIOD
    )
    gap, still = FLOOR + COMES * (0.5 + 2.0 * PERIOD) + spare, np.zeros(1)
    guard.place("ball", Pose(xyz=(APART, 0.0, 0.0)), 0.0)
    guard.filter(at_gap(gap), still, 0.0, velocity=still, now=0.0)
    watch = guard._watch
    watch.phase[0], watch.evaded[1], watch.relieved[0] = RECOVERING, 1, 0
    proof, left = proven(guard._lines.ctypes.data)
    assert left == pytest.approx(spare, abs=1e-6)
    assert proof == (PROVEN if spare > 0.0 else UNPROVEN)
    assert watch.relieved[0] == (spare < 0.0)


@kernel(entry=True)
def leads_away(response, lines):
    """Whether what the first robot is to be commanded leads away for certain."""
    w = open_workspace(lines)
    v, m = w.watch, w.motion
    return lead_away(0, open_response(response), w, v, m)


@pytest.mark.parametrize(("share", "at_once"), [(0.985, True), (1.015, False)])
@pytest.mark.parametrize("asks", [False, True])
def test_a_robot_without_desired_motion_leaves_only_as_slowly_as_it_can_begin_to(
    share, at_once, asks
):
    """What surely leads away is a quarter more than what the drive may miss."""
    gain = 8.0 * PERIOD
    figures = {"acceleration": 8.0, "tracking_error": share * gain / 1.25}
    guard = slides(figures, buffer=FLOOR, period=PERIOD)
    still = np.zeros(1)
    guard.filter(at_gap(0.001), still, 0.0, velocity=still, now=0.0)
    answers = guard._response
    guard._watch.phase[0] = RESTING
    answers.low[0], answers.high[0], answers.target[0] = -1.0, 1.0, -0.5
    answers.notes[0].requests_motion = asks
    guard._watch.sent_count[0] = 0
    found = leads_away(guard._response_lines, guard._lines.ctypes.data)
    assert found == (at_once or asks)
    least = -max(gain, share * gain) if found else -0.5
    assert answers.target[0] == pytest.approx(least)


@pytest.mark.parametrize("comes", [0.0, COMES])
@pytest.mark.parametrize("share", [0.98, 1.02])
def test_a_robot_leaves_what_moves_by_itself_within_sixty_degrees(comes, share):
    """A slide moves along x; the direction to the ball is near 60 degrees from that."""
    mover = {"top_speed": comes} if comes else {}
    figures = {"acceleration": 8.0, "tracking_error": 1e-3}
    guard = slides(figures, mover=mover, buffer=FLOOR, period=PERIOD)
    start, still = np.array(at_gap(0.1)), np.zeros(1)
    cosine = 0.5 * share
    away = (2.0 * RADIUS + 0.001) * np.array([cosine, np.sqrt(1.0 - cosine**2)])
    guard.place("ball", Pose(xyz=(start[0] + away[0], away[1], 0.0)), 0.0)
    guard.filter(start, still, 0.0, velocity=still, now=0.0)
    guard._watch.phase[0] = RESTING
    answers = guard._response
    answers.low[0], answers.high[0], answers.target[0] = -1.0, 1.0, -0.5
    answers.notes[0].requests_motion = True
    found = leads_away(guard._response_lines, guard._lines.ctypes.data)
    assert found == (comes == 0.0 or share > 1.0)


class Beside:
    """A slide that rests, and a ball that may come at it by itself.

    Args:
        top_speed: Greatest speed of the ball as declared [m/s].
    """

    def __init__(self, top_speed=COMES):
        figures = {"settle_time": 0.5, "tracking_error": 1e-3}
        figures |= {"acceleration": 8.0, "position_error": 1e-6}
        mover = {"top_speed": top_speed} if top_speed else {}
        self.guard = slides(figures, mover=mover, buffer=FLOOR, period=PERIOD)
        self.mover = top_speed > 0.0
        self.t, self.ball = 0.0, APART
        self.x = np.array(at_gap(0.03 if self.mover else FLOOR - 1e-3))
        self.v = np.zeros(1)

    def cycle(self, asked, comes=0.0):
        """One cycle: the ball comes, the slide is asked, and follows its command."""
        self.ball -= comes * PERIOD
        if self.mover:
            # A sighting that cannot be true is refused, and the arm is stopped.
            with suppress(SightingError):
                self.guard.place("ball", Pose(xyz=(self.ball, 0.0, 0.0)), self.t)
        command = self.guard.filter(
            self.x, [asked], self.t, velocity=self.v, now=self.t
        )
        self.v = command.velocity.copy()
        self.x = self.x + self.v * PERIOD
        self.t += PERIOD
        return command


def test_nothing_is_proven_for_an_arm_that_leaves_what_comes_by_itself():
    loop = Beside()
    for _ in range(5):
        resting = loop.cycle(0.0)
    assert resting.blocked == {"left": Blocked.TOO_NEAR}
    assert resting.verdict.reason is Reason.RESTING and not resting.verdict.unproven
    out = loop.cycle(-0.05)
    (pair,) = out.verdict.unproven
    assert out.action is Action.FOLLOW and out.velocity[0] < 0.0
    assert out.verdict.level is Level.RECOVER
    assert out.verdict.reason is Reason.UNPROVEN
    assert pair.unproven and pair.headroom < -0.05
    assert "nothing is proven" in pair.why and "ball" in pair.why
    assert out.verdict.why == "left/ball 30 mm from ball: leaving, nothing is proven"
    assert "nothing is proven: left/ball leaves ball" in out.verdict.explain()
    assert out.verdict.to_dict()["near"][0]["unproven"] is True
    # It lets go: the slide is stopped, rests, and waits for who leads it away.
    let_go = loop.cycle(0.0)
    assert let_go.verdict.levels["left"] is Level.STOP
    assert let_go.verdict.reason is Reason.TOO_CLOSE
    for _ in range(700):
        rests = loop.cycle(0.0)
    assert rests.blocked == {"left": Blocked.TOO_NEAR} and not rests.verdict.unproven


def test_a_robot_that_leaves_a_stationary_body_is_proven():
    loop = Beside(top_speed=0.0)
    for _ in range(5):
        resting = loop.cycle(0.0)
    assert resting.blocked == {"left": Blocked.TOO_NEAR}
    out = loop.cycle(-0.05)
    assert out.action is Action.FOLLOW and out.velocity[0] < 0.0
    assert not out.verdict.unproven and out.verdict.reason is Reason.RESTING


@pytest.mark.parametrize(("share", "goes_on"), [(1.0, True), (1.5, False)])
def test_a_robot_approached_faster_than_declared_is_stopped(share, goes_on):
    loop = Beside()
    for _ in range(5):
        loop.cycle(0.0)
    # 30 ms: what comes too fast has then come 3 mm nearer than it can.
    actions = [loop.cycle(-1e-5, comes=share * COMES).action for _ in range(30)]
    assert (max(actions) is Action.FOLLOW) == goes_on


def test_a_robot_that_leaves_one_body_slows_down_before_another_one_by_itself():
    scene = Scene(buffer=FLOOR, margin=1.0, period=PERIOD)
    figures = {"acceleration": 8.0, "tracking_error": 1e-3, "command": 0.02}
    scene.add_robot(slide(), name="left", stopping={**EXACT, **figures})
    between = 0.02
    far = APART - 4.0 * RADIUS - (FLOOR - 2e-3) - between
    for name, x in (("ball", APART), ("behind", far)):
        scene.add(Sphere(radius=RADIUS), name=name, pose=Pose(xyz=(x, 0.0, 0.0)))
    guard = Guard(scene, self_test=False)
    x, v, fastest = np.array(at_gap(FLOOR - 2e-3)), np.zeros(1), 0.0
    for k in range(60):
        now = k * PERIOD
        command = guard.filter(x, [-0.5 * (k > 4)], now, velocity=v, now=now)
        v = command.velocity.copy()
        x = x + v * PERIOD
        fastest = max(fastest, -v[0])
        assert command.verdict.level is Level.RECOVER or k > 40
        # The proof has nothing to take back.
        assert Changed.PROOF not in command.changed["left"]
    assert 0.08 < fastest < 0.12
