"""MJCF robots are MuJoCo's: same poses, geometry and couplings; the rest is refused."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from armguard.errors import MeshError, ModelError
from armguard.geometry import Pose, Sphere, distance
from armguard.robot import child, load_urdf
from armguard.robot.fitting import fit_link
from armguard.robot.fitting.exact import exact_shapes
from armguard.robot.kinematics import forward_kinematics, kinematic_table
from armguard.robot.limits import home_configuration
from armguard.robot.mjcf_source import expand_mjcf
from armguard.robot.model import JointKind, MeshFile
from armguard.scene import Scene, load_scene
from armguard.view.meshes import visuals_of

mujoco = pytest.importorskip("mujoco")

TETRAHEDRON = "".join(
    f"{line}\n"
    for line in (
        *("v 0 0 0", "v 0.3 0 0", "v 0 0.2 0", "v 0.1 0 0.1"),
        *("f 1 3 2", "f 1 2 4", "f 1 4 3", "f 2 3 4"),
    )
)

# Two bodies above each other, the upper one on several joints; all shapes.
ARM = """<mujoco model="arm">
  <compiler angle="degree" meshdir="meshes"/>
  <asset><mesh name="part" file="part.obj" scale="1 -2 0.5"/></asset>
  <worldbody>
    <geom name="stand" type="box" size="0.1 0.2 0.3" pos="0 0 -0.3"/>
    <body name="lower" pos="0.1 0 0.2" quat="0.7071068 0 0.7071068 0">
      <joint name="turn" axis="0 0 2" range="-90 100" pos="0.05 0 0.1" ref="20"/>
      <geom type="capsule" fromto="0 0 0 0.1 0.2 0.3" size="0.04"/>
      <geom type="mesh" mesh="part" pos="0.2 0 0" euler="10 20 30"/>
      <geom type="sphere" size="0.5" contype="0" conaffinity="0" group="2"/>
      <body name="upper" pos="0 0 0.5" euler="30 0 90">
        <joint name="slide" type="slide" axis="1 1 0" range="0 0.1" ref="0.02"/>
        <joint name="spin" axis="0 1 0" pos="0 0 0.1"/>
        <geom type="cylinder" size="0.05 0.1" pos="0 0.1 0"/>
        <geom type="ellipsoid" size="0.05 0.1 0.2" euler="0 30 60"/>
        <body name="hand" pos="0 0 0.3">
          <geom type="box" size="0.02 0.03 0.04" contype="0" conaffinity="2"/>
          <body name="finger" pos="0 0 0.05">
            <joint name="grip" type="slide" axis="0 1 0" range="-1 1" ref="0.1"/>
            <geom size="0.01"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <contact><exclude body1="finger" body2="lower"/></contact>
  <equality><joint joint1="grip" joint2="turn" polycoef="0.01 -0.1 0 0 0"/></equality>
  <keyframe><key name="other" qpos="0 0 0 0"/><key name="home" qpos="1 0.03 -2 0"/>
  </keyframe>
</mujoco>"""

BODY = '<body name="b">{}<geom size="0.1"/></body>'


def write(folder, text, name="arm.xml"):
    (folder / "meshes").mkdir(exist_ok=True)
    (folder / "meshes" / "part.obj").write_text(TETRAHEDRON)
    path = folder / name
    path.write_text(text)
    return path


def world(inner, more=""):
    return f"<mujoco><worldbody>{inner}</worldbody>{more}</mujoco>"


def random_tree(rng, count=8):
    """Bodies on none to three joints each, their frames also turned by 90 degrees."""
    body, names = "", [f"b{k}" for k in range(count)]
    for k, name in reversed([*enumerate(names)]):
        joints = "".join(
            f'<joint name="{name}_{n}" type="{rng.choice(["hinge", "slide"])}" '
            f'range="-2 2" ref="{rng.uniform(-1, 1)}" '
            f'axis="{numbers(rng.normal(size=3))}" '
            f'pos="{numbers(rng.uniform(-0.2, 0.2, 3) * rng.integers(2))}"/>'
            for n in range(rng.integers(4) if k else 1)
        )
        turn = Rotation.random(rng=rng)
        if rng.integers(2):
            turn = Rotation.from_euler("xyz", 90 * rng.integers(-2, 3, 3), degrees=True)
        body = (
            f'<body name="{name}" pos="{numbers(rng.uniform(-0.4, 0.4, 3))}" '
            f'quat="{numbers(turn.as_quat(scalar_first=True))}">{joints}'
            f'<geom type="box" size="0.1 0.2 0.3" pos="{numbers(rng.normal(size=3))}" '
            f'quat="{numbers(Rotation.random(rng=rng).as_quat())}"/>{body}</body>'
        )
    return f'<mujoco><compiler angle="radian"/><worldbody>{body}</worldbody></mujoco>'


def numbers(values):
    return " ".join(str(float(value)) for value in values)


def poses_of_bodies(table, q):
    T = np.zeros((len(table.parent), 12))
    names = "parent joint_kind q_index gain T_parent_joint axis".split()
    forward_kinematics(q, *(getattr(table, name) for name in names), T)
    return T.reshape(-1, 3, 4)


def random_positions(model, theirs, rng):
    """Positions for our model, and the same ones for MuJoCo's."""
    q = {
        name: rng.uniform(max(joint.lower, -4), min(joint.upper, 4))
        for name in model.q_names
        for joint in [model.joints[name]]
    }
    for joint in model.joints.values():
        if joint.kind is JointKind.FIXED:
            continue
        mimic, value = joint.mimic, q.get(joint.name)
        if mimic:
            value = mimic.multiplier * q[mimic.joint] + mimic.offset
        theirs.joint(joint.name).qpos[0] = value
    return np.array([*q.values()])


