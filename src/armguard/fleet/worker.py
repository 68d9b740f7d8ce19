"""A worker: the work in a child process, and the input that ends it by name."""

import socket
import time
from dataclasses import asdict, dataclass
from os import getpid
from pathlib import Path
from typing import Any, Self

from armguard.fleet.child import Child, WorkFailure
from armguard.fleet.job import FleetError
from armguard.fleet.manifest import Manifest, code_digest
from armguard.fleet.result import failed_row, item_rows
from armguard.fleet.store import part_of, write_part

# Half of a shard gets half its time, but never less than this [s].
LEAST_LIMIT = 5.0


@dataclass(frozen=True, slots=True)
class Shard:
    """One part of the work.

    Attributes:
        out: Folder of the results.
        number: Its number.
        limit: Time that it may take [s].
        memory: Memory that it may take [GB].
        manifest: Hash of the manifest.
    """

    out: str
    number: int
    limit: float
    memory: float
    manifest: str


@dataclass(frozen=True, slots=True)
class Receipt:
    """What is known of a shard that ended; the results are in its file.

    Attributes:
        number: Its number.
        items: Its count of items.
        frames: Their count of frames.
        failed: Items that could not be judged.
        found: Items with a finding.
        least: Least distance of all; None if there is none [m].
        worst: The input with it.
        seconds: Time that it took [s].
        cpu: Processor time of its work, without that of writing the results [s].
        worker: Where it was done.
        refused: Why nothing was written; empty if it was.
    """

    number: int
    items: int = 0
    frames: int = 0
    failed: int = 0
    found: int = 0
    least: float | None = None
    worst: str = ""
    seconds: float = 0.0
    cpu: float = 0.0
    worker: str = ""
    refused: str = ""

    @classmethod
    def of(
        cls, number: int, rows: list[dict[str, Any]], seconds: float, cpu: float
    ) -> Self:
        """The receipt of results."""
        known = [row for row in rows if row["least"] is not None]
        worst = min(known, key=lambda row: row["least"], default=None)
        return cls(
            number=number,
            items=len(rows),
            frames=sum(row["frames"] for row in rows),
            failed=sum(row["error"] is not None for row in rows),
            found=sum(bool(row["findings"]) for row in rows),
            least=None if worst is None else worst["least"],
            worst="" if worst is None else name_of(worst),
            seconds=seconds,
            cpu=cpu,
            worker=worker_name(),
        )


def name_of(row: dict[str, Any]) -> str:
    """The input of a result, for people."""
    episode = f", episode {row['episode']}" if row["episode"] >= 0 else ""
    return f"{row['input']}{episode}"


def worker_name() -> str:
    """This process, by machine and number."""
    return f"{socket.gethostname()}:{getpid()}"


class Worker:
    """Does shards of one folder, one at a time."""

    def __init__(self) -> None:
        self._child: Child | None = None
        self._of: tuple[str, float, str] | None = None

    def do(self, shard: Shard) -> Receipt:
        """Do a shard and write its results.

        Errors are a receipt with `refused`: nothing is raised but what the work itself
        cannot mean.
        """
        start = time.monotonic()
        try:
            child, manifest = self._ready(shard)
            first, end = manifest.shard(shard.number)
            before = child.cpu
            rows = halved(child, manifest, first, end, shard.limit)
            write_part(part_of(Path(shard.out), shard.number), rows, manifest.hash)
        except FleetError as error:
            return Receipt(shard.number, worker=worker_name(), refused=str(error))
        return Receipt.of(
            shard.number, rows, time.monotonic() - start, child.cpu - before
        )

    def close(self) -> None:
        """End the child process."""
        if self._child is not None:
            self._child.close()
            self._child = None
        self._of = None

    def _ready(self, shard: Shard) -> tuple[Child, Manifest]:
        """The child of a shard's folder, and the manifest there.

        Raises:
            FleetError: The manifest or the code here is another one.
        """
        known = shard.out, shard.memory, shard.manifest
        if self._child is None or self._of != known:
            self.close()
            manifest = Manifest.read(Path(shard.out))
            if manifest.hash != shard.manifest:
                raise FleetError(f"{shard.out}: another job began in this folder")
            if manifest.code != code_digest():
                raise FleetError(
                    f"it has the code {code_digest()}, but the job {manifest.code}; "
                    "install the same version of armguard"
                )
            self._manifest, self._of = manifest, known
            self._child = Child(Path(shard.out), shard.memory)
        return self._child, self._manifest


def halved(
    child: Child, manifest: Manifest, first: int, end: int, limit: float
) -> list[dict[str, Any]]:
    """Results of a span of items; it is halved until what ends the child is named."""
    for again in (True, False):
        try:
            return child.rows(first, end, limit)
        except WorkFailure as failure:
            if end - first == 1 and not again:
                one = manifest.item(first)[1]
                return item_rows(manifest, first, [failed_row(one, str(failure))])
            if end - first > 1:
                break
    middle, half = (first + end) // 2, max(0.5 * limit, LEAST_LIMIT)
    rows = halved(child, manifest, first, middle, half)
    return rows + halved(child, manifest, middle, end, half)


def code_here() -> str:
    """The code of this process, see `code_digest`."""
    return code_digest()


WORKER = Worker()


def do_shard(shard: dict[str, Any]) -> dict[str, Any]:
    """Do a shard in this process's worker: the task of a cluster."""
    return asdict(WORKER.do(Shard(**shard)))
