"""The other end of a client: a socket that says what a test wants it to."""

import json
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from armguard import Client
from armguard.service.wire import Kind, Outbox, Role, Seal
from armguard.service.wire.boot import boot_id
from armguard.service.wire.layout import (
    CHALLENGE,
    COMMAND,
    GRANT,
    HEADER,
    MOST,
    ROBOT,
    WELCOME,
)

JOINTS, PATIENCE = 3, 20.0
SESSION, SCENE, TOKEN = 5, 7, 77
KEY, COOKIE = b"0123456789abcdef", b"a cookie 16 long"

TEXT = {
    "home": [0.1, 0.2, 0.3],
    "names": ["left/a", "left/b", "right/a"],
    "robots": [
        {"name": "left", "first": 0, "count": 2},
        {"name": "right", "first": 2, "count": 1},
    ],
    "period": 0.004,
    "late": 0.004,
    "bodies": ["left/hand", "right/hand", "bench"],
    "tools": ["left", "right"],
    "scene_file": "",
    "scene_hash": "00",
    "ring": "",
    "counters": "",
    "session": SESSION,
    "version": "0",
    "watchdogs": {},
    "reasons": {"0": ["OK", "nothing is near"]},
    "boot_id": boot_id(),
}


class FarEnd:
    """What a service says, without one.

    Attributes:
        seal: Seals its messages.
        outbox: Where they are written.
        keys: Its keys.
        port: Its port.
        sender: The client whose message came last.
        behind: How old its messages say they are [ns].
        text: The JSON of its WELCOME.
    """

    def __init__(self) -> None:
        self.keys = {Role.COMMAND: KEY}
        self.seal = Seal(KEY)
        self.outbox = Outbox(self.seal, 0, SESSION, SCENE)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(PATIENCE)
        self.port = self._socket.getsockname()[1]
        self.sender = self.behind = 0
        self.text = {**TEXT}

    def close(self) -> None:
        self._socket.close()

    def hear(self, kind: Kind) -> bytes:
        """The next message of that kind; HELLOs and CLAIMs are answered."""
        while True:
            message, self._address = self._socket.recvfrom(MOST)
            head = HEADER.unpack_from(message)
            _, _, said, _, _, _, self.sender, sequence, stamp = head
            if said == Kind.HELLO and COOKIE not in message:
                self.say(Kind.CHALLENGE, CHALLENGE.pack(stamp, COOKIE))
                continue
            if said == Kind.HELLO:
                welcome = WELCOME.pack(0, 1, JOINTS, 2, 0.004, stamp, stamp)
                self.say(Kind.WELCOME, welcome + json.dumps(self.text).encode())
            elif said == Kind.CLAIM:
                grant = GRANT.pack(1, 0, TOKEN, self.sender, 0.5, sequence)
                self.say(Kind.GRANT, grant)
            if said == kind:
                return message

    @contextmanager
    def hearing(
        self, kind: Kind, then: Callable[[bytes], None] = lambda message: None
    ) -> Iterator[None]:
        """Hear one in a thread meanwhile, and do something then."""
        thread = threading.Thread(target=lambda: then(self.hear(kind)))
        thread.start()
        yield
        thread.join(PATIENCE)
        assert not thread.is_alive()

    def say(self, kind: Kind, payload: bytes = b"") -> None:
        self.send(self.message(kind, payload))

    def message(self, kind: Kind, payload: bytes = b"") -> bytearray:
        message = bytearray(self.outbox.message(kind, payload))
        struct.pack_into("<q", message, 40, time.monotonic_ns() - self.behind)
        self.seal.put(memoryview(message))
        return message

    def send(self, message: bytes | bytearray) -> None:
        self._socket.sendto(message, self._address)

    def command(self, sequence: int, offset: float = 0.0, **other: int) -> bytearray:
        """A COMMAND that answers the client's state of that number."""
        began = self.sender, sequence
        points = np.array([1.0 + offset, 2.0, 3.0]), np.array([4.0, 5.0, 6.0])
        command = COMMAND.pack(
            cycle=sequence,
            began_by=began[0],
            began_with=began[1],
            received=10,
            ended=20,
            time=1.5,
            headroom=offset,
            time_left=0.7,
            body_a=other.get("a", 0),
            body_b=other.get("b", 2),
            distance=0.3 + offset,
            pair_headroom=0.2 + offset,
            point_a=points[0].tobytes(),
            point_b=points[1].tobytes(),
            reason=0,
            cause=other.get("cause", 0),
            level=0,
            action=other.get("action", 0),
            flags=1,
            joints=other.get("joints", JOINTS),
            robots=2,
            form=1,
            commander=self.sender,
        )
        rows = b"".join(
            ROBOT.pack(0, 0, 10 * k, 0, 0.5, 0.25, offset + k, *began, np.nan)
            for k in range(2)
        )
        joints = (np.arange(2.0 * JOINTS) + offset).tobytes()
        return self.message(Kind.COMMAND, command + rows + joints)


@pytest.fixture
def far() -> Iterator[FarEnd]:
    end = FarEnd()
    yield end
    end.close()


@pytest.fixture
def observer(far: FarEnd) -> Iterator[Client]:
    """A client that is connected to it."""
    with Client(port=far.port, watchdog=5.0, keys=far.keys) as one:
        with far.hearing(Kind.HELLO):
            one.connect(PATIENCE)
        yield one


@pytest.fixture
def client(far: FarEnd, observer: Client) -> Client:
    """A client that has sent positions of its arms, and has the command."""
    with far.hearing(Kind.STATE):
        observer.cycle([0.0, 0.0, 0.0], [0.0, 0.0, 0.0], timeout=0.0)
    return observer
