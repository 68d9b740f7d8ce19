"""A scene file with some of its objects changed, and not one other letter.

The file is not written anew by a YAML library, which would fold lines and move
comments; entries are found by it, and their letters replaced. The new text is read
again and compared with the intended scene before it is returned.
"""

import difflib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.nodes import MappingNode, Node

from armguard.errors import SceneError
from armguard.geometry.pose import Pose
from armguard.scene.file import load_scene

Triple = tuple[float, float, float]

# Figures behind the point: tenths of millimetres, and of milliradians.
FIGURES = 4


@dataclass(frozen=True, slots=True)
class Entry:
    """New values of an object's entry.

    Attributes:
        pose: Its pose.
        size: Edges of its box; None where its shape stays as it is [m].
    """

    pose: Pose
    size: Triple | None = None


def edited(text: str, changes: Mapping[str, Entry | None]) -> str:
    """A scene file's text with objects changed.

    Args:
        text: The text.
        changes: New entries of objects, by name; None for one that is removed. One that
            is not there yet is added and needs a size.

    Raises:
        SceneError: The file is written in a way that cannot be edited so.
    """
    for name, entry in changes.items():
        before = values_of(text)
        text = without(text, name) if entry is None else with_entry(text, name, entry)
        check(before, values_of(text), name, entry)
    return text


def difference(before: str, after: str, name: str) -> str:
    """What changed in a file, as a unified diff."""
    lines = difflib.unified_diff(
        before.splitlines(), after.splitlines(), name, name, lineterm="", n=1
    )
    return "\n".join(lines)


def write_checked(path: Path, before: str, after: str) -> None:
    """Write a scene file if it still is what was shown, and can be loaded then.

    Raises:
        SceneError: It was changed meanwhile, or the scene would be wrong.
        OSError: It cannot be written.
    """
    if path.read_text(encoding="utf-8") != before:
        raise SceneError(
            f"'{path.name}' was changed meanwhile by another program; look at it, "
            "then write again"
        )
    # Beside the file, so that paths in it lead to the same places.
    trial = path.with_name(f".{path.name}.new")
    try:
        trial.write_text(after, encoding="utf-8")
        load_scene(trial)
        trial.chmod(path.stat().st_mode & 0o777)
        trial.replace(path)
    finally:
        trial.unlink(missing_ok=True)


def values_of(text: str) -> dict[str, Any]:
    """All values of the file."""
    values = YAML(typ="safe", pure=True).load(text)
    if not isinstance(values, dict):
        raise SceneError("the scene file is no mapping")
    return values


def check(
    before: dict[str, Any], after: dict[str, Any], name: str, entry: Entry | None
) -> None:
    """Check that an edit changed one entry as intended, and nothing besides.

    Raises:
        SceneError: It did not; the file is written in an unusual way.
    """
    objects = dict(before.get("objects") or {})
    old = objects.pop(name, {})
    if entry is not None:
        new = {**old, "at": place_of(entry.pose)}
        objects[name] = new if entry.size is None else {**new, "box": list(entry.size)}
    wanted, now = {**before, "objects": objects}, {**after}
    now["objects"] = now.get("objects") or {}
    if rounded(now) != rounded(wanted):
        raise SceneError(
            f"the entry of '{name}' is written in a way that cannot be edited from "
            "here; edit the file by hand"
        )


