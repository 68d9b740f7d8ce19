"""Trajectories and the public planning scenes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from armguard.errors import TrajectoryError
from armguard.guard import EventLog, Level, Reason
from armguard.respond import Guard
from armguard.robot.fitting.fit import placed_triangles
from armguard.scene import bay_scene, load_scene, load_trajectory
from armguard.scene.trajectory import densify
from armguard.scene.yaml_source import SceneFileError
from arms import link_pose
from coal_shapes import coal_shape

PUBLIC = Path(__file__).parents[2].parent / "shared" / "motionbench"
needs_public = pytest.mark.skipif(
    not PUBLIC.is_dir(), reason="the public planning scenes are not here"
)


@pytest.fixture(scope="module")
def bay():
    return bay_scene()


def csv(tmp_path, text):
    path = tmp_path / "m.csv"
    path.write_text(text)
    return path


def test_columns_are_matched_by_name(tmp_path, bay):
    names = list(reversed(bay.q_names))
    row = ",".join(str(k / 10) for k in range(14))
    path = csv(tmp_path, f"t,{','.join(names)}\n0.0,{row}\n0.1,{row}\n")
    motion = load_trajectory(path)
    q = motion.for_scene(bay)
    assert q[0].tolist() == pytest.approx([k / 10 for k in reversed(range(14))])
    assert motion.stamps.tolist() == [0.0, 0.1]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "m.csv:1: the first line must hold the joint names"),
        ("a,a\n1,2\n", "m.csv:1: column 'a' is there twice"),
        ("a,b\n1\n", "m.csv:2: 1 columns; the header has 2"),
        ("a,b\n1,x\n", "m.csv:2: 'x' is no number"),
        ("a,b\n", "there is no configuration in it"),
        ("t,a\n0,1\ninf,2\n", "the time of configuration 2 is inf; give a finite"),
        ("t,a\n0,1\n2,1\n1,1\n", "time goes from 2 s to 1 s at configuration 3"),
        ("t,a\nnan,1\n2,1\n", "the time of configuration 1 is nan; give a finite"),
    ],
)
def test_a_csv_that_is_wrong_is_refused(tmp_path, text, says):
    with pytest.raises(TrajectoryError) as caught:
        load_trajectory(csv(tmp_path, text))
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("header", "says"),
    [
        ("left/jiont1", "joint 'left/jiont1' is not in the scene; did you mean"),
        ("joint1", "may be 'left/joint1' or 'right/joint1'; write the robot's name"),
        ("left/joint1", "no positions for 'left/joint2'"),
    ],
)
def test_joints_that_do_not_fit_are_refused(tmp_path, bay, header, says):
    motion = load_trajectory(csv(tmp_path, f"{header}\n0\n"))
    with pytest.raises(TrajectoryError) as caught:
        motion.for_scene(bay)
    assert says in str(caught.value)


def test_npz_is_read_and_checked(tmp_path, bay):
    path = tmp_path / "m.npz"
    q = np.zeros((3, 14))
    np.savez(path, names=np.array(bay.q_names), q=q, t=np.arange(3.0))
    assert load_trajectory(path).for_scene(bay).shape == (3, 14)
    np.savez(path, names=np.array(bay.q_names[:3]), q=q)
    with pytest.raises(TrajectoryError, match=r"q has shape \(3, 14\)"):
        load_trajectory(path)
    np.savez(path, q=q)
    with pytest.raises(TrajectoryError, match="no array 'names'"):
        load_trajectory(path)
    with pytest.raises(TrajectoryError, match="is no motion file"):
        load_trajectory(tmp_path / "m.txt")
    with pytest.raises(TrajectoryError, match="cannot be read"):
        load_trajectory(tmp_path / "none.csv")


def test_a_nan_in_a_file_becomes_a_fault(tmp_path, bay):
    text = ",".join(bay.q_names) + "\n" + ",".join(["nan"] + ["0"] * 13) + "\n"
    (row,) = load_trajectory(csv(tmp_path, text)).for_scene(bay)
    assert Guard(bay).step(row).reason is Reason.NOT_FINITE


@given(
    q=arrays(
        float, st.tuples(st.integers(1, 6), st.just(3)), elements=st.floats(-3, 3)
    ),
    step=st.floats(0.01, 1.0),
)
@settings(max_examples=100, deadline=None, derandomize=True)
def test_dense_motion_keeps_waypoints_and_steps(q, step):
    dense = densify(q, step)
    assert np.abs(np.diff(dense, axis=0)).max(initial=0.0) <= step + 1e-12
    rows = {row.tobytes() for row in dense}
    assert all(row.tobytes() in rows for row in q)


def test_a_step_must_be_positive():
    with pytest.raises(TrajectoryError, match="max_step is 0"):
        densify(np.zeros((2, 2)), 0.0)


@needs_public
@pytest.mark.parametrize("folder", sorted(p.name for p in PUBLIC.glob("*_*")))
def test_public_scenes_load_and_their_motions_run(folder):
    scenes = sorted((PUBLIC / folder).glob("scene*.yaml"))
    assert len(scenes) == 10
    for path in scenes:
        scene = load_scene(path)
        # The audit at the end is of a tree that follows the arm.
        scene.index = replace(scene.index, kind="octree")
        guard = Guard(scene)
        assert guard.home_verdict.level < Level.STOP, path
        fill = dict(zip(scene.q_names, scene.home, strict=True))
        number = path.stem.removeprefix("scene")
        request = load_trajectory(path.with_name(f"request{number}.yaml"))
        assert request.ends_only
        start, goal = request.for_scene(scene, fill)
        # The requests open the grippers wider than the robots' limits.
        for q in (start, goal):
            assert guard.step(q).reason is Reason.OUT_OF_LIMITS
        way = path.with_name(f"path{number}.csv")
        if way.exists():
            log = EventLog()
            for q in densify(load_trajectory(way).for_scene(scene, fill), 0.02):
                verdict = guard.step(q)
                log.add(verdict)
                # The paths were planned for the arm with its gripper open; how the
                # fingers stand is not part of them.
                for pair in verdict.near:
                    if "finger" not in pair.a:
                        confirm_contact(pair, scene, q)
            guard.index.check()
            assert log.faults == 0
            assert log.levels[Level.CLEAR] > 0


def confirm_contact(pair, scene, q):
    """An overlap beyond the model's error is one of the mesh itself, says Coal.

    There are some: between the states their planner looked at, paths cut corners.
    """
    if -pair.distance > pair.model_error:
        theirs = mesh_depth(pair, scene, q)
        assert theirs == pytest.approx(-pair.distance, abs=pair.model_error + 1e-6)


def mesh_depth(pair, scene, q):
    """Depth of the deepest triangle of a link's mesh in an object, by Coal [m]."""
    import coal

    robot, link = pair.a.split("/")
    placed = scene.robots[robot]
    (element,) = placed.model.links[link].collisions
    positions = dict(zip(placed.model.q_names, q, strict=True))
    T = placed.base.matrix() @ link_pose(placed.model, positions, link)
    triangles = placed_triangles(element)
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(len(triangles), 3 * len(triangles))
    for triangle in triangles:
        mesh.addTriangle(*triangle)
    mesh.endModel()
    item = scene.objects[pair.b]
    request, result = coal.CollisionRequest(), coal.CollisionResult()
    request.num_max_contacts, request.enable_contact = 1000, True
    deepest = 0.0
    for part in item.shapes:
        T_part = item.pose.matrix() @ part.pose.matrix()
        result.clear()
        coal.collide(
            mesh,
            coal.Transform3s(T[:3, :3], T[:3, 3]),
            coal_shape(part.shape),
            coal.Transform3s(T_part[:3, :3], T_part[:3, 3]),
            request,
            result,
        )
        for k in range(result.numContacts()):
            deepest = max(deepest, -result.getContact(k).penetration_depth)
    return deepest


