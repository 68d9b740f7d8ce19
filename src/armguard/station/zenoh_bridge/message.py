"""Messages that come in over Zenoh, while they wait to be handled."""

from typing import Any, NamedTuple

# A longer message is dropped unread [bytes].
MOST = 64 * 1024


class Message(NamedTuple):
    """A message.

    Attributes:
        name: What it is: "call", or the last parts of its key.
        expression: Its key.
        size: Bytes of its payload and attachment; if too many they are not kept.
        payload: Its payload.
        attachment: Its attachment.
        query: The query to reply to; None if there is none.
    """

    name: str
    expression: str
    size: int
    payload: bytes
    attachment: bytes
    query: Any = None

    @property
    def kind(self) -> str:
        """What is numbered on its own: "state", "wish", "stop" or "call"."""
        return self.name.partition("/")[0]

    @property
    def call(self) -> str:
        """What a query calls for; "" if it is none."""
        return self.expression.rpartition("/")[2] if self.query else ""


def message_of(name: str, expression: str, source: Any, query: Any = None) -> Message:
    """The message in a sample or query of Zenoh."""
    payload, attachment = source.payload, source.attachment
    size = len(payload or b"") + len(attachment or b"")
    if size > MOST:
        return Message(name, expression, size, b"", b"", query)
    return Message(
        name,
        expression,
        size,
        b"" if payload is None else payload.to_bytes(),
        b"" if attachment is None else attachment.to_bytes(),
        query,
    )
