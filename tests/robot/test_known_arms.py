"""Arms recognised by the names and distances of their joints, and their figures."""

from pathlib import Path

import numpy as np
import pytest

from armguard import Scene
from armguard.robot import load_urdf
from armguard.robot.known_arms import family_figures, known_arms, known_data
from armguard.robot.named import ROBOTS, find_named_robot
from armguard.robot.stopping import known_figures
from armguard.scene import load_scene

ARMS = known_data()["arms"]

LINK = """<link name="{name}"><collision><geometry><sphere radius="0.02"/></geometry>
</collision></link>"""
JOINT = """<joint name="{name}" type="{kind}"><parent link="{parent}"/>
<child link="{child}"/><origin xyz="{x} {y} 0" rpy="0.3 0 0"/><axis xyz="0 0 1"/>
<limit lower="-{limit}" upper="{limit}" velocity="{speed}" effort="1"/></joint>"""


def write_arm(
    folder: Path,
    joints: list[str],
    lengths: list[float],
    *,
    prefix: str = "",
    split: bool = False,
    limit: float = 6.3,
    speed: float = 100.0,
) -> Path:
    """A URDF of a chain; `split` puts a fixed joint halfway between two joints."""
    parts = [LINK.format(name="base")]
    parent = "base"
    for number, (name, length) in enumerate(
        zip(joints, [0.1, *lengths], strict=True), 1
    ):
        # Spread over two axes, so that the distance is no single coordinate.
        x, y = 0.6 * length, 0.8 * length
        values = {"limit": limit, "speed": speed}
        if split and number > 1:
            middle = f"half{number}"
            parts.append(LINK.format(name=middle))
            parts.append(
                f'<joint name="to_{middle}" type="fixed"><parent link="{parent}"/>'
                f'<child link="{middle}"/><origin xyz="{x} 0 0"/></joint>'
            )
            parent, x = middle, 0.0
        parts.append(LINK.format(name=f"link{number}"))
        parts.append(
            JOINT.format(
                name=prefix + name,
                kind="revolute",
                parent=parent,
                child=f"link{number}",
                x=x,
                y=y,
                **values,
            )
        )
        parent = f"link{number}"
    path = folder / "arm.urdf"
    path.write_text(f'<robot name="arm">{"".join(parts)}</robot>')
    return path


@pytest.mark.parametrize("name", ARMS)
def test_every_arm_of_the_table_is_recognised(name: str, tmp_path: Path) -> None:
    row = ARMS[name]
    path = write_arm(tmp_path, row["joints"], row["lengths"], prefix="left_")
    (arm,) = known_arms(load_urdf(path))
    assert arm.name == name
    assert arm.joints == tuple("left_" + joint for joint in row["joints"])
    assert all(joint in arm.joints for joint in arm.home)


def test_a_fixed_joint_between_two_joints_counts_as_one_step(tmp_path: Path) -> None:
    row = ARMS["ur10e"]
    path = write_arm(tmp_path, row["joints"], row["lengths"], split=True)
    (arm,) = known_arms(load_urdf(path))
    assert arm.name == "ur10e"


@pytest.mark.parametrize(("off", "known"), [(0.0019, True), (0.0021, False)])
def test_lengths_must_agree_to_two_millimetres(
    off: float, known: bool, tmp_path: Path
) -> None:
    lengths = list(ARMS["ur5e"]["lengths"])
    lengths[2] += off
    path = write_arm(tmp_path, ARMS["ur5e"]["joints"], lengths)
    assert bool(known_arms(load_urdf(path))) is known


def test_a_chain_with_other_names_or_another_order_is_not_recognised(
    tmp_path: Path,
) -> None:
    row = ARMS["fr3"]
    renamed = [joint + "x" for joint in row["joints"]]
    assert not known_arms(load_urdf(write_arm(tmp_path, renamed, row["lengths"])))
    other = [*row["joints"][1:], row["joints"][0]]
    assert not known_arms(load_urdf(write_arm(tmp_path, other, row["lengths"])))


