"""Engines of a fleet: where workers are, behind four functions."""

import ipaddress
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import asdict, dataclass
from pathlib import Path
from threading import Lock, local
from typing import Any, Protocol
from urllib.parse import urlsplit

from armguard.fleet.job import FleetError
from armguard.fleet.manifest import code_digest
from armguard.fleet.worker import Receipt, Shard, Worker, code_here, do_shard

# Time to find a scheduler and its first worker [s].
PATIENCE = 30.0

# How often a shard is submitted again whose workers were lost.
MOST_LOST = 20


class Engine(Protocol):
    """Does shards.

    Attributes:
        width: How many it does at the same time.
    """

    @property
    def width(self) -> int:
        """See the attribute."""

    def open(self) -> None:
        """Begin.

        Raises:
            FleetError: It cannot.
        """

    def submit(self, shard: Shard) -> None:
        """Hand over a shard."""

    def done(self) -> list[Receipt]:
        """Wait for a shard to end; receipts of all that ended since the last call."""

    def close(self) -> None:
        """End at once; what is not done is not written."""


class Here:
    """One worker in this process; its work is in a child process."""

    width = 1

    def open(self) -> None:
        """Begin."""
        self._worker, self._waiting = Worker(), list[Shard]()

    def submit(self, shard: Shard) -> None:
        """Hand over a shard."""
        self._waiting.append(shard)

    def done(self) -> list[Receipt]:
        """Do the next shard."""
        return [self._worker.do(self._waiting.pop(0))]

    def close(self) -> None:
        """End."""
        self._worker.close()


class Processes:
    """Workers in threads of this process, each with its own child process.

    Args:
        count: Their count.
    """

    def __init__(self, count: int) -> None:
        self.width = count

    def open(self) -> None:
        """Begin."""
        self._pool = ThreadPoolExecutor(self.width)
        self._own, self._workers, self._lock = local(), list[Worker](), Lock()
        self._futures: set[Future[Receipt]] = set()

    def submit(self, shard: Shard) -> None:
        """Hand over a shard."""
        self._futures.add(self._pool.submit(self._do, shard))

    def done(self) -> list[Receipt]:
        """Wait for shards to end."""
        ended, self._futures = wait(self._futures, return_when=FIRST_COMPLETED)
        return [future.result() for future in ended]

    def close(self) -> None:
        """End."""
        self._pool.shutdown(wait=False, cancel_futures=True)
        with self._lock:
            for worker in self._workers:
                worker.close()
        self._pool.shutdown()

    def _do(self, shard: Shard) -> Receipt:
        """Do a shard in the worker of this thread."""
        worker: Worker | None = getattr(self._own, "worker", None)
        if worker is None:
            worker = self._own.worker = Worker()
            with self._lock:
                self._workers.append(worker)
        return worker.do(shard)


@dataclass(frozen=True, slots=True)
class Tls:
    """Files of TLS, in PEM.

    Attributes:
        ca: Certificates of the authorities that sign those of all participants.
        cert: Certificate of this process.
        key: Private key of that certificate.
    """

    ca: Path
    cert: Path
    key: Path

    def security(self) -> Any:
        """The same for Dask; nothing is sent without it."""
        from distributed.security import Security

        files = {f"tls_{role}_{what}": str(getattr(self, what))
                 for role in ("client", "scheduler", "worker")
                 for what in ("cert", "key")}  # fmt: skip
        return Security(tls_ca_file=str(self.ca), require_encryption=True, **files)


def check_address(address: str, tls: Tls | None) -> None:
    """Refuse an address at which others could run code here.

    Raises:
        FleetError: It is not on this machine and not protected by TLS.
    """
    found = urlsplit(address)
    if found.scheme not in ("tcp", "tls") or not found.hostname or not found.port:
        raise FleetError(
            f"'{address}' is no address; write tcp://127.0.0.1:8786, or tls:// and "
            "another machine"
        )
    if found.scheme == "tls":
        if tls is None:
            raise FleetError(f"{address}: give --tls-ca, --tls-cert and --tls-key")
        return
    try:
        own = ipaddress.ip_address(found.hostname).is_loopback
    except ValueError:
        own = found.hostname == "localhost"
    if not own:
        raise FleetError(
            f"{address} is not on this machine, and a scheduler runs code of its "
            "clients: use tls:// with --tls-ca, --tls-cert and --tls-key"
        )


class Cluster:
    """Workers of a Dask cluster.

    Args:
        address: Its scheduler, as in "tcp://127.0.0.1:8786".
        tls: Files of TLS for an address tls://.
    """

    width = 1

    def __init__(self, address: str, tls: Tls | None = None) -> None:
        check_address(address, tls)
        self._address, self._tls = address, tls

    def open(self) -> None:
        """Find the scheduler and its workers; all must have the code of here."""
        from distributed import Client

        try:
            self._client = Client(
                self._address,
                timeout=PATIENCE,
                security=None if self._tls is None else self._tls.security(),
            )
            self._client.wait_for_workers(1, timeout=PATIENCE)
        except (OSError, TimeoutError) as error:
            raise FleetError(
                f"{self._address}: no scheduler with a worker answers ({error}); start "
                "`armguard fleet scheduler` and `armguard fleet worker`"
            ) from None
        self._check_code()
        self._shards: dict[Any, tuple[Shard, int]] = {}

    def submit(self, shard: Shard) -> None:
        """Hand over a shard."""
        self._submit(shard, 0)

    def done(self) -> list[Receipt]:
        """Wait for shards to end."""
        from distributed import KilledWorker
        from distributed import wait as wait_for
        from distributed.client import FutureCancelledError

        self.width = max(len(self._client.scheduler_info(-1)["workers"]), 1)
        ended, _ = wait_for(list(self._shards), return_when="FIRST_COMPLETED")
        receipts = []
        for future in ended:
            shard, lost = self._shards.pop(future)
            try:
                receipts.append(Receipt(**future.result()))
            except (KilledWorker, FutureCancelledError) as error:
                # The work is in a child: it was not the input that ended the worker.
                if lost == MOST_LOST:
                    raise FleetError(
                        f"{self._address}: workers are lost again and again ({error})"
                    ) from None
                self._submit(shard, lost + 1)
        return receipts

    def close(self) -> None:
        """End; workers go on waiting for others."""
        self._client.cancel(list(self._shards))
        self._client.close()

    def _submit(self, shard: Shard, lost: int) -> None:
        """Hand over a shard whose workers were lost so often."""
        future = self._client.submit(
            do_shard,
            asdict(shard),
            key=f"armguard-{shard.manifest[:16]}-{shard.number}-{lost}",
            pure=False,
        )
        self._shards[future] = shard, lost

    def _check_code(self) -> None:
        """Refuse workers with other code.

        Raises:
            FleetError: There is one; the message names it.
        """
        own = code_digest()
        found = self._client.run(code_here, on_error="return")
        for worker, digest in found.items():
            if digest != own:
                self._client.close()
                said = digest if isinstance(digest, str) else f"none ({digest})"
                raise FleetError(
                    f"worker {worker} has the code {said}, this command {own}; install "
                    "the same version of armguard there"
                )


def engine_of(workers: int, address: str | None, tls: Tls | None = None) -> Engine:
    """An engine by the options of the command line.

    Args:
        workers: Worker processes; 0 for one in this process.
        address: A Dask scheduler in place of them.
        tls: See `Cluster`.

    Raises:
        FleetError: The address is refused.
    """
    if address is not None:
        return Cluster(address, tls)
    return Processes(workers) if workers else Here()
