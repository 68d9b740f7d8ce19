"""A ring in shared memory: one process writes, any number read, and none waits.

Records are rows of float64 of any length. The writer overwrites the oldest ones; a
reader that is too slow loses whole records, knows how many, and never sees a part of
one. The ring is a file that is mapped into memory, on a file system in memory where
there is one, so a reader needs nothing but its path. A small file beside it says when
its recorder last wrote all there was.
"""

import mmap
import os
import struct
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from armguard.errors import RingError

Floats = NDArray[np.float64]

# The first words of the file; the others are the ring's.
HEAD = np.dtype(
    [
        ("magic", np.int64),
        ("capacity", np.int64),  # words of the ring
        ("head", np.int64),  # where the next record starts, in words from the first
        ("tail", np.int64),  # where the oldest record starts that is still whole
        ("last", np.int64),  # where the newest record starts, NONE before there is one
        ("written", np.int64),  # records written
        ("closed", np.int64),  # 1 after the writer said that no more follow
        ("reserved", np.int64),
    ]
)
WORDS = HEAD.itemsize // 8

OURS = 0x41524D475249_01
NONE = -1

# Before each record: where it starts, its number, and how many words it has; after it
# where it starts once more. A place whose number is SKIP is empty up to the ring's end.
BEFORE, AFTER = 3, 1
SKIP = -1


# When a recorder last wrote all there was, on the monotonic clock, which on one machine
# is the same for all processes [s].
PULSE = struct.Struct("<d")


def in_memory() -> Path:
    """Folder on a file system in memory, if this machine has one."""
    shared = Path("/dev/shm")
    if shared.is_dir() and os.access(shared, os.W_OK):
        return shared
    import tempfile

    return Path(tempfile.gettempdir())


class RingWriter:
    """The writing end; there is one.

    Args:
        path: The file, made anew.
        size: Size of the ring [bytes].

    Raises:
        RingError: The file cannot be made.
    """

    def __init__(self, path: Path, size: int = 64 << 20) -> None:
        self.path = path
        capacity = size // 8
        try:
            path.unlink(missing_ok=True)
            handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
            try:
                # Taken now: a full file system must not end the loop later.
                os.posix_fallocate(handle, 0, (WORDS + capacity) * 8)
                self._map = mmap.mmap(handle, (WORDS + capacity) * 8)
            finally:
                os.close(handle)
        except OSError as error:
            path.unlink(missing_ok=True)
            raise RingError(
                f"{path}: no ring of {size >> 20} MiB can be made: {error.strerror}"
            ) from error
        self._head = np.frombuffer(self._map, HEAD, 1)[0]
        self._words = np.frombuffer(self._map, np.float64, capacity, WORDS * 8)
        self._marks = np.frombuffer(self._map, np.int64, capacity, WORDS * 8)
        self._capacity = capacity
        self._at, self._length = 0, 0
        self._count = 0
        # Touched now, so that the loop meets no page that is not there yet.
        self._words.fill(0.0)
        self._head["capacity"], self._head["last"] = capacity, NONE
        self._head["magic"] = OURS

    def reserve(self, length: int) -> Floats:
        """Room for the next record, to be filled and then committed, shape (length,).

        Raises:
            RingError: It is longer than half of the ring.
        """
        whole = BEFORE + length + AFTER
        if 2 * whole > self._capacity:
            raise RingError(f"{self.path}: no room for a record of {length} words")
        place = self._at % self._capacity
        left = self._capacity - place
        if left < whole:
            self._make_room(self._at + left)
            if left >= BEFORE:
                marks = self._marks[place : place + BEFORE]
                marks[:] = self._at, SKIP, left
            self._at += left
            place = 0
        self._make_room(self._at + whole)
        self._length = length
        return self._words[place + BEFORE : place + BEFORE + length]

    def commit(self) -> None:
        """Let readers see what was filled in."""
        place = self._at % self._capacity
        length = self._length
        marks = self._marks
        marks[place : place + BEFORE] = self._at, self._count, length
        marks[place + BEFORE + length] = self._at
        start = self._at
        self._at += BEFORE + length + AFTER
        self._count += 1
        head = self._head
        head["written"] = self._count
        head["last"] = start
        head["head"] = self._at

    def append(self, record: Floats) -> None:
        """Write a record, shape (k,)."""
        self.reserve(len(record))[:] = record
        self.commit()

    def close(self) -> None:
        """Mark the end for readers, and remove the file's name."""
        if self._map.closed:
            return
        self._head["closed"] = 1
        self.path.unlink(missing_ok=True)
        del self._head, self._words, self._marks
        try:
            self._map.close()
        except BufferError:
            # A caller of `reserve` still holds the memory, and frees it.
            pass

    def _make_room(self, end: int) -> None:
        """Give up the oldest records, as far as one that ends there needs it."""
        tail = int(self._head["tail"])
        oldest = end - self._capacity
        if tail >= oldest:
            return
        while tail < oldest:
            place = tail % self._capacity
            left = self._capacity - place
            number, length = SKIP, 0
            if left >= BEFORE:
                _, number, length = self._marks[place : place + BEFORE].tolist()
            tail += left if number == SKIP else BEFORE + length + AFTER
        self._head["tail"] = tail


