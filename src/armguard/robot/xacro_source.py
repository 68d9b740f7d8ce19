"""Xacro to URDF, in a child process: xacro evaluates Python expressions of its file."""

import json
import resource
import subprocess
import sys
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

from armguard.bounded import is_file, shown
from armguard.errors import ModelError
from armguard.robot.packages import candidates, package_name

# Longest expansion [s].
MOST_SECONDS = 30.0

# Largest address space of the child [byte].
MOST_MEMORY = 4_000_000_000

# Longest message of xacro that is shown [character].
MOST_MESSAGE = 400

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
    if find_spec("xacro") is None:
        raise ModelError(
            f"'{path.name}' is a xacro file; the package xacro is not installed: "
            'pip install "armguard[xacro]"'
        )
    order = {
        "path": str(path.resolve()),
        "packages": {name: str(at.resolve()) for name, at in (packages or {}).items()},
        "arguments": {name: written(v) for name, v in (arguments or {}).items()},
    }
    try:
        ended = subprocess.run(
            [sys.executable, "-P", "-c", f"from {__name__} import main; main()"],
            input=json.dumps(order).encode(),
            capture_output=True,
            check=False,
            timeout=seconds,
        )
    except subprocess.TimeoutExpired:
        raise ModelError(
            f"'{path.name}' is not expanded after {seconds:g} s; look for a macro or "
            f"an expression without an end: `xacro {path.name}`"
        ) from None
    if ended.returncode != 0:
        said = ended.stderr.decode(errors="replace").strip().splitlines()
        raise ModelError(refusal(path.name, said, ended.returncode))
    return ended.stdout


def refusal(file: str, said: list[str], code: int) -> str:
    """One sentence from the lines xacro wrote before it ended with a code."""
    message = " ".join(line.strip() for line in said)[:MOST_MESSAGE]
    if MISSING in message:
        name = message.split(MISSING, 1)[1].split()[0].strip("'\":;")
        return (
            f"'{file}' needs the xacro argument '{shown(name)}'; add "
            f"`xacro_args: {{{shown(name)}: VALUE}}`"
        )
    message = message or f"the expansion ended with code {code}"
    return f"'{file}' cannot be expanded: {message}; correct the xacro file"


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
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    order = json.load(sys.stdin)
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
        xacro.print_location()
        sys.exit(f"{error or type(error).__name__}")
    sys.stdout.write(text)
