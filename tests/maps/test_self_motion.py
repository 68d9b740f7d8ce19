"""Alternatives of a redundant arm: its tool by Pinocchio, limits, waits, refusals."""

import numpy as np
import pinocchio as pin
import pytest

import armguard as ag
from armguard.maps.cell_plan import CellPlan, CoordinationError
from armguard.maps.line_cell import Job, LineCell, LinePlan
from armguard.maps.online import GAIN, Line
from armguard.maps.self_motion import POSITION, ROTATION, SelfMotion
from armguard.scene import compile_scene
from crossing import cell_of, headroom, plan_through
from verifying.plans import World

# Axis of each joint, length of its link, and where on that a sphere is, with its
# radius; 0 for none [m].
JOINTS = [
    ("0 0 1", 0.30, 0.30, 0.0),
    ("0 1 0", 0.0, 0.0, 0.0),
    ("0 0 1", 0.35, 0.175, 0.06),
    ("0 1 0", 0.0, 0.0, 0.10),
    ("0 0 1", 0.30, 0.15, 0.05),
    ("0 1 0", 0.0, 0.0, 0.05),
    ("0 0 1", 0.12, 0.12, 0.04),
]
HOME = [0.0, -0.6, 0.0, 1.9, 0.0, 0.8, 0.0]

# Radius of the elbow, and of balls beside it; distance that links keep [m].
ELBOW, BALL, BUFFER = 0.1, 0.01, 0.01

# Bases are so far apart [m]; plans take so long from one row to the next [s].
APART, STEP = 0.7, 1.5

CYCLE = 0.01

# Rows of both arms, whose elbows come near each other [rad].
LEFT = [
    [-0.46, 0.55, -1.33, 1.04, 0.19, 0.95, 0.0],
    [-0.34, 0.37, -0.31, 1.51, -0.39, 0.38, 0.0],
    [-0.42, 0.22, 1.36, 1.22, -0.29, 0.84, 0.0],
]
RIGHT = [
    [0.50, 0.29, -1.08, 1.26, 0.03, 0.68, 0.0],
    [0.29, 0.42, -0.42, 1.19, 0.12, 0.49, 0.0],
    [0.31, 0.46, -0.59, 1.23, -0.26, 0.48, 0.0],
]

# Figures of the arms' stops, the fastest a joint may turn [rad/s], and the greatest
# acceleration [rad/s²].
FASTEST, SHARPEST = 2.0, 12.0
FIGURES = {
    "velocity": FASTEST,
    "acceleration": SHARPEST,
    "deceleration": 6.0,
    "delays": {"command": 0.01},
}


def arm():
    """URDF of an arm of seven joints."""
    parts, above, far = ['<robot name="r"><link name="base"/>'], "base", 0.0
    for k, (axis, length, at, radius) in enumerate(JOINTS, 1):
        shape = (
            f'<collision><origin xyz="0 0 {at}"/><geometry><sphere radius="{radius}"/>'
            "</geometry></collision>"
        )
        parts.append(
            f'<link name="l{k}">{shape if radius else ""}</link>'
            f'<joint name="j{k}" type="revolute"><parent link="{above}"/>'
            f'<child link="l{k}"/><origin xyz="0 0 {far}"/><axis xyz="{axis}"/>'
            '<limit lower="-2.9" upper="2.9" effort="1" velocity="2"/></joint>'
        )
        above, far = f"l{k}", length
    return "".join(parts) + "</robot>"


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    file = tmp_path_factory.mktemp("arm") / "arm.urdf"
    file.write_text(arm())
    return file


@pytest.fixture(scope="module")
def scene(file):
    return scene_of(file)


def scene_of(file):
    """Both arms."""
    made = ag.Scene(mode="fixed", buffer=BUFFER)
    home = {f"j{k}": q for k, q in enumerate(HOME, 1)}
    for name, side in (("left", 0.5), ("right", -0.5)):
        base = ag.Pose(xyz=(0.0, side * APART, 0.0))
        made.add_robot(file, name=name, base=base, home=home, stopping=FIGURES)
    return made


