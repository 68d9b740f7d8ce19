"""What a commander wants, as it is written into a message."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.station.errors import RefusedError
from armguard.station.wire.layout import TWIST, WISH, Form

Floats = NDArray[np.float64]


def put_wish(payload: memoryview, token: int, form: Form, values: ArrayLike) -> int:
    """Write a WISH; how many bytes it has.

    Args:
        payload: Where to.
        token: What the commander shows.
        form: What is wished for.
        values: As docs/service.md tells.
    """
    row = vector(values)
    WISH.pack_into(payload, 0, token, form, len(row))
    end = WISH.size + row.nbytes
    payload[WISH.size : end] = row.view(np.uint8).data
    return end


def twist_rows(tools: tuple[str, ...], twists: Mapping[str, ArrayLike]) -> Floats:
    """Twists as they are wished for: index of the tool, and six numbers, of each.

    Args:
        tools: All tools there are.
        twists: By tool, shape (6,) [m/s], [rad/s].

    Raises:
        RefusedError: There is no such tool.
    """
    rows = []
    for name, twist in twists.items():
        if name not in tools:
            raise RefusedError(f"the scene has no tool '{name}'")
        rows.append(np.concatenate(([tools.index(name)], vector(twist))))
    values = np.concatenate(rows) if rows else np.zeros(0)
    if len(values) != TWIST * len(rows):
        raise RefusedError("a twist has six numbers")
    return values


def vector(values: ArrayLike) -> Floats:
    """Numbers as a row of float64 in one piece."""
    return np.ascontiguousarray(values, dtype=np.float64).reshape(-1)
