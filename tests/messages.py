"""Messages with something wrong in them, from a client that said hello."""

import socket
import time

import numpy as np

from armguard import Client
from armguard.service.wire import Form, Kind, Outbox
from armguard.service.wire.layout import STATE, WISH

JOINTS = 14


class Forger:
    """A sender that knows everything a client knows, and what to get wrong."""

    def __init__(self, client: Client) -> None:
        # Its socket, address and numbers are those of a client that said hello.
        self.client = client
        self.outbox: Outbox = client._connection.outbox
        self.socket: socket.socket = client._connection.socket
        self.address = client._connection.address
        self.seal = client._connection.seal

    def send(self, message: bytes) -> None:
        self.socket.sendto(message, self.address)

    def state(self, joints: int = JOINTS, bits: int = 3, flags: int = 0) -> bytearray:
        q = np.zeros(joints) if joints != JOINTS else self.client.welcome.home
        payload = STATE.pack(bits, flags, time.monotonic()) + q.tobytes()
        return bytearray(self.outbox.message(Kind.STATE, payload))

    def desired(self, values: np.ndarray, form: int = Form.VELOCITIES) -> bytearray:
        token = self.client._token
        payload = WISH.pack(token, form, len(values)) + values.tobytes()
        return bytearray(self.outbox.message(Kind.WISH, payload))

    def call(self, payload: bytes) -> bytes:
        return bytes(self.outbox.message(Kind.CALL, payload))

    def again(self, message: bytearray) -> bytearray:
        """Sealed anew after something was changed."""
        self.seal.put(memoryview(message))
        return message
