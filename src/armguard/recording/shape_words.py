"""Shapes as words: in events of a recording, and in calls that come by message."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from armguard.errors import ShapeError, did_you_mean
from armguard.geometry.shapes import SHAPES, Shape


def words_of(shape: Shape) -> dict[str, Any]:
    """A shape as its kind and its sizes."""
    return {"kind": shape.kind.name.lower(), **asdict(shape)}


def shape_of(words: Mapping[str, Any]) -> Shape:
    """The shape that words describe.

    Raises:
        ShapeError: There is no such kind, or it has no such sizes.
    """
    by_kind: dict[str, Any] = {made.kind.name.lower(): made for made in SHAPES.values()}
    kind = words.get("kind")
    if kind not in by_kind:
        near = did_you_mean(str(kind), by_kind)
        raise ShapeError(f"shape: there is no kind '{kind}'; {near}")
    sizes = {
        key: tuple(value) if isinstance(value, list) else value
        for key, value in words.items()
        if key != "kind"
    }
    try:
        made: Shape = by_kind[kind](**sizes)
    except TypeError as error:
        raise ShapeError(f"shape: a {kind} has no such sizes: {error}") from error
    return made
