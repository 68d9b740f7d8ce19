"""The light, the sentence and the cards of a message never contradict one another."""

from dataclasses import replace

import numpy as np
import pytest

from armguard import Guard, bay_scene
from armguard.guard import layout
from armguard.guard.layout import IN_HEADER, IN_ROBOT
from armguard.guard.levels import Level, Reason
from armguard.guard.watch import SLOW_TIME_DEFAULT
from armguard.recording.frames import Kind, frame_of
from armguard.recording.recorded import RecordedGuard
from armguard.recording.ring import RingReader, RingWriter
from armguard.respond import Action
from armguard.respond.command import Blocked
from armguard.view.drawables import pair_look, slow_time
from armguard.view.lateness import BUSY_SPAN, BUSY_STOPS, Lateness
from armguard.view.state_message import since, state_message
from armguard.view.world import World

CYCLES = 1000
REMARK = "the service was later than its period allows"


@pytest.fixture(scope="module")
def filtered(tmp_path_factory):
    """A world without a page, and the frame of a filtered cycle of the bay."""
    path = tmp_path_factory.mktemp("ring") / "ring"
    scene = bay_scene("path")
    scene.period = 0.01
    guard = Guard(scene, self_test=False)
    taped = RecordedGuard(guard, RingWriter(path))
    still = np.zeros_like(guard.home)
    for k in range(3):
        taped.filter(guard.home, still, 0.01 * k, velocity=still)
    frames = [frame_of(row) for row in RingReader(path).unread()]
    world = World(None, scene)
    return world, [frame for frame in frames if frame.kind is Kind.CYCLE][-1]


def random_cycle(world, frame, rng):
    """The cycle with a reason, levels, actions and waiting robots at random."""
    robots = len(world.names.robots)
    reasons, levels = list(Reason), list(Level)
    verdict, commanded = frame.verdict.copy(), frame.told.copy()
    verdict[IN_HEADER.reason] = reasons[rng.integers(len(reasons))]
    # How late a cycle was, or where a joint is: some number.
    verdict[IN_HEADER.value] = rng.uniform(0.01, 1.0)
    verdict[IN_HEADER.robot] = rng.integers(robots)
    quiet = rng.random() < 0.3
    if quiet:
        verdict[IN_HEADER.reason] = Reason.OK
    for k in range(robots):
        level = Level.CLEAR if quiet else levels[rng.integers(len(levels))]
        row = layout.HEADER + k * layout.ROBOT_WIDTH
        verdict[row + IN_ROBOT.level] = level
    if rng.random() < 0.3:
        # Since when each robot is held, and why: its last numbers of the command.
        is_held = rng.random(robots) < 0.5
        commanded[-2 * robots : -robots] = np.where(is_held, 1.0, np.nan)
        commanded[-4 * robots : -3 * robots] = np.where(is_held, Blocked.STOPPED, 0)
    return world.cycle(replace(frame, verdict=verdict, told=commanded))


def contradictions(cycle, message, remark, changed):
    """What a reader could find to disagree, by the words and colours alone."""
    verdict, why = cycle.verdict, message["why"]
    stopped = message["level"] >= Level.STOP
    own = cycle.verdict.reason
    cards = [card["shown"] for card in message["robots"]]
    held = bool(cycle.command.held)
    if message["level"] < max(*cards, verdict.level):
        yield "a card is more urgent than the light"
    if not why:
        yield "a light without a reason"
    if not stopped and (own.level >= Level.STOP or "HELD" in why or REMARK in why):
        yield "a reason of a stop beside a light below it"
    if stopped and own.level < Level.STOP and verdict.why in why.split("; "):
        yield "a reason below a stop beside a light that stops"
    causes = own.level >= Level.STOP, held, bool(remark)
    if stopped and any(causes) and why.endswith(": stopped"):
        yield "a stop without the cause that is known"
    if stopped and any("to a stop" in said for said in message["measures"]):
        yield "time that is left until a stop beside a stop"
    if message["name"] == "HELD" and not ("HELD" in why or "STOPPED BY" in why):
        yield "HELD without a word about it"
    if changed and "objects were changed" not in why:
        yield "changed objects are not mentioned"
    for card, name in zip(message["robots"], verdict.levels, strict=True):
        rests = verdict.levels[name] >= Level.STOP or remark
        if rests and card["word"].startswith("follows"):
            yield "a card follows while its robot is stopped"
        if card["shown"] >= Level.STOP and card["blocked"].startswith("nothing within"):
            yield "a card says that nothing is near beside a stop"
    full = message["explanation"]
    if not (full.startswith(message["why"]) and full.endswith(cycle.verdict.explain())):
        yield "the explanation is of another cycle"


