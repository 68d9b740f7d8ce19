"""YAML that remembers lines, for messages that say where."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML, YAMLError
from ruamel.yaml.constructor import DuplicateKeyError
from ruamel.yaml.nodes import MappingNode, Node, SequenceNode

from armguard.errors import SceneError


@dataclass(frozen=True, slots=True)
class Problem:
    """One thing that is wrong in a file.

    Attributes:
        file: Name of the file.
        line: Line, 0 if it is about no line.
        path: Keys that lead to it, with dots.
        sentence: What is wrong, and what to do.
    """

    file: str
    line: int
    path: str
    sentence: str

    def __str__(self) -> str:
        """`scene.yaml:14: robots.left.base.rpy: expected 3 numbers, got 2`."""
        line = f":{self.line}" if self.line else ""
        path = f" {self.path}:" if self.path else ""
        return f"{self.file}{line}:{path} {self.sentence}"


class SceneFileError(SceneError):
    """A scene file is wrong; all that could be found at once.

    Attributes:
        problems: One by one.
    """

    def __init__(self, problems: list[Problem]) -> None:
        super().__init__("\n".join(map(str, problems)))
        self.problems = problems


class YamlSource:
    """A YAML file: its values, and the line of every key path.

    Args:
        path: The file.

    Raises:
        SceneFileError: It cannot be read, is not YAML, or has a key twice.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.values: Any
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8"
            raise self.problem(0, "", f"cannot be read: {reason}") from None
        try:
            self._root = YAML(typ="safe", pure=True).compose(text)
            self.values = YAML(typ="safe", pure=True).load(text)
        except DuplicateKeyError as error:
            mark = error.problem_mark
            key = str(error.problem).split('"')[1]
            raise self.problem(
                mark.line + 1, "", f"the key '{key}' is there twice; keep one"
            ) from None
        except YAMLError as error:
            found = getattr(error, "problem_mark", None)
            line = 0 if found is None else found.line + 1
            what = getattr(error, "problem", None) or str(error)
            raise self.problem(line, "", f"is not YAML: {what}") from None

    def problem(self, line: int, path: str, sentence: str) -> SceneFileError:
        """An error about this file with one problem."""
        return SceneFileError([Problem(self.path.name, line, path, sentence)])

    def line(self, keys: tuple[str | int, ...]) -> int:
        """Line of a key path, or of the longest beginning of it that exists."""
        node: Node | None = self._root
        line = 1
        for key in keys:
            found = None
            if isinstance(node, MappingNode):
                for name, value in node.value:
                    if str(name.value) == str(key):
                        line, found = name.start_mark.line + 1, value
            elif isinstance(node, SequenceNode) and isinstance(key, int):
                if key < len(node.value):
                    found = node.value[key]
                    line = found.start_mark.line + 1
            if found is None:
                return line
            node = found
        return line


def dotted(keys: tuple[str | int, ...]) -> str:
    """Key path as text.

    Example:
        >>> dotted(("robots", "left", "base", "rpy", 2))
        'robots.left.base.rpy[2]'
    """
    text = ""
    for key in keys:
        text += f"[{key}]" if isinstance(key, int) else f".{key}" if text else str(key)
    return text
