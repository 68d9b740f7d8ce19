"""Recordings as MCAP files: written by the library, read as far as they are whole.

A file may be cut off or damaged, and its index is not used: it is searched for chunks
whose checksum is right. A wrong bit costs the chunk it is in, a cut the chunk it goes
through, and nothing else. Unreadable bytes are reported with their place.
"""

import mmap
import struct
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping

import zstandard
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC as MAGIC
from mcap.writer import Writer

from armguard.recording.ros import TOPICS, Stored, definition

Data = bytes | mmap.mmap

# Of a record: what it is, and how long.
RECORD = struct.Struct("<BQ")

# Of a chunk: first and last time, size and checksum of what is in it; then how it is
# compressed, which in ours is always the same, and how long that is.
CHUNK_HEAD = struct.Struct("<QQQI")
COMPRESSED = b"\x04\x00\x00\x00zstd"
BEHIND = RECORD.size + CHUNK_HEAD.size

# Of a message: its channel, its number, two times.
MESSAGE_HEAD = struct.Struct("<HIQQ")

# Records there are.
OPCODES = frozenset(Opcode)

# A chunk that claims to be larger is damage, and gets no memory.
MOST_BYTES = 128 << 20

# Messages of about so many bytes make a chunk: a wrong bit costs no more than one.
CHUNK_SIZE = 128 << 10


class Sink:
    """A file for the library: hands on whole records and keeps nothing."""

    def __init__(self, put: Callable[[bytes], object]) -> None:
        # Bytes handed on.
        self._put, self.size = put, 0

    def write(self, data: bytes) -> None:
        """Hand a piece on: one record or several, all of them whole."""
        if data:
            self.size += len(data)
            self._put(data)

    def tell(self) -> int:
        """Position of the next piece in the file."""
        return self.size

    def flush(self) -> None:
        """Nothing is kept back."""


class McapFile:
    """A recording that is being written: attachments, messages, and an end.

    The library's index of the file grows by 1 kB a chunk and is let go with the file.

    Args:
        put: Takes the file's bytes, piece by piece.
        library: Name and version of the program that writes it.
        about: Metadata by name.
    """

    def __init__(
        self,
        put: Callable[[bytes], object],
        library: str,
        about: Mapping[str, Mapping[str, object]],
    ) -> None:
        self._sink, self._counts = Sink(put), Counter[int]()
        self._writer = Writer(self._sink, chunk_size=CHUNK_SIZE)
        self._writer.start(profile="ros2", library=library)
        for topic in TOPICS:
            schema, encoding = 0, "armguard"
            if topic.schema:
                text = definition(topic.schema).encode()
                schema = self._writer.register_schema(topic.schema, "ros2msg", text)
                encoding = "cdr"
            self._writer.register_channel(topic.name, encoding, schema)
        for name, values in about.items():
            words = {key: str(value) for key, value in values.items()}
            self._writer.add_metadata(name, words)

    @property
    def size(self) -> int:
        """Bytes so far."""
        return self._sink.size

    def attach(self, name: str, kind: str, data: bytes, time: int) -> None:
        """Add a file within the file."""
        self._writer.add_attachment(time, time, name, kind, data)

    def add(self, message: Stored) -> None:
        """Add a message; it is handed on with its chunk, at the latest by `flush`."""
        topic, time, data = message
        self._writer.add_message(topic, time, data, time, self._counts[topic])
        self._counts[topic] += 1

    def flush(self) -> None:
        """Hand on what was added."""
        self._writer.flush()

    def end(self) -> None:
        """Hand on the rest, and what is where in the file."""
        self._writer.finish()


def chunks(data: Data, problems: list[str]) -> Iterator[bytes]:
    """What is in every chunk that is whole, in order.

    Args:
        data: The file.
        problems: What is missing is added here, in words.
    """
    if data[: len(MAGIC)] != MAGIC:
        problems.append("the file does not begin like an MCAP file")
    at, look, end = len(MAGIC), len(MAGIC), len(data)
    while (tag := data.find(COMPRESSED, look + BEHIND)) >= 0:
        found = chunk_at(data, tag - BEHIND)
        if found is None:
            # Damaged; or something else that holds this word.
            look = tag + 1 - BEHIND
            continue
        check_between(data, at, tag - BEHIND, problems)
        inner, at = found
        look = at
        yield inner
    # What is behind the last chunk: the end of the file, if it was written.
    if end < at + len(MAGIC) or data[end - len(MAGIC) :] != MAGIC:
        problems.append(
            f"the file was cut off: {end - at} bytes behind its last whole chunk"
        )
    else:
        check_between(data, at, end - len(MAGIC), problems)