def reaching(scene, robot, rows, interpolation="cubic"):
    """A plan through some rows, from and to home."""
    rows = np.vstack((HOME, rows, HOME))
    names = tuple(f"{robot}/j{k}" for k in range(1, 8))
    motion = ag.Trajectory(names, rows, STEP * np.arange(len(rows)), robot)
    kind = {"interpolation": interpolation, "hold_home": True}
    return CellPlan(ag.Plan.of(motion, scene, **kind), 0.005, 0.01)


@pytest.fixture(scope="module")
def known(scene):
    plans = {
        "left": LinePlan("left", reaching(scene, "left", LEFT)),
        "right": LinePlan("right", reaching(scene, "right", RIGHT), alternatives=2),
    }
    return LineCell.of(scene, plans)


def tools(rows):
    """Poses of an arm's tool by Pinocchio."""
    model = pin.buildModelFromXML(arm())
    data, frame = model.createData(), model.getFrameId("l7")
    found = []
    for q in rows:
        pin.framesForwardKinematics(model, data, q)
        found.append(data.oMf[frame].copy())
    return found


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_the_tool_of_an_alternative_keeps_its_pose_and_the_elbow_does_not(
    scene, interpolation
):
    plan = reaching(scene, "right", RIGHT, interpolation).plan.tube
    found = list(SelfMotion(compile_scene(scene), "right", plan).tubes())
    assert found
    times = np.linspace(*plan.times[[0, -1]], 701)
    before = plan.at(times)[:, 7:]
    for tube in found:
        rows = tube.at(times)
        np.testing.assert_allclose(rows[:, :7], plan.at(times)[:, :7], atol=1e-12)
        np.testing.assert_allclose(rows[[0, -1], 7:], before[[0, -1]], atol=1e-12)
        for one, other in zip(tools(before), tools(rows[:, 7:]), strict=True):
            off = one.actInv(other)
            assert np.linalg.norm(off.translation) <= POSITION
            assert np.linalg.norm(pin.log3(off.rotation)) <= ROTATION
        assert np.linalg.norm(rows[:, 7:] - before, axis=1).max() > 0.25
        rates = np.diff(rows, axis=0) / np.diff(times)[0]
        assert np.abs(rates).max() <= FASTEST
        assert np.abs(rows).max() <= 2.9
        if interpolation == "cubic":
            assert np.abs(np.diff(rates, axis=0)).max() <= SHARPEST * np.diff(times)[0]
            # No velocity jumps, also where the plan's curves meet.
            after, soon = tube.times[1:-1], np.diff(times)[0] / 1000.0
            here = tube.at(after)
            jumps = (tube.at(after + soon) - 2.0 * here + tube.at(after - soon)) / soon
            assert np.abs(jumps).max() <= 1.01 * SHARPEST * soon


def run(line, delay=0.0, seconds=60.0):
    """Execute a job of each arm: rows, what was decided, and cycles with a yield."""
    rows, events, yields = [], [], 0
    for k in range(int(seconds / CYCLE)):
        if k == 0:
            line.add(Job(1, ("left",)))
        if k == round(delay / CYCLE):
            line.add(Job(2, ("right",)))
        moves = line.step(CYCLE * k)
        events += line.events
        line.events.clear()
        rows.append(line.motion()[0])
        yields += any(lane.yields_to for lane in line.lanes)
        if not moves and CYCLE * k > delay:
            break
    assert sorted(line.finished) == [1, 2]
    return np.array(rows), events, yields


class InSpeedOnly(Line):
    """Arms that do not leave their plans."""

    def _ways(self, k):
        return [way for way in super()._ways(k) if way.name == way.plan]


