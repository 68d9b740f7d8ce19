"""Robots by name, from the package example-robot-data; a file of data for each."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from armguard.errors import ModelError

PACKAGE = "example-robot-data"

# Files of data: URDF, SRDF, home and stopping figures with their sources.
FOLDER = Path(__file__).with_name("named_robots")
ROBOTS = tuple(sorted(file.stem for file in FOLDER.glob("*.yaml")))


@dataclass(frozen=True, slots=True)
class NamedRobot:
    """Files of a robot, and its home if they do not give a good one.

    Attributes:
        urdf: Its URDF.
        srdf: Its SRDF, None if it has none.
        home: Home positions by joint name [rad or m].
    """

    urdf: Path
    srdf: Path | None = None
    home: Mapping[str, float] = field(default_factory=dict)


@cache
def robot_data(name: str) -> Mapping[str, Any]:
    """The file of data of a robot by name; paths are below the package's folder."""
    data: Mapping[str, Any] = YAML(typ="safe", pure=True).load(FOLDER / f"{name}.yaml")
    return data


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
        ModelError: No robot has that name, or the package is not installed.
    """
    if name not in ROBOTS:
        raise ModelError(
            f"no robot is named '{name}', and there is no such file; give a URDF, or "
            f"one of the named robots: {', '.join(ROBOTS)}"
        )
    folder, data = robots_folder(), robot_data(name)
    return NamedRobot(
        folder / data["urdf"],
        folder / data["srdf"] if "srdf" in data else None,
        data.get("home", {}),
    )