def chunk_at(data: Data, start: int) -> tuple[bytes, int] | None:
    """What is in the chunk that starts there, and where it ends; None if not whole."""
    kind, length = RECORD.unpack_from(data, start)
    _, _, size, checksum = CHUNK_HEAD.unpack_from(data, start + RECORD.size)
    at = start + BEHIND + len(COMPRESSED) + 8
    if kind != Opcode.CHUNK or at > len(data) or size > MOST_BYTES:
        return None
    (compressed,) = struct.unpack_from("<Q", data, at - 8)
    behind = at + compressed
    if behind > len(data) or length != behind - start - RECORD.size:
        return None
    try:
        inner = unpacked(data[at:behind], size)
    except ValueError:
        return None
    if zlib.crc32(inner) != checksum:
        return None
    return inner, behind


def unpacked(data: bytes, size: int) -> bytes:
    """Compressed bytes, which are `size` bytes long.

    Raises:
        ValueError: They are damaged, or of another length.
    """
    try:
        # The library allocates the length that the data itself declares.
        said = zstandard.get_frame_parameters(data).content_size
        if said not in (size, zstandard.CONTENTSIZE_UNKNOWN):
            raise ValueError(
                f"{said} bytes are compressed where there should be {size}"
            )
        raw: bytes = zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
    except zstandard.ZstdError as error:
        raise ValueError(str(error)) from error
    if len(raw) != size:
        raise ValueError(f"{len(raw)} bytes were compressed and should be {size}")
    return raw


def span_of(data: Data) -> tuple[int, ...]:
    """First and last time of messages, by the heads of chunks alone [ns]."""
    found: list[int] = []
    for tag in data.find(COMPRESSED, len(MAGIC) + BEHIND), data.rfind(COMPRESSED):
        start = tag - BEHIND
        if start >= 0 and data[start] == Opcode.CHUNK:
            found += CHUNK_HEAD.unpack_from(data, start + RECORD.size)[:2]
    return tuple(found)


def check_between(data: Data, start: int, end: int, problems: list[str]) -> None:
    """Note what between two whole chunks is no record."""
    at = start
    while at + RECORD.size <= end:
        kind, length = RECORD.unpack_from(data, at)
        behind = at + RECORD.size + length
        # A chunk, perhaps one whose very first byte is wrong.
        inside = data[at + BEHIND : at + BEHIND + len(COMPRESSED)] == COMPRESSED
        if kind not in OPCODES - {Opcode.CHUNK} or behind > end or inside:
            break
        at = behind
    if at != end:
        problems.append(f"bytes {at} to {end} of the file are damaged")


def messages(inner: bytes) -> Iterator[Stored]:
    """The messages of a chunk."""
    at = 0
    while at + RECORD.size <= len(inner):
        kind, length = RECORD.unpack_from(inner, at)
        at += RECORD.size
        if kind == Opcode.MESSAGE and MESSAGE_HEAD.size <= length <= len(inner) - at:
            topic, _, time, _ = MESSAGE_HEAD.unpack_from(inner, at)
            yield Stored(topic, time, inner[at + MESSAGE_HEAD.size : at + length])
        at += length


def attachment(data: Data, name: str) -> bytes | None:
    """The attached file of that name; None if no whole copy of it is there."""
    word = struct.pack("<I", len(name.encode())) + name.encode()
    at = -1
    while (at := data.find(word, at + 1)) >= 0:
        # Two times precede the name; the checksum covers them as well.
        start, place = at - 16, at + len(word)
        try:
            place += 4 + struct.unpack_from("<I", data, place)[0]
            end = place + 8 + struct.unpack_from("<Q", data, place)[0]
            (checksum,) = struct.unpack_from("<I", data, end)
        except (struct.error, OverflowError):
            # It would go on behind the end of the file.
            continue
        if start >= 0 and zlib.crc32(data[start:end]) == checksum:
            return bytes(data[place + 8 : end])
    return None
