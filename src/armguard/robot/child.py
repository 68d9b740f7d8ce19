"""Other formats to URDF, each by its own library in a child process with limits."""

import json
import resource
import subprocess
import sys
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from armguard.errors import ModelError
from armguard.robot.xml_source import MOST_XML_BYTES

# Longest conversion [s].
MOST_SECONDS = 30.0

# Largest address space of the child [byte].
MOST_MEMORY = 4_000_000_000

# Longest message of a library that is shown [character].
MOST_MESSAGE = 400


def convert(
    module: str,
    path: Path,
    order: Mapping[str, Any],
    seconds: float,
    *,
    kind: str,
    package: str,
    endless: str,
    refusal: Callable[[str, str], str],
) -> bytes:
    """The URDF that the function `main` of a module makes of a file.

    Args:
        module: Name of the module; its `main` runs in the child process.
        path: The file.
        order: Values that `given` returns there, beside the path.
        seconds: Longest conversion [s].
        kind: Name of the format; in lower case, of the extra.
        package: The library that reads it.
        endless: Likely causes of a longer conversion.
        refusal: Makes one sentence of the name of the file and the child's message.

    Raises:
        ModelError: The library is not installed, refuses the file, or takes too long.
    """
    if find_spec(package) is None:
        raise ModelError(
            f"'{path.name}' is a {kind} file; the package {package} is not installed: "
            f'pip install "armguard[{kind.lower()}]"'
        )
    try:
        ended = subprocess.run(
            [sys.executable, "-P", "-c", f"from {module} import main; main()"],
            input=json.dumps({"path": str(path.resolve()), **order}).encode(),
            capture_output=True,
            check=False,
            timeout=seconds,
        )
    except subprocess.TimeoutExpired:
        raise ModelError(
            f"'{path.name}' is not expanded after {seconds:g} s; look for {endless}"
        ) from None
    if ended.returncode != 0:
        said = " ".join(ended.stderr.decode(errors="replace").split())
        said = said or f"the expansion ended with code {ended.returncode}"
        raise ModelError(refusal(path.name, said))
    return ended.stdout


def answer(urdf: bytes) -> None:
    """In the child: hand the URDF over; what is too large is cut, and refused there."""
    sys.stdout.buffer.write(urdf[: MOST_XML_BYTES + 1])


def given() -> Any:
    """In the child: limit its memory, and read its order."""
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    return json.load(sys.stdin)
