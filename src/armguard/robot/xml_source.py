"""Strict reading of XML: no recovery, no entities, no network, lines kept."""

from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from armguard.bounded import read_bytes, shown
from armguard.errors import ModelError, PoseError
from armguard.geometry.pose import Pose

# Largest URDF or SRDF [byte].
MOST_XML_BYTES = 4_000_000

# Longest name [character].
MOST_TEXT = 255

Element = Any  # an lxml element; its stubs call it private


def read_xml(path: Path, *root_tags: str) -> Element:
    """Root element of an XML file.

    A description that has to be repaired is not one to guard by, so nothing is
    recovered; entities and external files are refused, since a robot needs none.

    Raises:
        ModelError: The file cannot be read, is not XML, has a DTD, is a xacro file, or
            has another root.
    """
    try:
        source = read_bytes(path, MOST_XML_BYTES)
    except OSError as error:
        raise ModelError(f"'{path}' cannot be read: {error.strerror}") from None
    return parse_xml(path, source, *root_tags)


def parse_xml(path: Path, source: bytes, *root_tags: str) -> Element:
    """Root element of a text; see `read_xml`.

    Args:
        path: The file messages name.
        source: Its text, or the URDF it was expanded to.
        root_tags: Tags the root may have.
    """
    if len(source) > MOST_XML_BYTES:
        raise ModelError(
            f"'{path.name}' has more than {MOST_XML_BYTES / 1e6:g} MB after its "
            "expansion, which is the limit"
        )
    if b"<!DOCTYPE" in source or b"<!ENTITY" in source:
        raise ModelError(f"'{path.name}' has a DTD or entities; a robot needs none")
    parser = etree.XMLParser(
        resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False
    )
    try:
        root = etree.fromstring(source, parser)
    except etree.XMLSyntaxError as error:
        raise ModelError(f"'{path.name}' is not XML: {shown(str(error.msg))}") from None
    if root.getroottree().docinfo.internalDTD is not None:
        raise ModelError(f"'{path.name}' has a DTD or entities; a robot needs none")
    if any("xacro" in str(element.tag) for element in root.iter("{*}*")):
        raise ModelError(
            f"'{path.name}' is a xacro file; name it with the ending .xacro: "
            f"`mv {path.name} {path.name}.xacro`"
        )
    if root.tag not in root_tags:
        raise ModelError(
            f"'{path.name}' starts with <{shown(str(root.tag))}>; it must be "
            f"{' or '.join(f'<{tag}>' for tag in root_tags)}"
        )
    return root


class Reader:
    """Reads attributes of one file's elements and complains with file and line.

    Attributes:
        file: Name of the file.
    """

    def __init__(self, file: str) -> None:
        self.file = file

    def fail(self, element: Element, sentence: str) -> ModelError:
        """An error that says where."""
        return ModelError(f"'{self.file}' line {element.sourceline}: {sentence}")

    def attribute(self, element: Element, name: str) -> str:
        """An attribute that has to be there."""
        value = element.get(name)
        if value is None or not value.strip():
            raise self.fail(element, f"<{element.tag}> has no {name}")
        if len(value) > MOST_TEXT:
            raise self.fail(
                element,
                f"<{element.tag}> {name} has {len(value):,} characters; the limit is "
                f"{MOST_TEXT:,}",
            )
        return str(value)

    def numbers(
        self, element: Element, name: str, count: int, default: str | None = None
    ) -> tuple[float, ...]:
        """An attribute of `count` finite numbers."""
        text = element.get(name, default)
        if text is None:
            raise self.fail(element, f"<{element.tag}> has no {name}")
        try:
            values = tuple(float(part) for part in text.split())
        except ValueError:
            values = ()
        if len(values) != count or not all(map(isfinite, values)):
            what = "a finite number" if count == 1 else f"{count} finite numbers"
            raise self.fail(
                element, f'<{element.tag}> {name} is "{shown(text)}"; it must be {what}'
            )
        return values

    def size(self, element: Element, name: str, count: int = 1) -> tuple[float, ...]:
        """An attribute of lengths, each > 0."""
        values = self.numbers(element, name, count)
        if not all(v > 0.0 for v in values):
            raise self.fail(
                element,
                f'<{element.tag}> {name} is "{element.get(name)}"; it must be > 0',
            )
        return values

    def origin(self, element: Element) -> NDArray[np.float64]:
        """Transform of an element's <origin>, identity if it has none, (4, 4)."""
        origin = element.find("origin")
        if origin is None:
            return np.eye(4)
        x, y, z = self.numbers(origin, "xyz", 3, "0 0 0")
        roll, pitch, yaw = self.numbers(origin, "rpy", 3, "0 0 0")
        try:
            return Pose(xyz=(x, y, z), rpy=(roll, pitch, yaw)).matrix()
        except PoseError as error:
            raise self.fail(origin, f"<origin> {error}") from None