@pytest.mark.parametrize("name", sorted(known_data()["families"]))
def test_figures_of_a_family_have_sources_and_cap_the_speed(
    name: str, tmp_path: Path
) -> None:
    values, sources = family_figures(name)
    assert values.keys() == sources.keys()
    assert all(len(source) > 8 for source in sources.values())
    arm = next((row for row in ARMS.values() if row["family"] == name), None)
    if arm is None:
        return
    path = write_arm(tmp_path, arm["joints"], arm["lengths"], speed=30.0)
    figures = known_figures(load_urdf(path))
    assert figures is not None
    assert np.all(figures.velocity == values["velocity"])
    assert np.all(figures.deceleration == values["deceleration"])
    assert arm["title"] in figures.sources["deceleration"]
    slow = known_figures(
        load_urdf(write_arm(tmp_path, arm["joints"], arm["lengths"], speed=0.1))
    )
    assert slow is not None
    assert np.all(slow.velocity == 0.1)


@pytest.mark.parametrize(
    ("robot", "arms"),
    [
        ("panda", {"panda"}),
        ("ur5", {"ur5_cb3"}),
        ("xarm7", {"xarm7"}),
        ("so101", {"so101"}),
        ("g1", {"g1_left", "g1_right"}),
        ("baxter", {"baxter_left", "baxter_right"}),
    ],
)
def test_robots_by_name_are_recognised_from_their_files(
    robot: str, arms: set[str]
) -> None:
    model = load_urdf(find_named_robot(robot).urdf)
    assert {arm.name for arm in known_arms(model)} == arms
    assert robot in ROBOTS


def test_a_scene_takes_home_and_figures_of_a_recognised_arm(tmp_path: Path) -> None:
    row = ARMS["ur16e"]
    path = write_arm(tmp_path, row["joints"], row["lengths"])
    scene = Scene()
    scene.add_robot(path, name="arm")
    robot = scene.robots["arm"]
    assert robot.stopping is not None
    assert robot.stopping.deceleration[0] == 4.0
    assert [robot.home[joint] for joint in row["joints"]] == row["home"]


def test_a_home_outside_the_limits_is_left_out(tmp_path: Path) -> None:
    row = ARMS["ur16e"]
    path = write_arm(tmp_path, row["joints"], row["lengths"], limit=1.0)
    scene = Scene()
    scene.add_robot(path, name="arm")
    assert scene.robots["arm"].home["shoulder_lift_joint"] == 0.0


def test_declared_figures_take_the_place_of_those_of_a_recognised_arm(
    tmp_path: Path,
) -> None:
    row = ARMS["ur16e"]
    path = write_arm(tmp_path, row["joints"], row["lengths"])
    scene = Scene()
    scene.add_robot(path, name="arm", stopping={"deceleration": 7.0})
    stopping = scene.robots["arm"].stopping
    assert stopping is not None
    assert stopping.deceleration[0] == 7.0
    assert stopping.ramp == 0.02


def test_a_scene_file_takes_figures_of_a_recognised_arm(tmp_path: Path) -> None:
    row = ARMS["ur16e"]
    write_arm(tmp_path, row["joints"], row["lengths"])
    file = tmp_path / "scene.yaml"
    file.write_text("robots:\n  arm: {urdf: arm.urdf}\n")
    robot = load_scene(file).robots["arm"]
    assert robot.stopping is not None
    assert robot.stopping.deceleration[0] == 4.0
    assert [robot.home[joint] for joint in row["joints"]] == row["home"]


def test_every_arm_has_a_home_and_open_fingers_where_it_has_some(
    tmp_path: Path,
) -> None:
    assert all(len(row["home"]) == len(row["joints"]) for row in ARMS.values())
    row = ARMS["fr3"]
    path = write_arm(
        tmp_path,
        [*row["joints"], "fr3_finger_joint1"],
        [*row["lengths"], 0.1],
        prefix="left_",
    )
    scene = Scene()
    scene.add_robot(path, name="arm")
    home = scene.robots["arm"].home
    assert home["left_fr3_finger_joint1"] == 0.035
    assert home["left_fr3_joint4"] == -2.3562
