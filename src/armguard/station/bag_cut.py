"""A bag of ROS 2 in MCAP whose recorder was killed: what is there, up to the cut."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True, slots=True)
class CutConnection:
    """A topic of a cut bag.

    Attributes:
        id: Number of its channel.
        topic: Its name.
        msgtype: Type of its messages.
    """

    id: int
    topic: str
    msgtype: str


class CutBag:
    """Reads records one after another, and asks for no index at the end.

    Attributes:
        connections: Its topics.
        count: Messages before the cut.

    Args:
        path: The file.
        typestore: Knows messages whose definition is not in the bag; filled with those
            that are.
    """

    def __init__(self, path: Path, typestore: Any) -> None:
        from rosbags.typesys import get_types_from_msg

        self._path, self._types = path, typestore
        found: dict[int, CutConnection] = {}
        self.count = 0
        for schema, channel, _ in self._records():
            self.count += 1
            if channel.id in found:
                continue
            if schema.encoding == "ros2msg":
                text = schema.data.decode("utf-8", errors="replace")
                known = get_types_from_msg(text, schema.name)
                fresh = {k: v for k, v in known.items() if k not in typestore.types}
                typestore.register(fresh)
            found[channel.id] = CutConnection(channel.id, channel.topic, schema.name)
        self.connections = list(found.values())

    def messages(
        self, connections: Collection[CutConnection]
    ) -> Iterator[tuple[CutConnection, int, bytes]]:
        """Topic, time of receipt [ns] and bytes of each message."""
        wanted = {connection.id: connection for connection in connections}
        for _, channel, message in self._records():
            if channel.id in wanted:
                yield wanted[channel.id], message.log_time, message.data

    def deserialize(self, raw: bytes, kind: str) -> Any:
        """A message of its bytes."""
        return self._types.deserialize_cdr(raw, kind)

    def _records(self) -> Iterator[tuple[Any, Any, Any]]:
        """Schema, channel and message of each message before the cut."""
        from mcap.records import Channel, Message, Schema
        from mcap.stream_reader import StreamReader

        schemas: dict[int, Any] = {}
        channels: dict[int, Any] = {}
        with self._path.open("rb") as file:
            try:
                for record in StreamReader(file, validate_crcs=True).records:
                    if isinstance(record, Schema):
                        schemas[record.id] = record
                    elif isinstance(record, Channel):
                        channels[record.id] = record
                    elif isinstance(record, Message):
                        channel = channels[record.channel_id]
                        yield schemas[channel.schema_id], channel, record
            except Exception:
                # Where the file ends the library raises whatever it stumbles over.
                return
