"""Swept volumes: they hold all that links pass through, and little more."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

import armguard as ag
from armguard.cli.app import app
from armguard.errors import TrajectoryError, UnknownNameError
from armguard.geometry.core_support import core_support
from armguard.geometry.shapes import shape_row
from armguard.plans import sweep as sweeping
from armguard.plans.coal_world import CoalWorld
from armguard.plans.pieces import spans
from armguard.prove.tube import Tube
from armguard.scene.compile import compile_scene
from armguard.scene.poses import body_poses
from arms import simple_arm

# A column that turns, a slide, and two joints after it, one of which follows the other.
ARM = """<robot name="r"><link name="base"/>
 <link name="column"><collision><origin xyz="0.1 0 0" rpy="0.3 0.2 0"/>
  <geometry><box size="0.1 0.1 0.25"/></geometry></collision></link>
 <link name="slide"><collision><origin xyz="0.2 0 0"/>
  <geometry><box size="0.3 0.06 0.1"/></geometry></collision></link>
 <link name="rod"><collision><origin xyz="0.15 0 0" rpy="0 1.57 0"/>
  <geometry><capsule radius="0.06" length="0.2"/></geometry></collision></link>
 <link name="tip"><collision><origin xyz="0.1 0 0"/>
  <geometry><sphere radius="0.05"/></geometry></collision></link>
 <joint name="turn" type="revolute"><parent link="base"/><child link="column"/>
  <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="2"/></joint>
 <joint name="out" type="prismatic"><parent link="column"/><child link="slide"/>
  <axis xyz="1 0 0"/><limit lower="0" upper="0.4" effort="1" velocity="1"/></joint>
 <joint name="bend" type="revolute"><parent link="slide"/><child link="rod"/>
  <origin xyz="0.35 0 0"/><axis xyz="0 1 0"/>
  <limit lower="-3" upper="3" effort="1" velocity="2"/></joint>
 <joint name="roll" type="revolute"><parent link="rod"/><child link="tip"/>
  <origin xyz="0.3 0 0"/><axis xyz="0 0 1"/><mimic joint="bend" multiplier="-0.5"/>
  <limit lower="-3" upper="3" effort="1" velocity="2"/></joint>