@needs_public
def test_allowed_pairs_of_a_public_scene_have_their_reason():
    scene = load_scene(PUBLIC / "table_pick_panda" / "scene0001.yaml")
    assert scene.allowances[0].reason == "allowed_collision_matrix of scene0001.yaml"


MOVEIT = """robot_model_name: panda
world:
  collision_objects:
    - id: thing
      {0}
"""


@pytest.mark.parametrize(
    ("inner", "says"),
    [
        (
            "meshes: [{}]",
            ":4: world.collision_objects[0]: object 'thing' has 1 meshes and 0 poses",
        ),
        (
            "primitives: [{type: box, dimensions: [1, 1, 1]}]",
            "has 1 primitives and 0 poses",
        ),
        (
            "{primitives: [{type: torus, dimensions: [1]}], primitive_poses: "
            "[{position: [0, 0, 9], orientation: [0, 0, 0, 1]}]}",
            "",
        ),
    ],
)
def test_what_a_moveit_scene_holds_is_never_dropped(tmp_path, inner, says):
    path = tmp_path / "s.yaml"
    path.write_text(MOVEIT.replace("{0}", inner))
    with pytest.raises(SceneFileError) as caught:
        load_scene(path)
    assert says in str(caught.value)


def test_an_unknown_primitive_is_named(tmp_path):
    path = tmp_path / "s.yaml"
    path.write_text(
        "robot_model_name: panda\nworld:\n  collision_objects:\n    - id: ring\n"
        "      primitives: [{type: torus, dimensions: [1]}]\n"
        "      primitive_poses: [{position: [0, 0, 9], orientation: [0, 0, 0, 1]}]\n"
    )
    with pytest.raises(SceneFileError, match="primitive of type 'torus'"):
        load_scene(path)
