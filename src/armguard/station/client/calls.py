"""Calls of the service, and what came of them, in JSON."""

import json
from collections.abc import Mapping
from typing import Any

from armguard.station.errors import RefusedError
from armguard.station.wire.layout import REPLY


class Calls:
    """Asks one thing at a time; a call that is sent again is not done again.

    Attributes:
        number: Number of the last call.
        reply: What came of it, None as long as nothing did.
    """

    def __init__(self) -> None:
        self.number = 0
        self.reply: Mapping[str, Any] | None = None
        # Number of the message that asked last; replies name it.
        self._asked = 0

    def write(self, call: str, arguments: Mapping[str, Any]) -> bytes:
        """The next call, as it is sent."""
        self.number += 1
        self.reply = None
        request = {"id": self.number, "call": call, "arguments": arguments}
        return json.dumps(request, default=as_json).encode()

    def was_sent(self, sequence: int) -> None:
        """It is under way in a message of that number."""
        self._asked = sequence

    def take(self, payload: memoryview) -> None:
        """Take a REPLY over."""
        (asked,) = REPLY.unpack_from(payload)
        if asked == self._asked:
            self.reply = json.loads(bytes(payload[REPLY.size :]))

    def result(self) -> Any:
        """What the service answered.

        Raises:
            RefusedError: It refused.
        """
        reply = self.reply or {}
        if reply["ok"]:
            return reply["result"]
        raise RefusedError(reply["sentence"], reply["error"], reply.get("reason", ""))


def as_json(value: Any) -> Any:
    """What JSON has no word for: poses and arrays."""
    if hasattr(value, "matrix"):
        return value.matrix().tolist()
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} cannot be sent")
