"""Messages that are almost right, thrown at a running service.

    python tests/service_fuzz.py PORT COUNTERS NUMBER [SEED]

They are made from right ones, by a sender the service knows, who has neither the
command nor a robot. Some are changed after they were sealed, some before: the latter
get past the seal, and it is what they say that must not be let through.
"""

import json
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

from armguard import Client
from armguard.recording.calls import CALLS
from armguard.recording.counters import CountersReader
from armguard.service.wire import Role
from armguard.service.wire.layout import (
    CLAIM,
    GIVE_BACK,
    HEADER,
    HELLO,
    LEAST,
    MOST,
    NO_COOKIE,
    STATE,
    WISH,
    Kind,
)

# Messages that are under way at most: more, and the machine drops some unseen.
UNDER_WAY = 12

# From one step of who does it right to the next, in messages.
STEP = 60

# Numbers in which code that reads others' numbers goes wrong.
WORDS = np.array([0, 1, 2, 7, 63, 2**31 - 1, 2**31, 2**32 - 1], np.uint32)
NUMBERS = np.array(
    [0.0, -0.0, 1.0, np.nan, np.inf, -np.inf, 1e308, -1e308, 5e-324, 1e-3, 2**53]
)
# A stop that is ordered would end what is tested.
NAMES = (*sorted(CALLS.keys() - {"stop"}), "nothing", "", "__init__")


class Fuzzer:
    """Makes messages that are wrong.

    Attributes:
        client: The client whose name they go under.

    Args:
        client: See there; connected.
        seed: What is drawn follows from it.
    """

    def __init__(self, client: Client, seed: int) -> None:
        self.client = client
        self._rng = np.random.default_rng(seed)
        self._outbox = client._connection.outbox
        self._seal = client._connection.seal
        self._older: list[bytes] = []
        self._makers: tuple[Callable[[], bytes], ...] = (
            self._state,
            self._desired,
            self._call,
            self._claim,
            self._give_back,
            self._hello,
            self._heartbeat,
            self._noise,
        )

    def draw(self) -> bytes:
        """A message that is wrong."""
        rng = self._rng
        message = bytearray(self._makers[rng.integers(len(self._makers))]())
        way = rng.integers(7)
        if way == 0:
            # Changed under way: a bit, or some bytes.
            for _ in range(rng.integers(1, 4)):
                message[rng.integers(len(message))] ^= 1 << rng.integers(8)
        elif way == 1:
            message = message[: rng.integers(len(message))]
        elif way == 2:
            message += rng.bytes(int(rng.integers(1, MOST)))
        elif way == 3 and len(message) >= LEAST:
            # The header says something else, and the seal says so too. It stays the
            # kind it is, and keeps its number, or all that follows is out of order.
            at = int(rng.integers(HEADER.size))
            if at != 5 and not 32 <= at < 40:
                message[at] ^= 1 << rng.integers(8)
            self._seal.put(memoryview(message))
        elif way == 4 and self._older:
            return self._older[rng.integers(len(self._older))]
        elif way == 5 and len(message) >= LEAST:
            # What it holds is something else.
            for _ in range(rng.integers(1, 9)):
                if message[5] not in (Kind.CLAIM, Kind.HELLO):
                    at = int(rng.integers(HEADER.size, len(message) - 15))
                    message[at] = rng.integers(256)
            self._seal.put(memoryview(message))
        if rng.random() < 0.02:
            self._older = [*self._older[-50:], bytes(message)]
        return bytes(message)

    def _numbers(self, count: int) -> bytes:
        found = self._rng.choice(NUMBERS, count)
        return bytes(found.tobytes())

    def _word(self) -> int:
        return int(self._rng.choice(WORDS))

    def _state(self) -> bytes:
        rng = self._rng
        right = rng.random() < 0.5
        bits, flags = (3, int(rng.integers(4))) if right else (self._word(),) * 2
        count = 14 * int(rng.integers(1, 4)) if right else int(rng.integers(60))
        stamp = float(rng.choice(NUMBERS))
        payload = STATE.pack(bits, flags, stamp) + self._numbers(count)
        return bytes(self._outbox.message(Kind.STATE, payload))

    def _desired(self) -> bytes:
        rng = self._rng
        count = int(rng.choice([0, 7, 14, 15, 21, 200]))
        stated = count if rng.random() < 0.7 else self._word()
        token = int(rng.integers(2**63))
        payload = WISH.pack(token, int(rng.integers(6)), stated) + self._numbers(count)
        return bytes(self._outbox.message(Kind.WISH, payload))

    def _call(self) -> bytes:
        rng = self._rng
        call = {
            "id": int(rng.integers(2**31)),
            "call": str(rng.choice(NAMES)),
            "arguments": {
                str(
                    rng.choice(["name", "robot", "pose", "q", "a", "b", "mode", "x"])
                ): (rng.choice([None, "left", "bench", "", "fixed", 7, -1]))
                for _ in range(rng.integers(4))
            },
        }
        text = json.dumps(call, default=str).encode()
        return bytes(self._outbox.message(Kind.CALL, text))

    def _claim(self) -> bytes:
        return bytes(self._outbox.message(Kind.CLAIM, CLAIM.pack(0, self._word())))

    def _give_back(self) -> bytes:
        token = int(self._rng.integers(2**63))
        return bytes(self._outbox.message(Kind.GIVE_BACK, GIVE_BACK.pack(token)))

    def _hello(self) -> bytes:
        payload = HELLO.pack(int(Role.COMMAND), 0, NO_COOKIE) + self._rng.bytes(
            int(self._rng.integers(80))
        )
        return bytes(self._outbox.message(Kind.HELLO, payload))

    def _heartbeat(self) -> bytes:
        payload = self._rng.bytes(int(self._rng.integers(3)))
        return bytes(self._outbox.message(Kind.HEARTBEAT, payload))

    def _noise(self) -> bytes:
        return self._rng.bytes(int(self._rng.integers(1, MOST + 100)))


def fuzz(
    port: int,
    counters: CountersReader,
    number: int,
    seed: int = 0,
    step: Callable[[], object] = lambda: None,
) -> int:
    """Throw messages at a service.

    Args:
        port: Its port.
        counters: Its counters.
        number: How many messages.
        seed: See `Fuzzer`.
        step: Called again and again meanwhile.

    Returns:
        How many the service has read.
    """
    with Client(port=port, name="fuzzer", every=0) as client:
        client.connect(20.0)
        fuzzer = Fuzzer(client, seed)
        own = client._connection.socket
        assert own is not None
        first = counters.value("received")
        for k in range(number):
            own.sendto(fuzzer.draw()[: MOST + 90], ("127.0.0.1", port))
            if k % UNDER_WAY == 0:
                # What was sent before this question is read before it.
                client.call("ping")
            if k % STEP == 0:
                step()
        return counters.value("received") - first


if __name__ == "__main__":
    came = fuzz(
        int(sys.argv[1]),
        CountersReader(Path(sys.argv[2])),
        int(sys.argv[3]),
        int(sys.argv[4]) if len(sys.argv) > 4 else 0,
    )
    print(f"{came} messages were read")
