"""YAML that remembers lines, for messages that say where; of bounded size."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML, YAMLError
from ruamel.yaml.composer import Composer, MaxDepthExceededError
from ruamel.yaml.constructor import DuplicateKeyError
from ruamel.yaml.error import MarkedYAMLError
from ruamel.yaml.events import AliasEvent
from ruamel.yaml.nodes import MappingNode, Node, SequenceNode

from armguard.bounded import read_text, shown
from armguard.errors import SceneError

# Keys that lead to a value; those of a list are numbers.
Keys = tuple[str | int, ...]

# Largest YAML file [byte].
MOST_YAML_BYTES = 8_000_000

# Keys, values, lists and mappings of a file, an alias and a merge key counted as often
# as what it names; some 10,000 are parsed in a second.
MOST_YAML_NODES = 100_000

# Lists and mappings within each other.
MOST_YAML_DEPTH = 40

# Longest key or value [character].
MOST_YAML_TEXT = 4_000


@dataclass(frozen=True, slots=True)
class Problem:
    """What is wrong at one place of a file.

    Attributes:
        file: Name of the file.
        line: Line, 0 if it is about no line.
        path: Keys that lead to it, with dots.
        sentence: What is wrong, and what to do.
        robots: Names of the robots that lack a line.
        paste: That line; "" if none is known.
    """

    file: str
    line: int
    path: str
    sentence: str
    robots: tuple[str, ...] = ()
    paste: str = ""

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


class TooLargeError(MarkedYAMLError):  # type: ignore[misc]
    """A YAML file is larger, deeper or longer than is accepted."""


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
        self._root: Node | None = None
        try:
            text = read_text(path, MOST_YAML_BYTES)
        except (OSError, UnicodeDecodeError) as error:
            reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8"
            raise self._unread(0, f"cannot be read: {reason}") from None
        try:
            self._root, self.values = parse_yaml(text)
        except YAMLError as error:
            mark = getattr(error, "problem_mark", None)
            line = 0 if mark is None else mark.line + 1
            raise self._unread(line, sentence_of_yaml(error)) from None

    def _unread(self, line: int, sentence: str) -> SceneFileError:
        return SceneFileError([Problem(self.path.name, line, "", sentence)])

    def found(self, keys: Keys, sentence: str) -> Problem:
        """A problem of a key path."""
        return Problem(self.path.name, self.line(keys), dotted(keys), sentence)

    def problem(self, keys: Keys, sentence: str) -> SceneFileError:
        """An error about this file with one problem, that of a key path."""
        return SceneFileError([self.found(keys, sentence)])

    def line(self, keys: Keys) -> int:
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


class BoundedComposer(Composer):  # type: ignore[misc]
    """Counts nodes while it makes them, aliases as often as what they name."""

    def __init__(self, loader: Any = None) -> None:
        super().__init__(loader=loader)
        self.warn_double_anchors = False
        self.nodes = 0
        self.sizes: dict[int, int] = {}

    def compose_node(self, parent: Any, index: Any) -> Any:
        """One node, unless there are too many.

        Raises:
            TooLargeError: There are too many, or it is an alias of what it is in.
        """
        self.nodes += 1
        if self.nodes > MOST_YAML_NODES:
            raise too_many(self.parser.peek_event())
        is_alias = self.parser.check_event(AliasEvent)
        node = super().compose_node(parent, index)
        if not is_alias:
            size = 1 + sum(self.sizes[id(child)] for child in children_of(node))
            if size > MOST_YAML_NODES:
                raise too_many(node)
            self.sizes[id(node)] = size
        elif id(node) not in self.sizes:
            raise too_large("has an anchor that holds itself", node)
        return node

    def compose_scalar_node(self, anchor: Any) -> Any:
        """A key or a value, unless it is too long.

        Raises:
            TooLargeError: It is too long.
        """
        node = super().compose_scalar_node(anchor)
        if len(node.value) > MOST_YAML_TEXT:
            raise too_large(
                f"has {len(node.value):,} characters in one value; the limit is "
                f"{MOST_YAML_TEXT:,}",
                node,
            )
        return node


def parse_yaml(text: str) -> tuple[Node | None, Any]:
    """The nodes of a YAML document, and its values.

    Raises:
        YAMLError: It is not YAML, or larger than is accepted.
    """
    yaml = YAML(typ="safe", pure=True)
    yaml.Composer = BoundedComposer
    yaml.max_depth = MOST_YAML_DEPTH
    try:
        root = yaml.compose(text)
        if root is None:
            return None, None
        # Merge keys rewrite the nodes they are in; lines are asked of the first ones.
        values = YAML(typ="safe", pure=True).constructor.construct_document(root)
    except MaxDepthExceededError as error:
        raise TooLargeError(
            problem=f"nests more than {MOST_YAML_DEPTH} lists and mappings",
            problem_mark=error.problem_mark,
        ) from None
    except (YAMLError, MemoryError):
        raise
    except Exception as error:  # constructors of numbers and dates have their own
        raise YAMLError(str(error)) from None
    return root, values


def sentence_of_yaml(error: YAMLError) -> str:
    """What is wrong with a YAML file, to follow its name."""
    what = str(getattr(error, "problem", None) or shown(str(error)))
    if isinstance(error, DuplicateKeyError):
        key = what.split('"')[1]
        return f"the key '{key}' is there twice; keep one"
    return what if isinstance(error, TooLargeError) else f"is not YAML: {what}"


def children_of(node: Node) -> list[Node]:
    """Nodes inside of a node."""
    if isinstance(node, MappingNode):
        return [child for pair in node.value for child in pair]
    return list(node.value) if isinstance(node, SequenceNode) else []


def too_many(place: Any) -> TooLargeError:
    """An error about more nodes than are accepted."""
    return too_large(
        f"has more than {MOST_YAML_NODES:,} keys and values, aliases and merge keys "
        "expanded; give large objects as meshes, or add them in Python",
        place,
    )


def too_large(sentence: str, place: Any) -> TooLargeError:
    """An error about a node or an event."""
    return TooLargeError(problem=sentence, problem_mark=place.start_mark)


def dotted(keys: Keys) -> str:
    """Key path as text.

    Example:
        >>> dotted(("robots", "left", "base", "rpy", 2))
        'robots.left.base.rpy[2]'
    """
    parts = (f"[{k}]" if isinstance(k, int) else f".{shown(str(k))}" for k in keys)
    return "".join(parts).removeprefix(".")
