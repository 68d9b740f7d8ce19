"""The sockets of the service: nothing that is sent or received makes the loop wait."""

import select
import socket
import time
from typing import Any

from armguard.errors import ServiceError
from armguard.recording.counters import Counters
from armguard.service.server.peers import Address
from armguard.service.server.throttled_log import ThrottledLog
from armguard.service.wire.pulses import Pulses

# The option by which sockets share a port; None where the system has none.
REUSE: int | None = getattr(socket, "SO_REUSEPORT", None)

# Controllers that get a socket of their own.
MOST_OWN = 32


class Sockets:
    """Sends and receives without waiting.

    A controller gets a socket of its own on the same port: the kernel delivers its
    messages there, so that they do not queue behind those of other clients.

    Attributes:
        port: The port it listens on.
        beside: Pulses that end a wait as well.

    Args:
        address: Address to listen on.
        port: Port; 0 for any that is free.

    Raises:
        ServiceError: The port is taken, or the address is not this machine's.
    """

    def __init__(self, address: str, port: int) -> None:
        self._socket = listening(address, port)
        self._own: dict[Address, socket.socket] = {}
        # Sockets in the order in which they are read: controllers' first.
        self._sockets = [self._socket]
        self.beside: tuple[Pulses, ...] = ()
        self.port: int = self._socket.getsockname()[1]

    def wait(self, seconds: float) -> None:
        """Sleep until a message is received, but not for longer than that."""
        sources: list[Any] = [*self._sockets, *self.beside]
        select.select(sources, (), (), seconds)

    def receive(
        self, buffer: bytearray, log: ThrottledLog
    ) -> tuple[int, Address] | None:
        """Read one message.

        Args:
            buffer: Where it goes.
            log: Gets errors of the network.

        Returns:
            Its length and its sender's address; None if there was none; a length of -1
            for an error of an earlier message, reported late.
        """
        for one in self._sockets:
            try:
                return one.recvfrom_into(buffer)
            except BlockingIOError:
                continue
            except OSError as error:
                log.report("network", str(error), time.monotonic_ns())
                return -1, ("", 0)
        return None

    def send(self, message: memoryview, address: Address, counters: Counters) -> None:
        """Send without waiting; a client that does not read loses messages."""
        try:
            self._socket.sendto(message, address)
            counters.count("sent")
        except BlockingIOError:
            counters.count("send_would_block")
        except OSError:
            counters.count("send_failed")

    def open_own(self, address: Address) -> None:
        """Receive messages from an address on a socket of their own."""
        if REUSE is None or address in self._own or len(self._own) >= MOST_OWN:
            return
        own = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        own.setblocking(False)
        try:
            # Two sockets share the port only while all of them say so, which is for
            # these calls: no other process of this user can join them.
            share([own, *self._sockets], REUSE, shared=True)
            own.bind(self._socket.getsockname())
            own.connect(address)
        except OSError:
            own.close()
            return
        finally:
            share(self._sockets, REUSE, shared=False)
        share([own], REUSE, shared=False)
        self._own[address] = own
        self._sockets = [*self._own.values(), self._socket]

    def close_own(self, address: Address) -> None:
        """Receive messages from an address on the common socket again."""
        own = self._own.pop(address, None)
        if own is not None:
            own.close()
            self._sockets = [*self._own.values(), self._socket]

    def close(self) -> None:
        """Release the port."""
        for one in self._sockets:
            one.close()


def share(sockets: list[socket.socket], option: int, *, shared: bool) -> None:
    """Set whether other sockets of this user may bind to the port of these."""
    for one in sockets:
        one.setsockopt(socket.SOL_SOCKET, option, int(shared))


def listening(address: str, port: int) -> socket.socket:
    """A socket that listens there and never waits.

    Raises:
        ServiceError: The port is taken, or the address is not this machine's.
    """
    found = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        found.bind((address, port))
    except OSError as error:
        found.close()
        raise ServiceError(
            f"cannot listen on {address}:{port}: {error.strerror}; if another service "
            "has that port, end it or choose another with --port"
        ) from error
    found.setblocking(False)
    return found
