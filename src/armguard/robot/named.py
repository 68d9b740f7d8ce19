"""Robots by name, from the package example-robot-data."""

from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import NamedTuple

from armguard.errors import ModelError, did_you_mean

PACKAGE = "example-robot-data"


class NamedRobot(NamedTuple):
    """Where a named robot lies in the package.

    Attributes:
        urdf: Path below the package's robots folder.
        srdf: Path of its SRDF, None if it has none.
    """

    urdf: str
    srdf: str | None = None


ROBOTS = {
    "baxter": NamedRobot(
        "baxter_description/urdf/baxter.urdf",
        "baxter_description/srdf/baxter_manipulation.srdf",
    ),
    "kinova": NamedRobot(
        "kinova_description/robots/kinova.urdf", "kinova_description/srdf/kinova.srdf"
    ),
    "panda": NamedRobot(
        "panda_description/urdf/panda.urdf", "panda_description/srdf/panda.srdf"
    ),
    "panda_capsules": NamedRobot(
        "panda_description/urdf/panda_collision.urdf",
        "panda_description/srdf/panda.srdf",
    ),
    "ur3": NamedRobot("ur_description/urdf/ur3_robot.urdf"),
    "ur5": NamedRobot(
        "ur_description/urdf/ur5_robot.urdf", "ur_description/srdf/ur5.srdf"
    ),
    "ur10": NamedRobot("ur_description/urdf/ur10_robot.urdf"),
    "xarm7": NamedRobot(
        "xarm_description/urdf/xarm7.urdf", "xarm_description/srdf/xarm7.srdf"
    ),
    "z1": NamedRobot("z1_description/urdf/z1.urdf", "z1_description/srdf/z1.srdf"),
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


def find_named_robot(name: str) -> tuple[Path, Path | None]:
    """URDF and SRDF of a robot by name.

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
    return folder / robot.urdf, folder / robot.srdf if robot.srdf else None