@pytest.mark.parametrize("seed", ["arm", 0, 1, 2])
def test_poses_of_bodies_and_geoms_are_mujocos(seed, tmp_path):
    rng = np.random.default_rng(0 if seed == "arm" else seed)
    path = write(tmp_path, ARM if seed == "arm" else random_tree(rng))
    model, compiled = load_urdf(path), mujoco.MjModel.from_xml_path(str(path))
    data, table = mujoco.MjData(compiled), kinematic_table(model)
    assert len(model.q_names) >= 3
    for _ in range(100):
        T = poses_of_bodies(table, random_positions(model, data, rng))
        mujoco.mj_kinematics(compiled, data)
        for body in range(compiled.nbody):
            name = compiled.body(body).name
            ours = np.vstack([T[table.body_of_link[name]], (0, 0, 0, 1)])
            ours = ours @ table.T_body_link[name]
            near = {"rtol": 0.0, "atol": 1e-9}
            np.testing.assert_allclose(ours[:3, 3], data.xpos[body], **near)
            turn = data.xmat[body].reshape(3, 3)
            np.testing.assert_allclose(ours[:3, :3], turn, **near)
            for element, geom in pairs_of_geoms(model, compiled, name):
                frame = ours @ element.T_link_geometry
                if isinstance(element.geometry, MeshFile):
                    continue  # MuJoCo moves meshes; their distances are compared below
                np.testing.assert_allclose(frame[:3, 3], data.geom_xpos[geom], **near)
                turn = data.geom_xmat[geom].reshape(3, 3)
                np.testing.assert_allclose(frame[:3, :3], turn, **near)


def pairs_of_geoms(model, compiled, name):
    """Collision elements of a link, each with MuJoCo's geom."""
    body = compiled.body(name).id
    geoms = [
        k
        for k in range(compiled.ngeom)
        if compiled.geom_bodyid[k] == body
        and (compiled.geom_contype[k] or compiled.geom_conaffinity[k])
    ]
    return list(zip(model.links[name].collisions, geoms, strict=True))


def test_distances_of_all_shapes_are_mujocos(tmp_path):
    """A small sphere at random places outside of each geom; meshes by their hull."""
    path = write(tmp_path, ARM)
    model = load_urdf(path)
    spec = mujoco.MjSpec.from_file(str(path))
    probe = spec.worldbody.add_body(name="probe", mocap=True)
    probe.add_geom(name="ball", size=[0.01, 0, 0])
    compiled = spec.compile()
    data = mujoco.MjData(compiled)
    mujoco.mj_kinematics(compiled, data)
    rng = np.random.default_rng(0)
    seen = set()
    for name, link in model.links.items():
        shapes = exact_shapes(link)
        if name not in ("lower", "upper", "hand", "world", "finger"):
            assert not link.collisions
            continue
        world_link = np.eye(4)
        world_link[:3, 3] = data.body(name).xpos
        world_link[:3, :3] = data.body(name).xmat.reshape(3, 3)
        for (element, geom), at in zip(
            pairs_of_geoms(model, compiled, name),
            shapes or link.collisions,
            strict=True,
        ):
            seen.add(int(compiled.geom_type[geom]))
            shape = at.shape if shapes else element.geometry
            T = world_link @ (at.pose.matrix() if shapes else at.T_link_geometry)
            for _ in range(20):
                centre = T[:3, 3] + 0.7 * Rotation.random(rng=rng).as_matrix()[0]
                data.mocap_pos[0] = centre
                mujoco.mj_kinematics(compiled, data)
                theirs = mujoco.mj_geomDistance(
                    compiled, data, geom, compiled.geom("ball").id, 9.0, None
                )
                ours = distance(
                    shape, Pose.from_matrix(T), Sphere(radius=0.01), Pose(xyz=centre)
                )
                assert theirs > 0.0
                assert ours.distance == pytest.approx(theirs, abs=2e-6)
    assert len(seen) == 6