def test_an_alternative_saves_a_wait_and_arms_stay_apart(scene, known):
    world = World.of(scene)
    before, decided, waited = run(InSpeedOnly(known))
    assert not any("alternative" in one for one in decided)
    line = Line(known)
    rows, decided, waits = run(line)
    assert any("begins job 2, right, alternative" in one for one in decided)
    # Behind its job the arm is on its plan again, so that the other one may leave its.
    assert line.lanes[1].plan == "right"
    assert CYCLE * (waited - waits) > GAIN
    for motion in (before, rows):
        assert headroom(world, motion[::4]).min() >= -1e-7
    # Arms on their plans at these times, without a wait, are too near.
    tubes = [known.plans[name].plan.plan.tube for name in ("left", "right")]
    times = np.arange(0.0, tubes[0].times[-1], 4 * CYCLE)
    alone = np.hstack([tubes[0].at(times)[:, :7], tubes[1].at(times)[:, 7:]])
    assert headroom(world, alone).min() < -0.001


def test_a_plan_is_kept_where_no_wait_is_saved(known):
    _, decided, _ = run(Line(known), delay=4.0)
    assert "right begins job 2, right" in decided


def test_arms_never_leave_their_plans_both(scene, known):
    plans = {
        "left": LinePlan("left", reaching(scene, "left", LEFT), alternatives=1),
        "right": LinePlan("right", reaching(scene, "right", RIGHT), alternatives=1),
    }
    cell = LineCell.of(scene, plans)
    asides = {name for name, one in cell.plans.items() if one.instead_of}
    assert len(asides) == 2
    assert not any({a, b} <= asides for a, b in cell.crossings)
    run(Line(cell))


def elbows(tube):
    """Where the right arm's elbow is along a plan, shape (k, 3) [m]."""
    model = pin.buildModelFromXML(arm())
    data, found, base = model.createData(), [], np.array([0.0, -0.5 * APART, 0.0])
    for q in tube.at(np.linspace(*tube.times[[0, -1]], 201)):
        pin.forwardKinematics(model, data, q[7:])
        found.append(data.oMi[4].translation + base)
    return np.array(found)


def scene_beside(file, plan, others, deep):
    """The scene with a ball beside the elbow of each other plan, away from the plan."""
    scene = scene_of(file)
    for k, one in enumerate(others):
        way = elbows(one.plan.plan.tube) - elbows(plan.plan.plan.tube)
        far = np.linalg.norm(way, axis=1)
        most = int(np.argmax(far))
        room = ELBOW + BALL + BUFFER - deep
        at = elbows(one.plan.plan.tube)[most] + room * way[most] / far[most]
        pose = ag.Pose(xyz=tuple(at))
        scene.add(ag.Sphere(radius=BALL), name=f"ball{k}", pose=pose)
    return scene


def test_alternatives_that_meet_the_world_are_left_out(file, known):
    right, left = known.plans["right"], known.plans["left"]
    others = [one for one in known.plans.values() if one.instead_of]
    scene = scene_beside(file, right, others[:1], 0.012)
    cell = LineCell.of(scene, {"left": left, "right": right})
    clear = [one for one in cell.plans.values() if one.instead_of]
    (ball,) = scene.objects.values()
    gaps = [
        np.linalg.norm(elbows(one.plan.plan.tube) - ball.pose.xyz, axis=1).min()
        - ELBOW
        - BALL
        for one in (others[0], *clear)
    ]
    assert clear and gaps[0] < BUFFER <= min(gaps[1:])
    # A plan beside which there is no room is refused.
    scene = scene_beside(file, right, others, 0.03)
    with pytest.raises(CoordinationError, match="'right' has no alternative: joint"):
        LineCell.of(scene, {"left": left, "right": right})


def test_arms_that_are_not_redundant_have_no_alternatives():
    scene = cell_of()
    plans = {
        robot: LinePlan(
            robot, plan_through(scene, robot, side * np.array(way)), None, 1
        )
        for robot, side, way in (
            ("left", -1, [-0.7, 0.6, -0.7]),
            ("right", 1, [-0.7, 0.6, -0.7]),
        )
    }
    with pytest.raises(CoordinationError, match="2 joints move the tool of 'left'"):
        LineCell.of(scene, plans)