def test_light_and_words_never_disagree_in_a_thousand_random_cycles(filtered):
    world, frame = filtered
    rng = np.random.default_rng(23)
    seen = set()
    for k in range(CYCLES):
        cycle = random_cycle(world, frame, rng)
        remark = REMARK if rng.random() < 0.2 else ""
        changed = bool(rng.random() < 0.2)
        message = state_message(cycle, 0.0, remark=remark, changed=changed)
        found = list(contradictions(cycle, message, remark, changed))
        if not remark and not changed and message["level"] != cycle.level:
            found.append("the plot has another level than the light")
        assert not found, (k, found, message)
        seen.add(message["name"])
    # Every light was shown, or the cycles were not random enough.
    assert seen == {"HELD", *(level.name for level in Level)}


def test_the_cases_that_newcomers_stumbled_over(filtered):
    world, frame = filtered
    cycle = world.cycle(frame)
    assert cycle.verdict.reason in (Reason.OK, Reason.NEAR)
    stopped = state_message(cycle, 0.0, remark=REMARK)
    assert (stopped["word"], stopped["why"]) == ("STOP", REMARK)
    assert [card["word"] for card in stopped["robots"]] == ["stop", "stop"]
    actions = cycle.command.actions.values()
    assert set(actions) <= {Action.FOLLOW, Action.HOLD, Action.STOP}


def test_a_robot_that_is_still_stopping_says_why(filtered):
    world, frame = filtered
    verdict = frame.verdict.copy()
    verdict[IN_HEADER.reason] = Reason.STOPPING
    verdict[layout.HEADER + IN_ROBOT.level] = Level.STOP
    verdict[layout.HEADER + IN_ROBOT.cause] = Reason.TOO_CLOSE
    message = state_message(world.cycle(replace(frame, verdict=verdict)), 0.0)
    assert "still stopping" in message["why"]
    assert message["why"].endswith(f" ({Reason.TOO_CLOSE.sentence})")


def test_a_joint_outside_its_limits_is_named_with_the_way_back(filtered):
    world, frame = filtered
    verdict, commanded, robots = frame.verdict.copy(), frame.told.copy(), 2
    verdict[IN_HEADER.reason], verdict[IN_HEADER.joint] = (
        Reason.OUT_OF_LIMITS,
        3,
    )
    verdict[IN_HEADER.value] = 2.11
    for k in range(robots):
        row = layout.HEADER + k * layout.ROBOT_WIDTH
        verdict[row + IN_ROBOT.cause] = Reason.OUT_OF_LIMITS
        verdict[row + IN_ROBOT.level] = Level.STOP
    commanded[-2 * robots : -robots] = 0.0
    commanded[-4 * robots : -3 * robots] = Blocked.STOPPED
    cycle = world.cycle(replace(frame, verdict=verdict, told=commanded))
    message = state_message(cycle, 0.0)
    assert message["word"] == "HELD"
    joint = world.tables.q_names[3]
    assert message["why"] == (
        f"HELD since {since(cycle, cycle.command.held['left'])}: joint '{joint}' is at "
        "2.1100: stop, its limits are [-2.1000, 2.1000]; move the joint back inside "
        "by hand or with the robot's own controller, or check units and order"
        " – then press Engage all"
    )


def test_a_machine_is_busy_after_three_stops_by_lateness_and_not_for_ever(filtered):
    _, frame = filtered
    now = [0.0]
    lateness = Lateness(clock=lambda: now[0])
    late = frame.verdict.copy()
    late[IN_HEADER.reason] = Reason.CYCLE_LATE
    for _ in range(BUSY_STOPS):
        assert not lateness.busy
        now[0] += 1.0
        # However many cycles a stop lasts, it counts once.
        for _ in range(5):
            lateness.add(replace(frame, verdict=late))
        lateness.add(frame)
    assert lateness.busy
    now[0] += BUSY_SPAN
    assert not lateness.busy


def test_the_label_of_the_pair_that_slows_an_arm_says_so(filtered, tmp_path):
    """Also above the time below which an arm becomes slow: it stays slow for longer."""
    world, _ = filtered
    scene = bay_scene("path")
    scene.period = 0.01
    scene.set_response("slow")
    guard = Guard(scene, self_test=False)
    taped = RecordedGuard(guard, RingWriter(tmp_path / "ring"))
    reader = RingReader(tmp_path / "ring")
    signs = {"left/joint1": -0.3, "right/joint1": 0.3}
    desired = np.array([signs.get(name, 0.0) for name in guard.q_names])
    q, v, left = guard.home, 0.0 * desired, []
    for k in range(800):
        v = taped.filter(q, desired, 0.01 * k, velocity=v).velocity
        q = q + 0.01 * v
        desired *= 0.92 if left else 1.0
        for frame in map(frame_of, reader.unread()):
            cycle = world.cycle(frame)
            if cycle.verdict.reason is Reason.SHORT_TIME:
                pair = min(cycle.pairs, key=lambda pair: pair.time_left)
                assert cycle.verdict.level is Level.SLOW
                assert pair_look(pair, slow_time(cycle))[1] == "SLOW"
                left.append(pair.time_left)
    assert min(left) < SLOW_TIME_DEFAULT < max(left)
