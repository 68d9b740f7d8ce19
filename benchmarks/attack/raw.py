"""A client written from docs/service.md alone, that may lie in every field.

Nothing here is imported from armguard, so that what it sees is not what armguard's own
client takes it for.
"""

import json
import secrets
import socket
import struct
import time
from enum import IntEnum
from hashlib import blake2s
from typing import Any, NamedTuple

MAGIC, VERSION = 0x44524741, 3
HEADER = struct.Struct("<IBBHQQQQq")
SEAL = 16
LONGEST = 8192


# Kinds of messages, and what keys are for; numbers of both begin at 1.
Kind = IntEnum(
    "Kind",
    "HELLO WELCOME STATE WISH COMMAND HEARTBEAT CLAIM GRANT "
    "GIVE_BACK CALL REPLY STOP BYE CHALLENGE REFUSAL",
)
Role = IntEnum("Role", "OBSERVE SENSE COMMAND ADMINISTER")

NO_COOKIE = bytes(16)

# Where a COMMAND has its fields, counted from the start of the message.
COMMAND_AT = HEADER.size
SUMMARY_AT = COMMAND_AT + 136
ROBOTS_AT = SUMMARY_AT + 24
ROBOT = struct.Struct("<4H2fdQQd")

# Longest wait for an answer [s].
PATIENCE = 20.0


class Heard(NamedTuple):
    """Content of a COMMAND.

    Attributes:
        came: When it was received, monotonic [s].
        cause: Its cause.
        commander: Number of who commands.
        actions: Action of each robot.
        flags: Its flags.
        velocities: Velocities of all joints [rad/s or m/s].
        positions: The same as positions [rad or m].
    """

    came: float
    cause: int
    commander: int
    actions: tuple[int, ...]
    flags: int
    velocities: tuple[float, ...]
    positions: tuple[float, ...]


