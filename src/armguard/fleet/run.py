"""A job of a fleet from its manifest to its results; it goes on where it was left."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from armguard.fleet.engine import Engine
from armguard.fleet.job import FleetError
from armguard.fleet.manifest import Manifest, part_seconds, settle
from armguard.fleet.store import query
from armguard.fleet.worker import Receipt, Shard

# A shard may take so many times the median of those before it, and never less than
# this [s]; before the first few are known, the other time [s].
TIMES, LEAST_LIMIT, FIRST_LIMIT, FIRST = 20.0, 20.0, 60.0, 3

# Shards that are submitted at once for each worker.
AHEAD = 4


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a job.

    Attributes:
        shards: Count of its shards.
        before: Those of them that were done before.
        items: Count of its results.
        failed: Items that could not be judged.
        found: Items with a finding.
        clear: Items in which every pair keeps its buffer, or nothing differs.
        seconds: Time of the work that was done now, all workers together [s].
    """

    shards: int
    before: int
    items: int
    failed: int
    found: int
    clear: int
    seconds: float


def run_job(
    manifest: Manifest,
    out: Path,
    engine: Engine,
    progress: Callable[[Receipt], None] | None = None,
) -> Outcome:
    """Do what is missing of a job.

    Args:
        manifest: The manifest of the job as it is now.
        out: Folder of the results.
        engine: What does the work.
        progress: Called with the receipt of each shard.

    Raises:
        FleetError: The folder holds other results, a worker has other code, or
            nothing can be written. What is done stays, and the same call goes on.
    """
    missing = deque(settle(out, manifest))
    before, seconds = len(manifest.ends) - len(missing), list[float]()
    if missing:
        engine.open()
        try:
            running: set[int] = set()
            while missing or running:
                while missing and len(running) < AHEAD * engine.width:
                    number = missing.popleft()
                    running.add(number)
                    engine.submit(shard_of(manifest, out, number, seconds))
                for receipt in engine.done():
                    if receipt.refused:
                        raise FleetError(f"worker {receipt.worker}: {receipt.refused}")
                    running.remove(receipt.number)
                    seconds.append(receipt.seconds)
                    if progress is not None:
                        progress(receipt)
        finally:
            engine.close()
    for rest in out.glob(".part-*"):
        rest.unlink()
    _, [[items, failed, found, clear]] = query(
        out,
        "select count(*), count(error), count(*) filter (len(findings) > 0), "
        "count(*) filter (clear) from results",
    )
    if items != manifest.items:
        raise FleetError(f"{out}: there are {items} results of {manifest.items}")
    return Outcome(
        len(manifest.ends), before, items, failed, found, clear, sum(seconds)
    )


def shard_of(manifest: Manifest, out: Path, number: int, seconds: list[float]) -> Shard:
    """A shard and its limits, by the times of those before it."""
    limit = manifest.job.time_limit
    if limit is None:
        if len(seconds) >= FIRST:
            limit = max(TIMES * median(seconds), LEAST_LIMIT)
        else:
            usual = part_seconds(manifest.work, manifest.job, manifest.inputs)
            limit = max(TIMES * usual, FIRST_LIMIT)
    return Shard(str(out), number, limit, manifest.job.memory, manifest.hash)
