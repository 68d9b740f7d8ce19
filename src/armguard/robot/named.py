"""Robots by name, from the package example-robot-data."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from armguard.errors import ModelError, did_you_mean

PACKAGE = "example-robot-data"


@dataclass(frozen=True, slots=True)
class NamedRobot:
    """Files of a robot, and where it is at home if its files do not say so well.

    Attributes:
        urdf: Its URDF; in `ROBOTS` below the package's folder of robots.
        srdf: Its SRDF, None if it has none.
        home: Home positions by joint name [rad or m].
    """

    urdf: Path
    srdf: Path | None = None
    home: Mapping[str, float] = field(default_factory=dict)


def in_package(
    urdf: str, srdf: str | None = None, home: Mapping[str, float] | None = None
) -> NamedRobot:
    """A robot of the package, by paths below its folder."""
    return NamedRobot(Path(urdf), Path(srdf) if srdf else None, home or {})


# The grippers of Baxter are closed at zero: the finger tips touch. Open, they keep the
# paper's buffer.
BAXTER_HOME = {
    "r_gripper_l_finger_joint": 0.020833,
    "l_gripper_l_finger_joint": 0.020833,
}

# The state the SRDF of the Jaco calls "arm_up" folds it onto itself; this is the
# vendor's home.
KINOVA_HOME = {
    "j2s6s200_joint_1": 4.80,
    "j2s6s200_joint_2": 2.92,
    "j2s6s200_joint_3": 1.00,
    "j2s6s200_joint_4": 4.20,
    "j2s6s200_joint_5": 1.44,
    "j2s6s200_joint_6": 1.32,
}

# At zero the xArm 7 is stretched straight, and the capsules round its bent links touch.
XARM7_HOME = {"joint2": -0.3, "joint4": 1.2, "joint6": 1.2}

ROBOTS = {
    "baxter": in_package(
        "baxter_description/urdf/baxter.urdf",
        "baxter_description/srdf/baxter_manipulation.srdf",
        BAXTER_HOME,
    ),
    "kinova": in_package(
        "kinova_description/robots/kinova.urdf",
        "kinova_description/srdf/kinova.srdf",
        KINOVA_HOME,
    ),
    "panda": in_package(
        "panda_description/urdf/panda.urdf", "panda_description/srdf/panda.srdf"
    ),
    "panda_capsules": in_package(
        "panda_description/urdf/panda_collision.urdf",
        "panda_description/srdf/panda.srdf",
    ),
    "ur3": in_package("ur_description/urdf/ur3_robot.urdf"),
    "ur5": in_package(
        "ur_description/urdf/ur5_robot.urdf", "ur_description/srdf/ur5.srdf"
    ),
    "ur10": in_package("ur_description/urdf/ur10_robot.urdf"),
    "xarm7": in_package(
        "xarm_description/urdf/xarm7.urdf",
        "xarm_description/srdf/xarm7.srdf",
        XARM7_HOME,
    ),
    "z1": in_package("z1_description/urdf/z1.urdf", "z1_description/srdf/z1.srdf"),
}


def robots_folder() -> Path:
    """Folder of the package's robots.

    Raises:
        ModelError: The package is not installed.
    """
    try:
        found = distribution(PACKAGE)
    except PackageNotFoundError:
        raise ModelError(
            f"robots by name need the package {PACKAGE}: pip install 'armguard[robots]'"
        ) from None
    marker = "example-robot-data/robots/"
    for file in found.files or []:
        head, mark, _ = file.as_posix().partition(marker)
        if mark:
            return Path(str(found.locate_file(head + mark)))
    raise ModelError(f"the installed {PACKAGE} has no robots in it")


def find_named_robot(name: str) -> NamedRobot:
    """Files of a robot by name.

    Raises:
        ModelError: Nobody has that name, or the package is not installed.
    """
    if name not in ROBOTS:
        raise ModelError(
            f"no robot is named '{name}', and there is no such file; "
            f"{did_you_mean(name, ROBOTS)}"
        )
    folder = robots_folder()
    robot = ROBOTS[name]
    return NamedRobot(
        folder / robot.urdf,
        None if robot.srdf is None else folder / robot.srdf,
        robot.home,
    )