def test_names_limits_home_and_pairs_are_those_of_the_file(tmp_path):
    model = load_urdf(write(tmp_path, ARM))
    assert model.root == "world"
    assert model.q_names == ("turn", "slide", "spin")
    turn, spin = model.joints["turn"], model.joints["spin"]
    assert (turn.lower, turn.upper) == pytest.approx(np.radians([-90, 100]))
    assert turn.velocity is None
    assert spin.kind is JointKind.CONTINUOUS
    assert home_configuration(model) == {"turn": 1.0, "slide": 0.03, "spin": -2.0}
    joined = "arm.xml: joined by 2 joints"
    assert {(p.link_a, p.link_b, p.reason) for p in model.disabled_pairs} == {
        ("lower", "finger", "arm.xml: <exclude>"),
        ("lower", "upper", joined),
        ("lower", "hand", joined),
    }
    # The sphere without contact is drawn, and not guarded.
    assert len(model.links["lower"].collisions) == 2
    assert len(visuals_of(model)["lower"]) == 1
    assert model.notes == ()


def test_a_coupling_is_kept_by_mujocos_constraint(tmp_path):
    path = write(tmp_path, ARM)
    model, compiled = load_urdf(path), mujoco.MjModel.from_xml_path(str(path))
    data, rng = mujoco.MjData(compiled), np.random.default_rng(0)
    assert model.joints["grip"].mimic.joint == "turn"
    for _ in range(20):
        random_positions(model, data, rng)
        mujoco.mj_forward(compiled, data)
        rows = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
        assert np.abs(data.efc_pos[rows]).max() < 1e-12


@pytest.mark.parametrize("kind", ["joint", "connect"])
def test_other_couplings_leave_the_joints_independent_and_are_noted(kind, tmp_path):
    rule = {
        "joint": '<joint joint1="grip" joint2="turn" polycoef="0 1 1 0 0"/>',
        "connect": '<connect body1="finger" body2="lower" anchor="0 0 0"/>',
    }[kind]
    text = ARM[: ARM.index("<equality>")] + f"<equality>{rule}</equality></mujoco>"
    model = load_urdf(write(tmp_path, text))
    assert "grip" in model.q_names
    assert f"the <{kind}> of <equality> is no linear coupling" in model.notes[0]


def test_the_only_keyframe_is_home_and_an_only_one_of_several_is_not(tmp_path):
    joint = BODY.format('<joint name="j" axis="0 0 1" range="-90 90"/>')
    keys = '<keyframe><key qpos="0.5"/>{}</keyframe>'
    one = load_urdf(write(tmp_path, world(joint, keys.format(""))))
    two = load_urdf(write(tmp_path, world(joint, keys.format('<key qpos="1"/>'))))
    assert home_configuration(one) == {"j": 0.5}
    assert home_configuration(two) == {"j": 0.0}


