"""Files on a disk that may be full, slow or gone: written by a thread of their own.

The recorder hands over pieces and goes on. They wait in memory, up to a bound; pieces
beyond it are given up, and counted. A piece that could be written in part is taken back
first, so that a file is always whole pieces.
"""

import logging
import os
import threading
import time
from collections import deque
from dataclasses import dataclass
from errno import ENOENT
from math import inf
from pathlib import Path

log = logging.getLogger("armguard.blackbox")

# Bytes that may wait for the disk.
MOST_WAITING = 64 << 20

# After a failure the disk is tried again so much later [s].
PAUSE = 1.0

# What was written is forced out of the machine's memory so often [s].
SYNC = 1.0


@dataclass(slots=True)
class DiskFile:
    """A file that is being written."""

    path: Path
    given_up: bool = False  # a piece of it was lost: it takes no more
    size: int = 0  # bytes it has on the disk
    handle: int | None = None
    synced: float = 0.0  # when, monotonic [s]


@dataclass(frozen=True, slots=True)
class Budget:
    """Limits of files together; the newest stays in any case."""

    pattern: str  # of their names
    size: int  # bytes
    count: float = inf


class Disk:
    """Writes files one piece after another, on a thread of its own.

    Attributes:
        problem: What is wrong with the disk now; empty if nothing is.
        failures: Failed writes so far.
        lost: Bytes given up since nothing could be written.

    Args:
        folder: Where the files are; made when it is missing.
        budgets: What they may have together; the oldest are deleted.
    """

    def __init__(self, folder: Path, *budgets: Budget) -> None:
        self.folder, self._budgets = folder, budgets
        self.problem = ""
        self.failures = self.lost = 0
        self._queue: deque[tuple[DiskFile, bytes | None]] = deque()
        self._waiting = 0
        self._wake = threading.Condition()
        self._ends = False
        self._thread = threading.Thread(target=self._run, name="disk", daemon=True)
        self._thread.start()

    @property
    def waiting(self) -> int:
        """Bytes that wait to be written."""
        return self._waiting

    def put(self, file: DiskFile, piece: bytes) -> bool:
        """Hand over a piece; whether it will be written."""
        with self._wake:
            if file.given_up or self._waiting + len(piece) > MOST_WAITING:
                file.given_up = True
                self.lost += len(piece)
                return False
            self._queue.append((file, piece))
            self._waiting += len(piece)
            self._wake.notify()
        return True

    def close(self, file: DiskFile) -> None:
        """Close a file when all its pieces are written."""
        with self._wake:
            self._queue.append((file, None))
            self._wake.notify()

    def end(self, patience: float) -> bool:
        """Write what waits, for as long as that; whether all of it was written [s]."""
        with self._wake:
            self._ends = True
            self._wake.notify()
        self._thread.join(patience)
        return not self._queue

    def _run(self) -> None:
        """Write pieces in order, until the end."""
        while True:
            with self._wake:
                while not self._queue:
                    if self._ends:
                        return
                    self._wake.wait(SYNC)
                file, piece = self._queue[0]
            try:
                self._take(file, piece)
            except OSError as error:
                self._fail(file, error)
                with self._wake:
                    # At the end there is no pause, but no more than a try a piece.
                    self._wake.wait(PAUSE)
                continue
            if self.problem and piece is not None:
                log.warning("%s: recording goes on", self.folder)
                self.problem = ""
            with self._wake:
                self._queue.popleft()
                self._waiting -= len(piece or b"")

    def _take(self, file: DiskFile, piece: bytes | None) -> None:
        """Write one piece, or close."""
        if piece is None:
            if file.handle is not None:
                os.close(file.handle)
                file.handle = None
            return
        if file.given_up:
            self.lost += len(piece)
            return
        if file.handle is None:
            self._open(file)
        elif not file.path.exists():
            # Later pieces could not be read without the file's beginning.
            file.given_up = True
            self.lost += len(piece)
            raise FileNotFoundError(ENOENT, "the file was removed")
        assert file.handle is not None
        done = 0
        try:
            while done < len(piece):
                done += os.write(file.handle, piece[done:])
        except OSError:
            os.ftruncate(file.handle, file.size)
            os.lseek(file.handle, file.size, os.SEEK_SET)
            raise
        file.size += done
        if time.monotonic() - file.synced > SYNC:
            os.fsync(file.handle)
            file.synced = time.monotonic()

    def _open(self, file: DiskFile) -> None:
        """Make a file, and room for it."""
        self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC
        # Only the owner of the arms may read their motion.
        file.handle = os.open(file.path, flags, 0o600)
        file.size = 0
        for budget in self._budgets:
            self._make_room(budget)

    def _make_room(self, budget: Budget) -> None:
        """Delete the oldest files until the others are few and small enough."""
        found = sorted(self.folder.glob(budget.pattern))
        sizes = [path.stat().st_size for path in found]
        total, count = sum(sizes), len(found)
        for path, size in list(zip(found, sizes, strict=True))[:-1]:
            if total <= budget.size and count <= budget.count:
                break
            path.unlink(missing_ok=True)
            total, count = total - size, count - 1
            log.info("%s was deleted: recordings had more than they may keep", path)

    def _fail(self, file: DiskFile, error: OSError) -> None:
        """Say what is wrong, once until it is right again or something else is."""
        self.failures += 1
        problem = f"{file.path}: nothing can be recorded: {error.strerror}"
        if problem != self.problem:
            log.warning("%s; the guard goes on, and the disk is tried again", problem)
        self.problem = problem