class Raw:
    """A socket, a number, and any key.

    Attributes:
        sender: Its number.
        session: Session that its messages name.
        scene: Scene that its messages name.
        sequence: Number of its last message.
        token: What the service has granted it; 0 for nothing.
        welcome: What the service reports of itself.
        socket: Its socket, which is connected to the service.

    Args:
        port: Port of the service on this machine.
        key: Any key.
        role: What it says that its key is for.
        sender: See there; a new one if 0.
    """

    def __init__(
        self, port: int, key: bytes, role: int = Role.OBSERVE, sender: int = 0
    ) -> None:
        self.key, self.role = key, role
        self.sender = sender or secrets.randbits(63) | 1
        self.session = self.scene = self.sequence = self.token = 0
        self.welcome: dict[str, Any] = {}
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect(("127.0.0.1", port))
        self._calls = 0

    def __enter__(self) -> "Raw":
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()

    def message(self, kind: int, payload: bytes = b"", **lies: int) -> bytes:
        """A message, sealed.

        Args:
            kind: Its kind.
            payload: Its payload.
            lies: Fields of the header that are others: session, scene, sender,
                sequence, stamp.
        """
        self.sequence += 1
        head = HEADER.pack(
            MAGIC,
            VERSION,
            kind,
            HEADER.size + len(payload) + SEAL,
            lies.get("session", self.session),
            lies.get("scene", self.scene),
            lies.get("sender", self.sender),
            lies.get("sequence", self.sequence),
            lies.get("stamp", time.monotonic_ns()),
        )
        return sealed(head + payload, self.key)

    def send(self, message: bytes) -> None:
        """Send a message; what the system does not take is lost."""
        try:
            self.socket.send(message)
        except OSError:
            return

    def say(self, kind: int, payload: bytes = b"", **lies: int) -> bytes:
        """Make a message and send it."""
        message = self.message(kind, payload, **lies)
        self.send(message)
        return message

    def receive(self, timeout: float) -> bytes | None:
        """The next message that fits the key; None if there is none in time."""
        end = time.monotonic() + timeout
        while True:
            self.socket.settimeout(max(end - time.monotonic(), 0.0))
            try:
                message = self.socket.recv(LONGEST + 1)
            except (BlockingIOError, TimeoutError):
                return None
            except OSError:
                # No process listens there.
                time.sleep(0.001)
                if time.monotonic() >= end:
                    return None
                continue
            if (
                len(message) > HEADER.size
                and sealed(message[:-SEAL], self.key) == message
            ):
                return message

    def hear(self, kind: int, timeout: float = PATIENCE) -> bytes | None:
        """The next message of a kind; None if there is none in time."""
        end = time.monotonic() + timeout
        while (left := end - time.monotonic()) > 0.0:
            message = self.receive(left)
            if message is not None and message[5] == kind:
                return message
        return None

    def hello(self, cookie: bytes = NO_COOKIE, every: int = 0) -> bytes:
        """Say hello."""
        return self.say(
            Kind.HELLO, struct.pack("<II16s", self.role, every, cookie) + b"raw"
        )

    def connect(self, every: int = 0, timeout: float = PATIENCE) -> tuple[bytes, bytes]:
        """Say hello in full; both HELLOs that did it.

        Raises:
            ConnectionError: The service does not answer.
        """
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            self.session, self.scene, parts = 0, 0, {}
            first = self.hello(every=every)
            challenge = self.hear(Kind.CHALLENGE, 0.5)
            if challenge is None:
                continue
            self.session = HEADER.unpack_from(challenge)[4]
            second = self.hello(challenge[HEADER.size + 8 : HEADER.size + 24], every)
            while (part := self.hear(Kind.WELCOME, 0.5)) is not None:
                self.scene = HEADER.unpack_from(part)[5]
                number, count = struct.unpack_from("<II", part, HEADER.size)
                parts[number] = part[HEADER.size + 40 : -SEAL]
                if len(parts) == count:
                    text = b"".join(parts[k] for k in range(count))
                    self.welcome = json.loads(text)
                    return first, second
            # Part of it was lost, so this sender is known; another one begins anew.
            self.say(Kind.BYE)
            self.sender = secrets.randbits(63) | 1
        raise ConnectionError("the service does not answer")

    def claim(self, force: bool = False) -> bool:
        """Claim the command; whether it was granted."""
        for _ in range(20):
            self.say(Kind.CLAIM, struct.pack("<II", force, 0))
            grant = self.hear(Kind.GRANT, 0.5)
            if grant is not None:
                granted, _, self.token = struct.unpack_from("<IIQ", grant, HEADER.size)
                return bool(granted)
        return False

    def calling(self, call: str, number: int = 0, **arguments: Any) -> bytes:
        """The payload of a CALL."""
        self._calls += 1
        words = {"id": number or self._calls, "call": call, "arguments": arguments}
        return json.dumps(words).encode()

    def call(self, call: str, **arguments: Any) -> dict[str, Any]:
        """Call something, again and again until there is a reply.

        Raises:
            ConnectionError: There is none.
        """
        payload = self.calling(call, **arguments)
        for _ in range(20):
            self.say(Kind.CALL, payload)
            while (reply := self.hear(Kind.REPLY, 0.5)) is not None:
                if struct.unpack_from("<Q", reply, HEADER.size)[0] == self.sequence:
                    answer: dict[str, Any] = json.loads(reply[HEADER.size + 8 : -SEAL])
                    return answer
        raise ConnectionError(f"the call '{call}' has no reply")

    def desired(self, velocities: list[float], token: int | None = None) -> bytes:
        """The payload of a WISH for velocities."""
        shown = self.token if token is None else token
        count = len(velocities)
        return struct.pack(f"<QII{count}d", shown, 1, count, *velocities)

    def state(
        self, q: list[float], v: list[float], desired: bytes = b"", robots: int = 3
    ) -> bytes:
        """The payload of a STATE, measured now."""
        flags = 1 | (2 if desired else 0)
        numbers = struct.pack(f"<{2 * len(q)}d", *q, *v)
        return struct.pack("<IId", robots, flags, time.monotonic()) + numbers + desired


def sealed(head: bytes, key: bytes) -> bytes:
    """Bytes with a seal behind them."""
    return head + blake2s(head, key=key, digest_size=SEAL).digest()


def heard(message: bytes) -> Heard:
    """Content of a COMMAND."""
    cause, flags = struct.unpack_from("<HxxxxH", message, SUMMARY_AT + 2)
    joints, robots = struct.unpack_from("<HH", message, SUMMARY_AT + 10)
    (commander,) = struct.unpack_from("<Q", message, SUMMARY_AT + 16)
    actions = tuple(
        ROBOT.unpack_from(message, ROBOTS_AT + k * ROBOT.size)[1] for k in range(robots)
    )
    numbers = struct.unpack_from(
        f"<{2 * joints}d", message, ROBOTS_AT + robots * ROBOT.size
    )
    return Heard(
        time.monotonic(),
        cause,
        commander,
        actions,
        flags,
        numbers[:joints],
        numbers[joints:],
    )
