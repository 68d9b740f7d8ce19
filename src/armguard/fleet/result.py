"""Rows of results."""

import json
from math import isfinite
from typing import Any

from armguard.fleet.inputs import Input
from armguard.fleet.manifest import Manifest
from armguard.fleet.store import COLUMNS


def empty_row(one: Input, frames: int) -> dict[str, Any]:
    """A result that says nothing yet."""
    row: dict[str, Any] = dict.fromkeys(COLUMNS)
    row |= {"input": one.source, "episode": one.episode, "frames": frames}
    row |= {"contacts": 0, "beyond_limits": 0, "jumps": 0, "frozen": 0, "clear": False}
    row["findings"] = []
    return row


def finding(
    kind: str,
    a: str = "",
    b: str = "",
    start: float | None = None,
    end: float | None = None,
    value: float | None = None,
    text: str = "",
) -> dict[str, Any]:
    """One finding, see `store.FINDING`."""
    figures = {"start": start, "end": end, "value": value}
    plain = {
        name: None if one is None or not isfinite(one) else float(one)
        for name, one in figures.items()
    }
    return {"kind": kind, "a": a, "b": b, **plain, "text": text}


def item_row(manifest: Manifest, item: int, row: dict[str, Any]) -> dict[str, Any]:
    """A result with the number, the scene and the setting of its item."""
    scene, settings = manifest.groups[manifest.item(item)[0]]
    text = json.dumps(settings, sort_keys=True)
    return row | {"item": item, "scene": scene, "setting": text}


def failed_row(one: Input, error: str) -> dict[str, Any]:
    """The result of an input that cannot be judged."""
    return empty_row(one, one.frames) | {"error": error}