def rounded(value: Any) -> Any:
    """Numbers as the file writes them, so that they can be compared."""
    if isinstance(value, dict):
        return {key: rounded(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(item) for item in value]
    known = isinstance(value, int | float) and not isinstance(value, bool)
    return round(float(value), FIGURES) + 0.0 if known else value


def place_of(pose: Pose) -> dict[str, list[float]]:
    """A pose as the file has it."""
    place = {"xyz": rounded(pose.xyz)}
    if any(rounded(pose.rpy)):
        place["rpy"] = rounded(pose.rpy)
    return place


def flow(value: Any) -> str:
    """Mappings and lists of numbers in a line of YAML."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{k}: {flow(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(flow(v) for v in value) + "]"
    return f"{value:g}" if abs(value) < 1e4 else repr(value)


def item(mapping: Node | None, key: str) -> tuple[Node, Node] | None:
    """Key and value of a mapping's item, None if it has none."""
    pairs = mapping.value if isinstance(mapping, MappingNode) else ()
    return next((pair for pair in pairs if pair[0].value == key), None)


def entry_of(text: str, name: str) -> tuple[Node | None, tuple[Node, Node] | None]:
    """The mapping of objects, and the key and value of one."""
    found = item(YAML(typ="safe", pure=True).compose(text), "objects")
    objects = None if found is None else found[1]
    return objects, item(objects, name)


def without(text: str, name: str) -> str:
    """The text without an object."""
    objects, found = entry_of(text, name)
    if found is None or objects is None:
        raise SceneError(f"the scene file has no object '{name}'")
    if objects.flow_style:
        raise SceneError("objects are written in one line; edit the file by hand")
    lines = text.splitlines(keepends=True)
    del lines[found[0].start_mark.line : last_line(lines, found) + 1]
    return "".join(lines)


def last_line(lines: list[str], found: tuple[Node, Node]) -> int:
    """The last line of an item; blank lines and comments behind it are not its own."""
    mark = found[1].end_mark
    end = mark.line
    if end >= len(lines) or not lines[end][: mark.column].strip():
        # A block ends where the next one begins.
        end -= 1
    while end > found[0].start_mark.line:
        line = lines[end].strip() if end < len(lines) else ""
        if line and not line.startswith("#"):
            break
        end -= 1
    return int(end)


def with_entry(text: str, name: str, entry: Entry) -> str:
    """The text with a new entry of an object."""
    objects, found = entry_of(text, name)
    if found is None:
        return with_new(text, objects, name, entry)
    key, value = found
    if (
        not isinstance(value, MappingNode)
        or value.start_mark.index < key.end_mark.index
    ):
        raise SceneError(
            f"the entry of '{name}' is said elsewhere in the file; edit it by hand"
        )
    if entry.size is not None:
        if item(value, "box") is None:
            raise SceneError(f"'{name}' is no box in the file; its size cannot change")
        text = with_value(text, value, "box", flow(rounded(entry.size)))
        _, value = entry_of(text, name)[1] or found
    return with_value(text, value, "at", flow(place_of(entry.pose)))


def with_value(text: str, mapping: Node, key: str, value: str) -> str:
    """The text with one value of a mapping changed, or put at its end."""
    found = item(mapping, key)
    if found is not None:
        start, end = found[1].start_mark.index, found[1].end_mark.index
        if isinstance(found[1], MappingNode) and found[1].flow_style is not True:
            lines = text.splitlines(keepends=True)
            last = last_line(lines, found)
            end = len("".join(lines[: last + 1]).rstrip())
            start = found[0].end_mark.index
            value = f": {value}"
        return text[:start] + value + text[end:]
    if mapping.flow_style:
        end = mapping.end_mark.index - 1
        return f"{text[:end].rstrip()}, {key}: {value}{text[end:]}"
    first = mapping.value[0][0].start_mark
    indent = " " * first.column
    return f"{text[: first.index]}{key}: {value}\n{indent}{text[first.index :]}"


def with_new(text: str, objects: Node | None, name: str, entry: Entry) -> str:
    """The text with an object more, behind the last one."""
    if entry.size is None:
        raise SceneError(f"'{name}' is not in the scene file, and no box")
    values = {"box": rounded(entry.size), "at": place_of(entry.pose)}
    line = f"{name}: {flow(values)}\n"
    if not isinstance(objects, MappingNode) or not objects.value:
        if objects is not None:
            raise SceneError("objects are empty in the file; write the first by hand")
        return text.rstrip("\n") + f"\n\nobjects:\n  {line}"
    if objects.flow_style:
        raise SceneError("objects are written in one line; edit the file by hand")
    lines = text.splitlines(keepends=True)
    if not lines[-1].endswith("\n"):
        lines[-1] += "\n"
    at = last_line(lines, objects.value[-1])
    indent = " " * objects.value[-1][0].start_mark.column
    return "".join([*lines[: at + 1], indent + line, *lines[at + 1 :]])