</robot>"""
SCENE = "mode: fixed\nbuffer: 0.02\nrobots:\n  arm: {urdf: arm.urdf}\n"
# turn, out, bend: each moves while the others do.
ROWS = np.array([[-1.0, 0.05, -0.5], [0.5, 0.35, 1.0], [1.4, 0.1, -0.8]])


@pytest.fixture
def scene(tmp_path):
    (tmp_path / "arm.urdf").write_text(ARM)
    (tmp_path / "cell.yaml").write_text(SCENE)
    return ag.load_scene(tmp_path / "cell.yaml")


@pytest.fixture
def two_arms(tmp_path):
    """Two of them, face to face."""
    (tmp_path / "arm.urdf").write_text(ARM)
    scene = ag.Scene(mode="fixed")
    scene.add_robot(tmp_path / "arm.urdf", name="arm")
    there = ag.Pose(xyz=(1.2, 0.3, 0.1), rpy=(0.2, 0.0, np.pi))
    scene.add_robot(tmp_path / "arm.urdf", name="other", base=there)
    return scene


def plan_of(scene, kind):
    rows = np.hstack([ROWS[:, :3] + 0.1 * k for k in range(len(scene.q_names) // 3)])
    motion = ag.Trajectory(scene.q_names, rows, np.array([0.0, 0.5, 1.0]), "a plan")
    return ag.Plan.of(motion, scene, interpolation=kind)


def surface(shape, rng, count):
    """Random points of the surface of a shape of Coal, in its frame."""
    d = rng.normal(size=(count, 3))
    d /= np.linalg.norm(d, axis=1)[:, None]
    name = type(shape).__name__
    if name == "Box":
        return np.sign(d) * shape.halfSide
    points = shape.radius * d
    if name == "Capsule":
        points[:, 2] += np.sign(d[:, 2]) * shape.halfLength
    return points


def frame_in(world, tables, link):
    """Where Pinocchio has the frame of a link; all of ARM begin at their joints."""
    joint = world._model.getJointId(str(tables.links[link].body))
    return world._data.oMi[joint]


def outside(pieces, plan, scene, error=0.0, frame=None, count=400):
    """How many random points of links, placed by Pinocchio, are in no piece."""
    tables, rng = compile_scene(scene), np.random.default_rng(5)
    world, swept = CoalWorld(tables), {piece.link for piece in pieces}
    chosen = [i for i in range(tables.moving_count) if tables.body_names[i] in swept]
    found = tried = 0
    for time in rng.uniform(0.0, 1.0, count):
        q = plan.tube.at(np.array([time]))[0]
        world.place(q + error * rng.choice([-1.0, 1.0], len(q)))
        for i in chosen:
            at = world._placed.oMg[i]
            if frame is not None:
                at = frame_in(world, tables, frame).inverse() * at
            shape = world._geometry.geometryObjects[i].geometry
            x = surface(shape, rng, 20) @ at.rotation.T + at.translation
            own = [p for p in pieces if p.start <= time <= p.end]
            own = [p for p in own if p.link == tables.body_names[i]]
            held = np.any([p.contains(x) for p in own], axis=0)
            found, tried = found + int((~held).sum()), tried + len(x)
    assert tried == count * 20 * len(chosen) > 0
    return found


@pytest.mark.parametrize(("kind", "error"), [("linear", 0.0), ("cubic", 0.01)])
def test_all_points_of_links_are_in_a_piece_of_their_time(scene, kind, error):
    plan = plan_of(scene, kind)
    verifier = ag.PlanVerifier(scene)
    pieces = verifier.sweep(plan, following_error=error)
    assert outside(pieces, plan, scene, error) == 0


@pytest.mark.parametrize("frame", ["arm/tip", "arm/slide", "other/rod"])
def test_all_points_are_in_a_piece_in_the_frame_of_a_link(two_arms, frame):
    plan = plan_of(two_arms, "cubic")
    pieces = ag.PlanVerifier(two_arms).sweep(
        plan, following_error=0.01, relative_to=frame
    )
    assert len({piece.link for piece in pieces}) >= 4
    assert outside(pieces, plan, two_arms, 0.01, frame) == 0


def test_the_chord_error_in_the_frame_of_a_link_is_that_of_the_path():
    """The other arm is near the wrist and far from the shoulder, which counts twice."""
    scene = ag.Scene(mode="fixed")
    scene.add_robot(simple_arm(joints=2), name="arm")
    small = simple_arm(joints=1, length=0.12, radius=0.01)
    scene.add_robot(small, name="other", base=ag.Pose(xyz=(0.38, 0.0, 0.0)))
    rows = np.array([[0.0, 0.0, 0.0], [0.6, 0.6, 0.0]])
    tube, tables = Tube.straight(np.array([0.0, 1.0]), rows), compile_scene(scene)
    frame = tables.links["arm/link2"]
    i = list(tables.body_names).index("other/link1")
    part = sweeping.Part(tube, (0, 0.0, 1.0), tables, frame)
    chord, wide = part.errors(sweeping.Swept(i, tables, frame))

    def seen(turn):
        """The tip of the other arm, in the frame of the wrist, as a complex number."""
        return (0.5 - 0.4 * np.exp(1j * turn)) * np.exp(-2j * turn)

    ends = np.linspace(0.0, 0.6, sweeping.STEPS + 1)
    middles = seen(0.5 * (ends[1:] + ends[:-1]))
    off = np.abs(middles - 0.5 * (seen(ends[1:]) + seen(ends[:-1]))).max()
    assert off <= chord <= 1.5 * off
    assert wide == 0.0


@pytest.mark.parametrize("frame", [None, "arm/tip"])
@pytest.mark.parametrize("part", [0, 1])
def test_points_are_outside_where_a_part_of_the_growth_is_left_out(
    two_arms, monkeypatch, part, frame
):
    both = sweeping.Part.errors

    def without(self, one):
        found = list(both(self, one))
        found[part] = 0.0
        return tuple(found)

    # The halving goes on as before: what counts is the growth alone.
    grown = sweeping.Part.piece

    def piece(self, one, growth, directions):
        growth = sum(without(self, one)) + sweeping.ROUNDING
        return grown(self, one, growth, directions)

    monkeypatch.setattr(sweeping.Part, "piece", piece)
    plan = plan_of(two_arms, "cubic")
    pieces = ag.PlanVerifier(two_arms).sweep(
        plan, following_error=0.01 * part, relative_to=frame
    )
    assert outside(pieces, plan, two_arms, 0.01 * part, frame) > 0


@pytest.mark.parametrize("frame", [None, "other/rod"])
@pytest.mark.parametrize(("tolerance", "most"), [(0.005, 0.15), (0.002, 0.05)])
def test_a_sweep_holds_little_more_than_what_a_link_passes(
    two_arms, tolerance, most, frame
):
    scene, link = two_arms, "arm/rod"
    plan = plan_of(scene, "linear")
    pieces = ag.PlanVerifier(scene).sweep(
        plan, tolerance=tolerance, links=[link], relative_to=frame
    )
    corners = np.concatenate([piece.corners for piece in pieces])
    rng = np.random.default_rng(1)
    x = rng.uniform(corners.min(axis=0), corners.max(axis=0), (60_000, 3))
    held = np.zeros(len(x), dtype=bool)
    for piece in pieces:
        low, high = piece.corners.min(axis=0), piece.corners.max(axis=0)
        near = np.flatnonzero(((x >= low) & (x <= high)).all(axis=1))
        held[near] |= piece.contains(x[near])
    x = x[held]
    tables = compile_scene(scene)
    world, i = CoalWorld(tables), list(tables.body_names).index(link)
    shape = world._geometry.geometryObjects[i].geometry
    passed = np.zeros(len(x), dtype=bool)
    for time in np.linspace(0.0, 1.0, 400):
        world.place(plan.tube.at(np.array([time]))[0])
        at = world._placed.oMg[i]
        if frame is not None:
            at = frame_in(world, tables, frame).inverse() * at
        local = (x - at.translation) @ at.rotation
        local[:, 2] -= np.clip(local[:, 2], -shape.halfLength, shape.halfLength)
        passed |= (local**2).sum(axis=1) <= shape.radius**2
    assert passed.sum() > 2000
    assert len(x) / passed.sum() - 1.0 <= most


def crossing_pandas(late):
    """Two Pandas whose hands pass one place, the right one so much later [s]."""
    scene = ag.Scene(mode="fixed", buffer=0.0)
    for name, y in (("left", 0.45), ("right", -0.45)):
        scene.add_robot("panda", name=name, base=ag.Pose(xyz=(0.0, y, 0.0)))
    times = np.linspace(0.0, 3.0 + late, 21)
    rows = np.tile(scene.home, (len(times), 1))
    for robot, begin, side in (("left", 0.0, 1.0), ("right", late, -1.0)):
        knots = begin + np.array([0.0, 1.5, 3.0])
        there = {1: (-1.2 * side, 0.4 * side), 2: (0.6, 0.0), 4: (0.75, 0.0)}
        for joint, (far, near) in there.items():
            k = scene.q_names.index(f"{robot}/panda_joint{joint}")
            rows[:, k] += np.interp(times, knots, [near, far, near])
    return scene, ag.Plan.of(ag.Trajectory(scene.q_names, rows, times, "x"), scene)


def test_arms_that_cross_at_different_times_meet_in_no_relative_sweep():
    scene, plan = crossing_pandas(late=2.0)
    verifier, hand = ag.PlanVerifier(scene), "left/panda_hand"
    own, other = (
        verifier.sweep(plan, tolerance=0.02, links=[f"{robot}/panda_hand"])
        for robot in ("left", "right")
    )
    shapes = [[ag.Hull(points=one.corners) for one in each] for each in (own, other)]
    depth = min(
        ag.distance(a, ag.Pose(), b, ag.Pose()).distance
        for a in shapes[0]
        for b in shapes[1]
    )
    assert depth < -0.05
    relative = verifier.sweep(plan, tolerance=0.02, relative_to=hand)
    assert {piece.link for piece in relative} > {"right/panda_hand"}
    assert verifier.meeting(relative, hand) == []
    assert verifier.verify(plan).clear


def test_arms_that_clash_meet_where_the_proof_says():
    scene, plan = crossing_pandas(late=0.3)
    verifier, hand = ag.PlanVerifier(scene), "left/panda_hand"
    tables = verifier.checker.tables
    met = verifier.meeting(verifier.sweep(plan, tolerance=0.02, relative_to=hand), hand)
    intervals = [
        one for one in verifier.verify(plan).intervals if one.nearest.a == hand
    ]
    assert intervals
    for one in intervals:
        near = one.nearest
        times = [each for each in spans(met) if each.link == near.b]
        assert any(t.start <= one.contact and one.end <= t.end for t in times)
        # The deepest point of the other link, in the frame of the hand.
        q = plan.tube.at(np.array([near.time]))
        found, names = verifier.checker.near(q, 0.0), tables.body_names
        points = found.point_b[
            [
                (names[a], names[b]) == (hand, near.b)
                for a, b in zip(found.a, found.b, strict=True)
            ]
        ]
        assert len(points)
        frame, T = tables.links[hand], np.eye(4)
        T[:3] = body_poses(tables, q[0])[frame.body].reshape(3, 4)
        local = np.linalg.inv(T @ frame.T_body_link)
        points = points @ local[:3, :3].T + local[:3, 3]
        there = [p for p in met if p.link == near.b and p.start <= near.time <= p.end]
        assert np.any([piece.contains(points) for piece in there], axis=0).all()


KINDS = (ag.Sphere, ag.Capsule, ag.Box, ag.Cylinder, ag.Cone, ag.Ellipsoid, ag.Hull)


@pytest.mark.parametrize("shape", KINDS)
def test_a_primitive_reaches_as_far_as_its_support_point(shape):
    rng = np.random.default_rng(3)
    for _ in range(20):
        one, T = shape.example(rng, 0.3), np.eye(4)
        T[:3, :3] = Rotation.random(rng=rng).as_matrix()
        T[:3, 3] = rng.uniform(-1.0, 1.0, 3)
        row, d = shape_row(one, T), rng.normal(size=(50, 3))
        d /= np.linalg.norm(d, axis=1)[:, None]
        kind = one.kind
        far = [core_support(int(kind), row, tuple(each)) for each in d.tolist()]
        reach = (d * (np.array(far) + row[1:4])).sum(axis=1) + row[0]
        assert sweeping.reach_along(kind, row, d) == pytest.approx(reach, abs=1e-12)


def test_files_hold_a_mesh_for_each_link(scene, tmp_path):
    np.savetxt(
        tmp_path / "plan.csv",
        np.column_stack(([0.0, 0.5, 1.0], ROWS)),
        delimiter=",",
        header="t,turn,out,bend",
        comments="",
    )
    given = ["verify", str(tmp_path / "plan.csv"), "--scene"]
    given += [str(tmp_path / "cell.yaml"), "--sweep-tolerance", "0.02", "--sweep"]
    for name in ("sweep.glb", "sweep.stl", "sweep.ply"):
        found = CliRunner().invoke(app, [*given, str(tmp_path / name)])
        assert found.exit_code == 0, found.output
    whole = trimesh.load(tmp_path / "sweep.glb")
    assert set(whole.geometry) == {"arm/column", "arm/slide", "arm/rod", "arm/tip"}
    one = trimesh.load(tmp_path / "sweep.stl")
    assert one.extents == pytest.approx(whole.extents, rel=1e-5)
    assert trimesh.load(tmp_path / "sweep.ply").extents == pytest.approx(
        whole.extents, rel=1e-5
    )
    found = CliRunner().invoke(app, [*given, str(tmp_path / "sweep.obj")])
    assert "is no glb, stl, ply" in str(found.exception)
    relative = [*given, str(tmp_path / "relative.glb"), "--sweep-relative-to"]
    found = CliRunner().invoke(app, [*relative, "arm/column"])
    assert found.exit_code == 0, found.output
    assert "arm/column never touches a moving link that is checked" in found.output
    assert set(trimesh.load(tmp_path / "relative.glb").geometry) <= {
        "arm/rod",
        "arm/tip",
    }


def test_a_link_or_a_tolerance_that_makes_no_sense_is_refused(scene):
    verifier, plan = ag.PlanVerifier(scene), plan_of(scene, "linear")
    with pytest.raises(UnknownNameError, match="did you mean 'arm/rod'"):
        verifier.sweep(plan, links=["arm/rods"])
    with pytest.raises(UnknownNameError, match="did you mean 'arm/rod'"):
        verifier.sweep(plan, relative_to="arm/rods")
    with pytest.raises(TrajectoryError, match="arm/base has no shape"):
        verifier.meeting([], "arm/base")
    with pytest.raises(TrajectoryError, match="must be > 0"):
        verifier.sweep(plan, tolerance=float("nan"))
