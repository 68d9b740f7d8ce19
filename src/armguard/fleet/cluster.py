"""Scheduler and workers of a Dask cluster, as programs."""

import asyncio
import signal
from collections.abc import Awaitable, Callable
from typing import Any

from armguard.fleet.engine import Tls, check_address

# Where its pages about itself are, for this machine alone.
LOCAL = "127.0.0.1:0"

# What a program waits for: that it is ended, or that its server is.
Server = Any


def schedule(host: str, port: int, tls: Tls | None) -> None:
    """Run a scheduler.

    Args:
        host: Address to listen on; without TLS on loopback alone.
        port: Its port, 0 for a free one.
        tls: Files of TLS.

    Raises:
        FleetError: Others than this machine could reach it without TLS.
    """
    from distributed import Scheduler

    scheme = "tcp" if tls is None else "tls"
    check_address(f"{scheme}://{host}:{port or 1}", tls)

    async def make() -> Server:
        return await Scheduler(
            host=f"{scheme}://{host}",
            port=port,
            dashboard=False,
            dashboard_address=LOCAL,
            security=None if tls is None else tls.security(),
        )

    asyncio.run(serve(make))


def work(address: str, tls: Tls | None) -> None:
    """Run a worker, and start it again whenever it is killed.

    Args:
        address: The scheduler's.
        tls: Files of TLS.

    Raises:
        FleetError: The scheduler is on another machine, and without TLS.
    """
    from distributed import Nanny

    check_address(address, tls)

    async def make() -> Server:
        return await Nanny(
            address,
            nthreads=1,
            # Its child process has a limit; the worker itself holds no results.
            memory_limit=0,
            dashboard=False,
            dashboard_address=LOCAL,
            security=None if tls is None else tls.security(),
        )

    asyncio.run(serve(make))


async def serve(make: Callable[[], Awaitable[Server]]) -> None:
    """Run a server until a signal comes, or until it ends."""
    server = await make()
    print(server.address, flush=True)
    ended, loop = asyncio.Event(), asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, ended.set)
    waits = [asyncio.create_task(ended.wait()), asyncio.create_task(server.finished())]
    await asyncio.wait(waits, return_when=asyncio.FIRST_COMPLETED)
    for one in waits:
        one.cancel()
    await server.close()
