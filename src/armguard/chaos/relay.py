"""A relay between clients and a service that hands messages on, or does worse."""

import heapq
import selectors
import socket
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from armguard.service.wire.layout import MOST

LOOPBACK = "127.0.0.1"

# How long it waits before it looks whether it is to end [s].
TURN = 0.02


@dataclass(frozen=True, slots=True, order=True)
class Handed:
    """A message on its way.

    Attributes:
        at: When it is handed on, monotonic [s].
        number: Keeps messages of one instant in their order.
        message: The message.
        up: Whether it goes to the service.
        client: Address of the client it is from or for.
    """

    at: float
    number: int
    message: bytes = field(compare=False)
    up: bool = field(compare=False)
    client: tuple[str, int] = field(compare=False)


# What becomes of a message that is on its way to the service, or from it: messages,
# each with a delay [s].
Tamper = Callable[[bytes, bool], Sequence[tuple[float, bytes]]]


def honest(message: bytes, up: bool) -> Sequence[tuple[float, bytes]]:
    """Hand on what comes."""
    return ((0.0, message),)


class Relay:
    """Relays messages between clients and a service, as a thread.

    Attributes:
        port: Where clients find it.
        tamper: What it does with messages; may be changed at any time.
        tampered: Messages that were not simply handed on.

    Args:
        service: Port of the service.
    """

    def __init__(self, service: int) -> None:
        self.tamper: Tamper = honest
        self.tampered = 0
        self._service = (LOOPBACK, service)
        self._front = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._front.bind((LOOPBACK, 0))
        self._front.setblocking(False)
        self.port: int = self._front.getsockname()[1]
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._front, selectors.EVENT_READ, None)
        self._backs: dict[tuple[str, int], socket.socket] = {}
        self._waiting: list[Handed] = []
        self._count = 0
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread and close all sockets."""
        self._ending.set()
        self._thread.join()
        self._selector.close()
        for each in (self._front, *self._backs.values()):
            each.close()

    def _run(self) -> None:
        while not self._ending.is_set():
            wait = TURN
            if self._waiting:
                wait = min(max(self._waiting[0].at - time.monotonic(), 0.0), TURN)
            for key, _ in self._selector.select(wait):
                self._take(key.fileobj, key.data)  # type: ignore[arg-type]
            self._hand_on()

    def _take(self, own: socket.socket, client: tuple[str, int] | None) -> None:
        """Take what came in by one of our sockets."""
        while True:
            try:
                message, sender = own.recvfrom(MOST + 1)
            except BlockingIOError:
                return
            except OSError:
                # The service is not there; what was sent to it is lost.
                return
            up = client is None
            whose = sender if client is None else client
            handed = self.tamper(message, up)
            self.tampered += len(handed) != 1 or handed[0] != (0.0, message)
            now = time.monotonic()
            for delay, each in handed:
                self._count += 1
                one = Handed(now + delay, self._count, each, up, whose)
                heapq.heappush(self._waiting, one)

    def _hand_on(self) -> None:
        """Hand on what is due."""
        while self._waiting and self._waiting[0].at <= time.monotonic():
            one = heapq.heappop(self._waiting)
            try:
                if one.up:
                    self._back(one.client).sendto(one.message, self._service)
                else:
                    self._front.sendto(one.message, one.client)
            except OSError:
                # As on any network: a loss is not reported.
                continue

    def _back(self, client: tuple[str, int]) -> socket.socket:
        """The socket by which the service knows a client."""
        if client not in self._backs:
            back = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            back.bind((LOOPBACK, 0))
            back.setblocking(False)
            self._backs[client] = back
            self._selector.register(back, selectors.EVENT_READ, client)
        return self._backs[client]
