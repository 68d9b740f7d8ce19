"""More bounds of answers: declared stops, shares of speeds, threats, exact shapes."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from approach import FIGURES, PERIOD
from armguard.geometry import Capsule, Pose, Sphere
from armguard.guard.grips import ContractRow, ContractState
from armguard.guard.proofs import describe_pair, look_at_exact, prove_exact
from armguard.guard.watch import RESTING, RUNNING, Given, LastCycle, Timing
from armguard.guard.workspace import Settings, open_workspace
from armguard.kernel import kernel
from armguard.motion.figures import JointFigures, RobotFigures
from armguard.motion.pair_state import new_pair
from armguard.motion.state import NEXT, PLANS, StopClock
from armguard.record import records
from armguard.respond import Action, Blocked, Guard
from armguard.respond import state as places
from armguard.respond.joint_bounds import frame_limits
from armguard.respond.lead_state import LeadNotes
from armguard.respond.straight import reaches_anything
from armguard.robot.model import CollisionElement, MeshFile
from armguard.scene import Scene
from armguard.scene.settings import ResponseSettings
from arms import simple_arm
from driven import Driven, ball_guard
from planar import chain, chain_guard
from records import record
from sliding import EXACT

JOINTS, DT = 3, 0.004


@kernel(entry=True)
def frame(a, w, v, m):
    frame_limits(0, True, a, w, v, m)


def framed(commanded, requested, share=1.0, scales=1, acceleration=20.0):
    """Limits, target and declared stop of a robot in the middle of its range."""
    joint_figures = records(JOINTS, JointFigures)
    joint_figures.velocity = 2.0, 1.0, 0.5
    joint_figures.acceleration = acceleration
    joint_figures.deceleration = 2.0, 4.0, 6.0
    robot_figures = records(1, RobotFigures)
    robot_figures[0].joint_count = JOINTS
    settings = records(1, places.Behaviour)
    settings.scales = scales
    given, timing = records(1, Given)[0], records(1, Timing)[0]
    given.now, timing.period, timing.late = 5.0, 0.01, 0.0
    a = record(
        requested=np.array(requested),
        target=np.zeros(JOINTS),
        low=np.zeros(JOINTS),
        high=np.zeros(JOINTS),
        brake=np.zeros(JOINTS),
        speed=np.array([share]),
        notes=records(1, places.RobotNotes),
        settings=settings,
        lead=record(notes=records(1, LeadNotes)),
    )
    w = record(lower=np.full(JOINTS, -9.0), upper=np.full(JOINTS, 9.0))
    v = record(
        phase=np.array([RUNNING]),
        evades=np.zeros(1, dtype=np.int64),
        commanded=np.array(commanded),
        commanded_at=np.array([5.0 - DT]),
        sent_count=np.array([3]),
        given=given,
        timing=timing,
        stamps=np.array([5.0]),
        last=records(1, LastCycle)[0],
    )
    m = record(
        q=np.zeros(JOINTS),
        joint_figures=joint_figures,
        robot_figures=robot_figures,
        robot_of_joint=np.zeros(JOINTS, dtype=np.int32),
        clock=records(PLANS, StopClock),
    )
    frame(a, w, v, m)
    return a


@pytest.mark.parametrize("signs", [(1, 1, 1), (-1, 1, 1), (1, -1, 1), (-1, -1, -1)])
@pytest.mark.parametrize("slowest", range(JOINTS))
def test_a_robot_that_keeps_its_path_brakes_all_joints_by_one_share(signs, slowest):
    # One joint needs most cycles to rest: all of them brake as slowly as it does.
    cycles = np.full(JOINTS, 5.0)
    cycles[slowest] = 20.0
    last = cycles * np.array([2.0, 4.0, 6.0]) * DT * signs
    a = framed(last, last)
    assert a.brake == pytest.approx(last * (1.0 - 1.0 / 20.0))
    # A robot that may leave its path brakes each joint by itself.
    alone = framed(last, last, scales=0)
    assert alone.brake == pytest.approx(last * (1.0 - 1.0 / cycles))


@pytest.mark.parametrize("share", [0.1, 0.5, 1.0])
def test_a_robot_with_a_share_of_its_top_speeds_has_no_more_in_any_direction(share):
    top = share * np.array([2.0, 1.0, 0.5])
    a = framed(np.zeros(JOINTS), np.zeros(JOINTS), share=share, acceleration=1e4)
    assert a.high == pytest.approx(top)
    assert a.low == pytest.approx(-top)


def test_a_robot_that_stops_is_slowed_by_no_proof_unless_it_retreats():
    guard = ball_guard(response="stop")
    loop = Driven(guard)
    loop.run([0.5], 100)
    assert guard._watch.yields[0] == 0
    # It goes on towards the ball until it is stopped, never slower before.
    while loop.cycle([0.5]).action < Action.STOP:
        assert loop.commands[-1].velocity[0] == pytest.approx(0.5)
        assert len(loop.commands) < 5000
    loop.run([0.0], 600)
    guard.retreat()
    command = loop.run([0.0], 20)
    assert command.blocked["arm"] is Blocked.RETREATING
    assert guard._watch.yields[0] == 1


# Thickness of an arm and a cart, the gap at which the cart is near [m], and its speed.
THICK, NEARBY, COMES = 0.04 + 0.1, 0.005 + 0.03, 0.4


@pytest.mark.parametrize("share", [0.55, 0.8, 0.95, 1.05])
def test_ways_are_sought_from_twice_the_evade_time_on(share):
    evade_time = 0.5
    scene = Scene(mode="path")
    scene.add_robot(
        simple_arm(joints=2, length=0.5),
        name="arm",
        stopping=FIGURES,
        response=ResponseSettings(evade=True, evade_time=evade_time),
        home={"joint1": 0.0, "joint2": 0.0},
    )
    scene.add(
        Capsule(start=(0.0, 0.0, -0.3), end=(0.0, 0.0, 0.3), radius=0.1),
        name="cart",
        pose=Pose(xyz=(0.0, 5.0, 0.3)),
        top_speed=0.6,
    )
    guard = Guard(scene, self_test=False)
    # It is near the arm after this share of twice the time.
    y = THICK + NEARBY + COMES * share * 2.0 * evade_time
    guard.place("cart", Pose(xyz=(0.9, y, 0.3)), 0.0, velocity=(0.0, -COMES, 0.0))
    still = np.zeros(2)
    command = guard.filter(still, still, 0.0, velocity=still, now=0.0)
    assert command.blocked["arm"] is not Blocked.EVADING
    assert guard._escape.plan.approaching_count == 1
    notes = guard._escape.notes[0]
    sought = notes.best_candidate != 0 or notes.next_candidate != 0
    assert sought == (share < 1.0)


def test_desired_motion_past_a_body_does_not_lead_away():
    # Its tip is on a line with the ball, and the second joint moves it across that.
    guard = chain_guard(("slide", "turn"), (1.3, 0.0), {**EXACT, "acceleration": 5.0})
    q, cycle = np.zeros(2), iter(range(10_000))

    def ask(desired, count):
        """Some cycles at rest; the reasons it does not follow."""
        blocked = []
        for _ in range(count):
            now = 5.0 + PERIOD * next(cycle)
            command = guard.filter(q, np.array(desired), now, velocity=0.0 * q, now=now)
            blocked.append(command.blocked["arm"])
        return set(blocked)

    ask((0.0, 0.0), 20)
    ask((np.nan, 0.0), 1)
    ask((0.0, 0.2), 100)
    assert guard._watch.phase[0] in (RESTING, RUNNING)
    assert ask((0.0, 0.2), 100) == {Blocked.STOPPED}
    assert ask((0.2, 0.0), 100) == {Blocked.STOPPED}
    # Away from the ball it is followed from the second cycle on.
    ask((-0.2, 0.0), 1)
    assert ask((-0.2, 0.0), 1) == {Blocked.NOT}


# A pointed tip by its corners, in the frame of the second link [m].
TIP = np.array([(0.2, -0.05, -0.05), (0.4, 0, 0), (0.2, 0.05, -0.05), (0.2, 0, 0.1)])


@pytest.fixture(scope="module")
def turning(tmp_path_factory):
    """A guard of two joints that turn a pointed mesh, and of a ball."""
    path = tmp_path_factory.mktemp("tip") / "tip.stl"
    trimesh.convex.convex_hull(TIP).export(path)
    element = CollisionElement(geometry=MeshFile(path=path), T_link_geometry=np.eye(4))
    model = chain(("turn", "turn"))
    link = replace(model.links["link1"], collisions=(element,))
    scene = Scene(buffer=0.0, margin=1.0)
    scene.add_robot(
        replace(model, links={**model.links, "link1": link}),
        name="arm",
        stopping=EXACT,
    )
    scene.add(Sphere(radius=0.05), name="ball", pose=Pose(xyz=(1.2, 0.5, 0.0)))
    return Guard(scene, self_test=False)


@kernel(entry=True)
def exact_left(i, j, need, lines):
    """What exact shapes have left, looked at once and by the proof [m]."""
    w = open_workspace(lines)
    m, pair = w.motion, new_pair()
    pair.need, pair.drift = need, 0.0
    describe_pair(i, j, NEXT, NEXT, w, m, pair)
    once = look_at_exact(i, j, w, pair)
    describe_pair(i, j, NEXT, NEXT, w, m, pair)
    return once, prove_exact(i, j, w, pair)[1]


def test_a_look_at_exact_shapes_that_turn_grants_what_the_proof_of_the_path_does(
    turning,
):
    rng = np.random.default_rng(4)
    moving, lines = turning.tables.moving_count, turning._lines.ctypes.data
    for _ in range(20):
        turning.reset()
        q, v = rng.uniform(-0.4, 0.4, 2), rng.uniform(-1.5, 1.5, 2)
        turning.step(q, 5.0, velocity=v, now=5.0)
        once, proven = exact_left(0, moving, 0.0, lines)
        assert once > 0.0
        # With much left the proof does not halve the path.
        assert once == pytest.approx(proven, abs=1e-12)
        # A pair that needs all of it and a little more is not granted anything.
        assert exact_left(0, moving, once + 1e-6, lines)[0] == -np.inf


@kernel(entry=True)
def reaches(w):
    return reaches_anything(w)


@pytest.mark.parametrize("state", [ContractState.NONE, ContractState.IN_FORCE])
@pytest.mark.parametrize("enabled", [0, 1])
def test_a_contract_in_force_counts_where_intents_are_read(enabled, state):
    """The self-test reads none: its approaches are not those of an operator."""
    settings = records(1, Settings)[0]
    settings.intents = enabled
    contracts = records(3, ContractRow)
    contracts[2].state = state
    w = record(settings=settings, grips=record(contracts=contracts))
    assert reaches(w) == (enabled == 1 and state == ContractState.IN_FORCE)
