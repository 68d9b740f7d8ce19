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
from armguard.scene.compile import compile_scene

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


def plan_of(scene, kind):
    motion = ag.Trajectory(scene.q_names, ROWS, np.array([0.0, 0.5, 1.0]), "a plan")
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


def outside(pieces, plan, scene, error=0.0, count=400):
    """How many random points of links, placed by Pinocchio, are in no piece."""
    tables, rng = compile_scene(scene), np.random.default_rng(5)
    world = CoalWorld(tables)
    found = tried = 0
    for time in rng.uniform(0.0, 1.0, count):
        q = plan.tube.at(np.array([time]))[0]
        world.place(q + error * rng.choice([-1.0, 1.0], len(q)))
        for i in range(tables.moving_count):
            at = world._placed.oMg[i]
            shape = world._geometry.geometryObjects[i].geometry
            x = surface(shape, rng, 20) @ at.rotation.T + at.translation
            own = [p for p in pieces if p.start <= time <= p.end]
            own = [p for p in own if p.link == tables.body_names[i]]
            held = np.any([p.contains(x) for p in own], axis=0)
            found, tried = found + int((~held).sum()), tried + len(x)
    assert tried == count * 20 * tables.moving_count
    return found


@pytest.mark.parametrize(("kind", "error"), [("linear", 0.0), ("cubic", 0.01)])
def test_all_points_of_links_are_in_a_piece_of_their_time(scene, kind, error):
    plan = plan_of(scene, kind)
    verifier = ag.PlanVerifier(scene)
    pieces = verifier.sweep(plan, following_error=error)
    assert outside(pieces, plan, scene, error) == 0


@pytest.mark.parametrize("part", [0, 1])
def test_points_are_outside_where_a_part_of_the_growth_is_left_out(
    scene, monkeypatch, part
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
    plan = plan_of(scene, "cubic")
    pieces = ag.PlanVerifier(scene).sweep(plan, following_error=0.01 * part)
    assert outside(pieces, plan, scene, 0.01 * part) > 0


@pytest.mark.parametrize(("tolerance", "most"), [(0.005, 0.15), (0.002, 0.05)])
def test_a_sweep_holds_little_more_than_what_a_link_passes(scene, tolerance, most):
    plan, link = plan_of(scene, "linear"), "arm/rod"
    pieces = ag.PlanVerifier(scene).sweep(plan, tolerance=tolerance, links=[link])
    corners = np.concatenate([piece.corners for piece in pieces])
    rng = np.random.default_rng(1)
    x = rng.uniform(corners.min(axis=0), corners.max(axis=0), (30_000, 3))
    x = x[np.any([piece.contains(x) for piece in pieces], axis=0)]
    tables = compile_scene(scene)
    world, i = CoalWorld(tables), list(tables.body_names).index(link)
    shape = world._geometry.geometryObjects[i].geometry
    passed = np.zeros(len(x), dtype=bool)
    for time in np.linspace(0.0, 1.0, 400):
        world.place(plan.tube.at(np.array([time]))[0])
        at = world._placed.oMg[i]
        local = (x - at.translation) @ at.rotation
        local[:, 2] -= np.clip(local[:, 2], -shape.halfLength, shape.halfLength)
        passed |= (local**2).sum(axis=1) <= shape.radius**2
    assert passed.sum() > 2000
    assert len(x) / passed.sum() - 1.0 <= most


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


def test_a_link_or_a_tolerance_that_makes_no_sense_is_refused(scene):
    verifier, plan = ag.PlanVerifier(scene), plan_of(scene, "linear")
    with pytest.raises(UnknownNameError, match="did you mean 'arm/rod'"):
        verifier.sweep(plan, links=["arm/rods"])
    with pytest.raises(TrajectoryError, match="must be > 0"):
        verifier.sweep(plan, tolerance=float("nan"))
