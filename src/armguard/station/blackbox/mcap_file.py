"""The bytes of an MCAP file, made in memory one piece after another.

Nothing here touches a disk: whoever writes the pieces can write one again, or give the
file up, without the others being hurt. Every chunk tells its channels itself, so any of
them can be read without the others.
"""

import zlib
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Message,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)

MAGIC = b"\x89MCAP0\r\n"

# Of the fields of a footer that its checksum covers, with the record's head.
FOOTER_SIZE = 8 + 8 + 4


class Topic(NamedTuple):
    """A channel and what its messages are.

    Attributes:
        number: Its number in every file.
        name: Its name.
        encoding: How its messages are written.
        schema: Name of their type; empty if they have none.
        definition: The type itself, as ROS 2 writes it.
    """

    number: int
    name: str
    encoding: str
    schema: str
    definition: str


class Stored(NamedTuple):
    """A message to be stored.

    Attributes:
        topic: Number of its channel.
        time: When it was, wall clock that never goes back [ns].
        data: The message.
    """

    topic: int
    time: int
    data: bytes


@dataclass
class McapBytes:
    """Makes the pieces of one file: `start`, chunks, `end`.

    Args:
        topics: Its channels.
        library: Who writes it.
    """

    topics: Sequence[Topic]
    library: str
    offset: int = 0
    chunk_index: RecordBuilder = field(default_factory=RecordBuilder)
    chunks: int = 0
    first: int = 0
    last: int = 0
    attached: list[AttachmentIndex] = field(default_factory=list)
    told: list[MetadataIndex] = field(default_factory=list)
    counts: dict[int, int] = field(default_factory=lambda: defaultdict(int))

    def start(self, about: Mapping[str, Mapping[str, Any]]) -> bytes:
        """The first bytes of a file.

        Args:
            about: Metadata by name.
        """
        out = RecordBuilder()
        out.write(MAGIC)
        Header(profile="ros2", library=self.library).write(out)
        for name, values in about.items():
            start = out.count
            told = {key: str(value) for key, value in values.items()}
            Metadata(name=name, metadata=told).write(out)
            self.told.append(
                MetadataIndex(offset=start, length=out.count - start, name=name)
            )
        return self._done(out)

    def attachment(self, name: str, kind: str, data: bytes, time: int) -> bytes:
        """A file within the file."""
        out = RecordBuilder()
        Attachment(
            create_time=time, log_time=time, name=name, media_type=kind, data=data
        ).write(out)
        self.attached.append(
            AttachmentIndex(
                offset=self.offset,
                length=out.count,
                log_time=time,
                create_time=time,
                data_size=len(data),
                name=name,
                media_type=kind,
            )
        )
        return self._done(out)

    def chunk(self, messages: Sequence[Stored]) -> bytes:
        """Messages, compressed, with their index."""
        inner = RecordBuilder()
        self._write_topics(inner)
        index: dict[int, list[tuple[int, int]]] = defaultdict(list)
        for topic, time, data in messages:
            index[topic].append((time, inner.count))
            Message(
                channel_id=topic,
                sequence=self.counts[topic],
                log_time=time,
                publish_time=time,
                data=data,
            ).write(inner)
            self.counts[topic] += 1
        raw = inner.end()
        times = [message.time for message in messages]
        chunk = Chunk(
            compression="zstd",
            data=zstandard.ZstdCompressor(level=3).compress(raw),
            message_start_time=min(times),
            message_end_time=max(times),
            uncompressed_crc=zlib.crc32(raw),
            uncompressed_size=len(raw),
        )
        out = RecordBuilder()
        chunk.write(out)
        length = out.count
        offsets = {}
        for topic, records in index.items():
            offsets[topic] = self.offset + out.count
            MessageIndex(channel_id=topic, records=records).write(out)
        # As bytes: as objects the index of an hour takes six times the room.
        ChunkIndex(
            chunk_start_offset=self.offset,
            chunk_length=length,
            compression=chunk.compression,
            compressed_size=len(chunk.data),
            uncompressed_size=chunk.uncompressed_size,
            message_start_time=chunk.message_start_time,
            message_end_time=chunk.message_end_time,
            message_index_length=out.count - length,
            message_index_offsets=offsets,
        ).write(self.chunk_index)
        self.first = min(times) if self.chunks == 0 else min(self.first, *times)
        self.last = max(self.last, *times)
        self.chunks += 1
        return self._done(out)

    def end(self) -> bytes:
        """The last bytes: what is where in the file."""
        out = RecordBuilder()
        DataEnd(0).write(out)
        start = self.offset + out.count
        summary = RecordBuilder()
        self._write_topics(summary)
        Statistics(
            attachment_count=len(self.attached),
            channel_count=len(self.topics),
            channel_message_counts=dict(self.counts),
            chunk_count=self.chunks,
            message_count=sum(self.counts.values()),
            message_start_time=self.first,
            message_end_time=self.last,
            metadata_count=len(self.told),
            schema_count=len([t for t in self.topics if t.schema]),
        ).write(summary)
        summary.write(self.chunk_index.end())
        for record in (*self.attached, *self.told):
            record.write(summary)
        data = summary.end()
        head = bytes([Opcode.FOOTER]) + FOOTER_SIZE.to_bytes(8, "little")
        fields = start.to_bytes(8, "little") + bytes(8)
        out.write(data)
        Footer(
            summary_start=start,
            summary_offset_start=0,
            summary_crc=zlib.crc32(data + head + fields),
        ).write(out)
        out.write(MAGIC)
        return self._done(out)

    def _write_topics(self, out: RecordBuilder) -> None:
        """Tell all channels, and the types of their messages."""
        for topic in self.topics:
            if topic.schema:
                Schema(
                    id=topic.number,
                    name=topic.schema,
                    encoding="ros2msg",
                    data=topic.definition.encode(),
                ).write(out)
            Channel(
                id=topic.number,
                schema_id=topic.number if topic.schema else 0,
                topic=topic.name,
                message_encoding=topic.encoding,
                metadata={},
            ).write(out)

    def _done(self, out: RecordBuilder) -> bytes:
        """The bytes of a piece; the next one stands behind it."""
        self.offset += out.count
        piece: bytes = out.end()
        return piece
