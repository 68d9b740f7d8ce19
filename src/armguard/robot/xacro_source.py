"""Xacro to URDF, in a child process: xacro evaluates Python expressions of its file."""

import sys
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType

from armguard.bounded import is_file, shown
from armguard.errors import ModelError
from armguard.robot.child import MOST_MESSAGE, MOST_SECONDS, answer, convert, given
from armguard.robot.packages import candidates, package_name

# How xacro's message of a missing argument begins.
MISSING = "Undefined substitution argument"

Argument = str | bool | int | float


def expand_xacro(
    path: Path,
    packages: Mapping[str, Path] | None = None,
    arguments: Mapping[str, Argument] | None = None,
    seconds: float = MOST_SECONDS,
) -> bytes:
    """The URDF a xacro file describes.

    Args:
        path: The xacro file.
        packages: Folders of packages by name, for `$(find NAME)`.
        arguments: Values of its arguments by name.
        seconds: Longest expansion [s].

    Raises:
        ModelError: xacro is not installed, refuses the file, or takes too long.
    """
    order = {
        "packages": {name: str(at.resolve()) for name, at in (packages or {}).items()},
        "arguments": {name: written(v) for name, v in (arguments or {}).items()},
    }
    return convert(
        __name__,
        path,
        order,
        seconds,
        kind="xacro",
        package="xacro",
        endless=f"a macro or an expression without an end: `xacro {path.name}`",
        refusal=refusal,
    )


def refusal(file: str, message: str) -> str:
    """One sentence from the message of the child."""
    if MISSING in message:
        name = (message.split(MISSING, 1)[1].split() or ["NAME"])[0].strip("'\":;")
        return (
            f"'{file}' needs the xacro argument '{shown(name)}'; add "
            f"`xacro_args: {{{shown(name)}: VALUE}}`"
        )
    return (
        f"'{file}' cannot be expanded: {message[:MOST_MESSAGE]}; correct the xacro file"
    )


def written(value: Argument) -> str:
    """An argument as xacro reads it; YAML's true and false are xacro's."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def find_package(name: str, path: Path, packages: Mapping[str, Path]) -> Path:
    """Folder of a package, found as `package://` names are.

    Raises:
        ModelError: It is not found.
    """
    if name in packages:
        return packages[name]
    for place in candidates(f"package://{name}/package.xml", path, packages, []):
        if is_file(place) and package_name(place.parent) == name:
            return place.parent
    raise ModelError(
        f"package '{shown(name)}' is not found, set its folder: "
        f"`packages: {{{shown(name)}: FOLDER}}`"
    )


def main() -> None:
    """Expand the file that standard input names; the URDF goes to standard output."""
    order = given()
    path = Path(order["path"])
    packages = {name: Path(at) for name, at in order["packages"].items()}
    # xacro imports this module of ROS for `$(find NAME)`.
    finder = ModuleType("ament_index_python.packages")
    finder.__dict__["get_package_share_directory"] = lambda name: str(
        find_package(name, path, packages)
    )
    sys.modules["ament_index_python"] = ModuleType("ament_index_python")
    sys.modules["ament_index_python.packages"] = finder
    import xacro

    try:
        text = xacro.process_file(str(path), mappings=order["arguments"]).toxml()
    except (Exception, SystemExit) as error:
        # The error first: places of nested macros fill a message.
        print(f"{error or type(error).__name__}", file=sys.stderr)
        xacro.print_location()
        sys.exit(1)
    answer(text.encode())