REFUSED = {
    "free": (
        BODY.format('<freejoint name="f"/>'),
        r"'arm.xml': joint 'f' is free; .*`base`",
    ),
    "ball": (
        BODY.format('<joint name="j" type="ball"/>'),
        "'arm.xml' line 1: joint 'j' is ball; write it as three hinge joints",
    ),
    "slide": (
        BODY.format('<joint name="j" type="slide"/>'),
        "joint 'j' slides and has no range; add `range=",
    ),
    "plane": (
        '\n<geom name="floor" type="plane" size="1 1 1"/>',
        r"line 2: geom 'floor' of body 'world' is of type plane.*`objects: \{floor: ",
    ),
    "mocap": (
        '<body name="m" mocap="true"><geom size="0.1"/></body>',
        "body 'm' is a mocap body.*add it to the scene as an object",
    ),
    "syntax": ("<geom sise='1'/>", "'arm.xml' cannot be read: .*'sise'.*correct"),
    "nothing": ("<body/>", "has no collision geometry on any of its 2 links"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_guarded_is_refused_with_its_remedy(case, tmp_path):
    inner, says = REFUSED[case]
    with pytest.raises(ModelError, match=says):
        load_urdf(write(tmp_path, world(inner)))


ASSETS = {
    "gone": ('file="gone.obj"', ModelError, "cannot be read: .*gone.obj"),
    "inline": ('vertex="0 0 0 1 0 0 0 1 0 0 0 1"', ModelError, "is from no file"),
    "refpos": ('file="meshes/part.obj" refpos="1 0 0"', ModelError, "has a refpos"),
    "outside": ('file="../outside.obj"', MeshError, "outside of the folders"),
}


@pytest.mark.parametrize("case", ASSETS)
def test_meshes_are_files_below_the_robots_folder(case, tmp_path):
    given, error, says = ASSETS[case]
    asset = f'<asset><mesh name="m" {given}/></asset>'
    (tmp_path / "own").mkdir()
    (tmp_path / "outside.obj").write_text(TETRAHEDRON)
    text = world('<geom type="mesh" mesh="m"/>', asset)
    with pytest.raises(error, match=says):
        load_urdf(write(tmp_path / "own", text))


def test_heights_are_refused_and_a_joint_follows_one(tmp_path):
    asset = '<asset><hfield name="h" nrow="2" ncol="2" size="1 1 1 1"/></asset>'
    with pytest.raises(ModelError, match=r"of type hfield.*to the scene as a mesh"):
        load_urdf(write(tmp_path, world('<geom type="hfield" hfield="h"/>', asset)))
    rule = '<joint joint1="grip" joint2="turn"/>'
    text = ARM.replace("</equality>", f"{rule}</equality>")
    with pytest.raises(ModelError, match="joint 'grip' follows two joints"):
        load_urdf(write(tmp_path, text))


def test_the_child_has_a_time_limit_and_its_library_an_install_line(
    tmp_path, monkeypatch
):
    path = write(tmp_path, ARM)
    with pytest.raises(ModelError, match=r"not expanded after 0.01 s; look for large"):
        expand_mjcf(path, seconds=0.01)
    monkeypatch.setattr(child, "find_spec", lambda _: None)
    with pytest.raises(ModelError, match=r'pip install "armguard\[mjcf\]"'):
        load_urdf(path)


def test_pairs_and_notes_inside_a_urdf_are_not_those_of_an_srdf(tmp_path):
    text = expand_mjcf(write(tmp_path, ARM)).decode()
    text = text.replace("</robot>", "<note>n</note></robot>")
    model = load_urdf(write(tmp_path, text, "arm.urdf"))
    assert model.disabled_pairs == model.notes == ()
    assert not model.group_states


def test_an_ellipsoid_beside_a_mesh_holds_what_is_inside_of_it(tmp_path):
    """A mesh inside of an ellipsoid is contained by it alone."""
    asset = '<asset><mesh name="m" file="meshes/part.obj"/></asset>'
    inner = '<geom type="mesh" mesh="m"/><geom type="ellipsoid" size="0.5 0.4 0.3"/>'
    model = load_urdf(write(tmp_path, world(f"<body>{inner}</body>", asset)))
    fit = fit_link(model.links["body_1"], max_primitives=1)
    assert fit.contained


def test_a_scene_file_names_an_mjcf_file(tmp_path):
    write(tmp_path, ARM.replace('<geom type="mesh" mesh="part"', "<geom size='.1'"))
    scene = tmp_path / "scene.yaml"
    scene.write_text("robots:\n  r:\n    urdf: arm.xml\n    mode: fixed\n")
    by_python = Scene(mode="fixed").add_robot(tmp_path / "arm.xml", "r")
    for robot in (load_scene(scene).robots["r"], by_python):
        assert robot.home == {"turn": 1.0, "slide": 0.03, "spin": -2.0}
        assert robot.fits.keys() == {"world", "lower", "upper", "hand", "finger"}
    scene.write_text("robots:\n  r:\n    urdf: arm.xml\n")
    with pytest.raises(Exception, match="has no stopping figures"):
        load_scene(scene)


def test_a_warning_of_mujoco_is_a_note_and_no_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    model = load_urdf(write(tmp_path, world('<geom size="1" rgba="nan 0 0 1"/>')))
    assert "'arm.xml': MuJoCo warns: XML contains a 'NaN'" in model.notes[0]
    assert {path.name for path in tmp_path.iterdir()} == {"arm.xml", "meshes"}
