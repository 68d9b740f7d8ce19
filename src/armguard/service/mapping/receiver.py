"""A socket that takes frames in a thread, and the few frames that wait."""

import socket
import threading
import time
from collections import Counter, deque

from armguard.errors import StationError
from armguard.service.mapping.gate import FrameGate, SentFrame
from armguard.service.wire.layout import MOST

# Frames of a sensor that wait; further ones replace the oldest.
MOST_WAITING = 2

# A frame that is ahead of the joint positions waits for them for so long [ns].
PATIENCE = 50_000_000

# Room of the socket for messages that are not read yet, as far as the system has it.
SOCKET_ROOM = 4 << 20

# Time between two looks whether to end [s].
LOOK = 0.1


class FrameReceiver:
    """Takes FRAMEs on a port of loopback.

    Attributes:
        port: The port.
        drops: How many messages and frames were dropped, by cause.
        came: Set when a frame is whole.

    Args:
        gate: Decides which messages count.
        port: The port; 0 for a free one.

    Raises:
        StationError: The port is taken.
    """

    def __init__(self, gate: FrameGate, port: int = 0) -> None:
        self.drops: Counter[str] = Counter()
        self.came = threading.Event()
        self._gate = gate
        self._waiting: dict[str, deque[SentFrame]] = {
            name: deque(maxlen=MOST_WAITING) for name in gate.names
        }
        # Those whose last frame was taken longest ago first.
        self._turns = [*gate.names]
        self._ended = threading.Event()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind(("127.0.0.1", port))
        except OSError as error:
            self._socket.close()
            raise StationError(
                f"cannot take frames on port {port}: {error.strerror}; end what has "
                "that port, or choose another with --port"
            ) from error
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, SOCKET_ROOM)
        self._socket.settimeout(LOOK)
        self.port: int = self._socket.getsockname()[1]
        self._thread = threading.Thread(target=self._run, name="frames", daemon=True)
        self._thread.start()

    @property
    def dropped(self) -> int:
        """Messages and frames that were dropped."""
        return sum(self.drops.copy().values())

    def next(self, newest: float, read: int) -> SentFrame | None:
        """A frame that can be taken, of each sensor in its turn; None without any.

        Args:
            newest: Stamp of the newest joint positions [s].
            read: When these were read, monotonic [ns].
        """
        for name in self._turns:
            queue = self._waiting[name]
            # This thread alone takes frames out: one that is there may only be
            # replaced by a newer one.
            if not queue:
                continue
            stamp, arrived = queue[0].stamp, queue[0].arrived
            # A stamp that is no number is not after anything.
            if not stamp > newest or arrived < read - PATIENCE:
                self._turns.remove(name)
                self._turns.append(name)
                return queue.popleft()
        return None

    def close(self) -> None:
        """Release the port."""
        self._ended.set()
        self._thread.join()
        self._socket.close()

    def _run(self) -> None:
        buffer = bytearray(MOST + 8)
        message = memoryview(buffer)
        while not self._ended.is_set():
            try:
                size = self._socket.recv_into(buffer)
            except OSError:
                # None came.
                continue
            self._take(message[:size])

    def _take(self, message: memoryview) -> None:
        """Take a message; nothing in it raises, nothing grows."""
        gate = self._gate
        frame = gate.admit(message, time.monotonic_ns())
        if gate.drop:
            self.drops[gate.drop] += 1
        if gate.torn:
            self.drops["torn"] += 1
        if frame is None:
            return
        queue = self._waiting[frame.name]
        if len(queue) == MOST_WAITING:
            self.drops["overrun"] += 1
        queue.append(frame)
        self.came.set()
