"""Rows of results."""

import json
from collections.abc import Sequence
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


def item_rows(
    manifest: Manifest, first: int, rows: Sequence[dict[str, Any]]
) -> list[dict[str, Any]]:
    """Results with the numbers, the scene and the setting of their items.

    Args:
        manifest: The manifest.
        first: The first item; the others follow it in the same scene and setting.
        rows: Results of the items.
    """
    scene, settings = manifest.groups[manifest.item(first)[0]]
    where = {"scene": scene, "setting": json.dumps(settings, sort_keys=True)}
    return [row | {"item": k} | where for k, row in enumerate(rows, first)]


def failed_row(one: Input, error: str) -> dict[str, Any]:
    """The result of an input that cannot be judged."""
    return empty_row(one, one.frames) | {"error": error}
