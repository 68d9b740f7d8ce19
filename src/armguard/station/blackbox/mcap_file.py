"""Recordings as MCAP files, written by the library of the format."""

from collections import Counter
from collections.abc import Callable, Mapping

from mcap.writer import Writer

from armguard.station.blackbox.ros import TOPICS, Stored, definition

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
