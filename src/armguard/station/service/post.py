"""The socket of the service: messages come in and go out, and nobody waits for them."""

import select
import socket
import time

from armguard.station.errors import ServiceError
from armguard.station.service.complaints import Complaints
from armguard.station.service.counters import PLACE, Counters
from armguard.station.service.peers import Address

SENT = PLACE["sent"]
SEND_WOULD_BLOCK = PLACE["send_would_block"]
SEND_FAILED = PLACE["send_failed"]


class Post:
    """Sends and receives without waiting.

    Attributes:
        port: The port it listens on.

    Args:
        address: Address to listen on.
        port: Port; 0 for any that is free.

    Raises:
        ServiceError: The port is taken, or the address is not this machine's.
    """

    def __init__(self, address: str, port: int) -> None:
        self._socket = listening(address, port)
        self._sockets = [self._socket]
        self.port: int = self._socket.getsockname()[1]

    def wait(self, seconds: float) -> None:
        """Sleep until something comes in, but not for longer than that."""
        select.select(self._sockets, (), (), seconds)

    def receive(
        self, buffer: bytearray, complaints: Complaints
    ) -> tuple[int, Address] | None:
        """Read one message.

        Args:
            buffer: Where it goes.
            complaints: Told what the network complains of.

        Returns:
            Its length and where it came from; None if there was none; a length of -1
            for an error of an earlier message, told late.
        """
        try:
            return self._socket.recvfrom_into(buffer)
        except BlockingIOError:
            return None
        except OSError as error:
            complaints.name("network", str(error), time.monotonic_ns())
            return -1, ("", 0)

    def send(self, message: memoryview, address: Address, counters: Counters) -> None:
        """Send without waiting; who does not read loses messages."""
        try:
            self._socket.sendto(message, address)
            counters.count(SENT)
        except BlockingIOError:
            counters.count(SEND_WOULD_BLOCK)
        except OSError:
            counters.count(SEND_FAILED)

    def close(self) -> None:
        """Let go of the port."""
        self._socket.close()


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