class RingReader:
    """A reading end; there may be any number.

    Attributes:
        lost: Records that were overwritten before they were read.

    Args:
        path: The file a writer made.
        newest: Whether to start with what is written from now on; else with the oldest
            record there is.

    Raises:
        RingError: There is no such file, or it is no ring.
    """

    def __init__(self, path: Path, *, newest: bool = False) -> None:
        self.path = path
        try:
            with path.open("rb") as file:
                self._map = mmap.mmap(file.fileno(), 0, prot=mmap.PROT_READ)
        except (OSError, ValueError) as error:
            raise RingError(f"{path}: no ring is there: {error}") from error
        if len(self._map) < WORDS * 8:
            raise RingError(f"{path}: this is no ring")
        self._head = np.frombuffer(self._map, HEAD, 1)[0]
        capacity = int(self._head["capacity"])
        if self._head["magic"] != OURS or len(self._map) != (WORDS + capacity) * 8:
            raise RingError(f"{path}: this is no ring")
        self._capacity = capacity
        self._words = np.frombuffer(self._map, np.float64, capacity, WORDS * 8)
        self._marks = np.frombuffer(self._map, np.int64, capacity, WORDS * 8)
        self._at = int(self._head["head" if newest else "tail"])
        self._next = int(self._head["written"])
        self.lost = 0
        while not newest and self._at < int(self._head["head"]):
            found = self._copy(self._at)
            if found is None:
                self._at = int(self._head["tail"])
            elif found[0] == SKIP:
                self._at = found[2]
            else:
                self._next = found[0]
                break

    @property
    def closed(self) -> bool:
        """Whether the writer said that no more follow."""
        return bool(self._head["closed"])

    @property
    def written(self) -> int:
        """Records written so far."""
        return int(self._head["written"])

    def latest(self) -> Floats | None:
        """The newest record, a copy; None before there is one."""
        while (at := int(self._head["last"])) != NONE:
            found = self._copy(at)
            if found is not None:
                return found[1]
        return None

    def unread(self) -> Iterator[Floats]:
        """Records not read yet, in order, copies, as far as there are any now."""
        while self._at < int(self._head["head"]):
            found = self._copy(self._at)
            if found is None:
                # Overwritten meanwhile: go on with the oldest one that is whole.
                self._at = int(self._head["tail"])
                continue
            number, record, self._at = found
            if number == SKIP:
                continue
            self.lost += number - self._next
            self._next = number + 1
            yield record

    def close(self) -> None:
        """Let go of the ring."""
        del self._head, self._words, self._marks
        self._map.close()

    def _copy(self, at: int) -> tuple[int, Floats, int] | None:
        """Number and words of the record at a place, and the next place.

        None if it is not whole any more.
        """
        place = at % self._capacity
        left = self._capacity - place
        nothing = self._words[:0]
        if left < BEFORE:
            return SKIP, nothing, at + left
        start, number, length = self._marks[place : place + BEFORE].tolist()
        if start != at or int(self._head["tail"]) > at:
            return None
        if number == SKIP:
            return SKIP, nothing, at + left
        end = place + BEFORE + length
        if not 0 <= length <= left - BEFORE - AFTER:
            return None
        record = self._words[place + BEFORE : end].copy()
        if self._marks[end] != at or int(self._head["tail"]) > at:
            return None
        return number, record, at + BEFORE + length + AFTER


def pulse_path(ring: Path) -> Path:
    """Where the recorder of a ring says that it records."""
    return ring.with_name(ring.name + ".recorder")


def beat(ring: Path) -> None:
    """Say that all that was in the ring is recorded; for the recorder."""
    # Where there is no room for it, its age says so.
    with suppress(OSError):
        flags = os.O_WRONLY | os.O_CREAT | os.O_NOFOLLOW
        handle = os.open(pulse_path(ring), flags, 0o600)
        try:
            os.pwrite(handle, PULSE.pack(time.monotonic()), 0)
        finally:
            os.close(handle)


def end_pulse(ring: Path) -> None:
    """Say that nothing is recorded any more, and that this is as it should be."""
    with suppress(OSError):
        pulse_path(ring).unlink()


def recorder_age(ring: Path) -> float | None:
    """How long ago the recorder of a ring last wrote all there was [s].

    It says so twice a second while its disk takes what it writes. None if no recorder
    has begun, or the last one ended in order.
    """
    try:
        data = pulse_path(ring).read_bytes()
    except OSError:
        return None
    if len(data) != PULSE.size:
        return None
    age: float = time.monotonic() - PULSE.unpack(data)[0]
    return max(age, 0.0)
