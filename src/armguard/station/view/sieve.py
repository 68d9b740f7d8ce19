"""What pages say to viser, with everything else sifted out.

Only the five messages that our page sends get through, each with the fields and types
that it is declared with. Viser itself would act on any attribute a message names.
"""

import logging
import math
import time
from collections.abc import Callable
from typing import Any

import msgspec
import viser._messages as said
from websockets.asyncio.server import ServerConnection

log = logging.getLogger("armguard.view")

MESSAGES: dict[str, type[Any]] = {
    kind.__name__: kind
    for kind in (
        said.ViewerCameraMessage,
        said.GuiUpdateMessage,
        said.TransformControlsDragStartMessage,
        said.TransformControlsUpdateMessage,
        said.TransformControlsDragEndMessage,
    )
}

# Time between two lines about messages that were dropped [s].
PAUSE = 1.0

# Least length of a quaternion that is a rotation [-].
TURN = 1e-6


class Drops:
    """Says that messages were dropped, a line a second at most."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._count, self._said = 0, -math.inf

    def add(self, why: str) -> None:
        """Count a message that was dropped."""
        self._count += 1
        if self._clock() - self._said >= PAUSE:
            log.warning("dropped %d messages of pages: %s", self._count, why)
            self._count, self._said = 0, self._clock()


class Sifted:
    """A connection of viser's that hears nothing but what a page of ours says.

    Args:
        connection: The connection.
        drops: Where messages are counted that were dropped.
    """

    def __init__(self, connection: ServerConnection, drops: Drops) -> None:
        self._connection, self._drops = connection, drops

    def __getattr__(self, name: str) -> Any:
        return getattr(self._connection, name)

    async def recv(self) -> bytes:
        """The next message that a page of ours may send."""
        while True:
            message = await self._connection.recv()
            why = fault_of(message)
            if not why and isinstance(message, bytes):
                return message
            self._drops.add(why)


def fault_of(message: bytes | str) -> str:
    """Why a message is none that our page sends; empty if it is one."""
    if isinstance(message, str):
        return "a text where viser's messages are binary"
    try:
        fields = msgspec.msgpack.decode(message, type=dict[str, Any])
        kind = str(fields.pop("type", ""))
        if kind not in MESSAGES:
            return f"'{kind[:40]}' is no message of the page"
        read = msgspec.convert(fields, MESSAGES[kind])
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
        return str(error)[:200]
    if isinstance(read, said.GuiUpdateMessage):
        return fault_of_value(read.updates)
    for name in fields:
        value = getattr(read, name, 0.0)
        parts = value if isinstance(value, tuple) else (value,)
        if not all(math.isfinite(part) for part in parts if isinstance(part, float)):
            return f"'{name}' of a {kind} is not finite"
    turn = getattr(read, "wxyz", None)
    if turn is not None and math.hypot(*turn) < TURN:
        return f"'wxyz' of a {kind} is no rotation"
    return ""


def fault_of_value(updates: dict[str, Any]) -> str:
    """Why an update of a control is none that our page sends."""
    if updates.keys() != {"value"}:
        return "an update of a control sets its value and nothing else"
    value = updates["value"]
    parts = value if isinstance(value, list) else [value]
    for part in parts:
        if not isinstance(part, bool | int | float | str):
            return (
                "the value of a control is a truth, a number, a text or a list of them"
            )
        if isinstance(part, int | float) and not abs(part) < 1e300:
            return "the value of a control is not finite"
    return ""
