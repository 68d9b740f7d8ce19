"""What the relay does to messages is what its name says, and nothing else."""

import math
import socket
import time

import pytest

from armguard.chaos import tampering
from armguard.chaos.relay import Relay
from armguard.chaos.tampering import STATES, on, rewritten
from armguard.service.wire import Kind, Outbox, Seal
from armguard.service.wire.layout import HEADER, SEAL, STATE

SIZE = 40
KEY = b"0123456789abcdef"


def state(seal=None):
    """A STATE of five numbers, sealed."""
    outbox = Outbox(seal or Seal(KEY), 7, 8, 9)
    outbox.payload[: STATE.size + SIZE] = STATE.pack(1, 0, 2.0) + bytes(SIZE)
    return bytes(outbox.seal(Kind.STATE, STATE.size + SIZE))


def test_only_messages_of_the_chosen_kind_are_tampered_with():
    tamper = on(STATES, tampering.lost)
    message = state()
    assert tamper(message, True) == ()
    assert tamper(message, False) == ((0.0, message),)
    other = bytearray(message)
    other[5] = Kind.WISH
    assert tamper(bytes(other), True) == ((0.0, bytes(other)),)
    assert tamper(b"", True) == ((0.0, b""),)


@pytest.mark.parametrize(
    "change",
    [tampering.corrupted(), tampering.cut(), tampering.grown],
    ids=["corrupted", "cut", "grown"],
)
def test_a_damaged_message_does_not_fit_its_seal(change):
    message = state()
    for _ in range(50):
        for _, other in change(message):
            assert other != message
            fits = len(other) >= SEAL and Seal(KEY).fits(memoryview(other))
            assert not fits


def test_a_rewritten_message_fits_and_says_something_else():
    seal, message = Seal(KEY), state()
    ((_, other),) = rewritten(seal, tampering.put_first(math.nan))(message)
    assert seal.fits(memoryview(other))
    assert math.isnan(memoryview(other)[64:72].cast("d")[0])
    ((_, shifted),) = rewritten(seal, tampering.shift_stamp(-0.5))(message)
    assert STATE.unpack_from(shifted, HEADER.size)[2] == 1.5


def test_a_frozen_state_keeps_its_first_payload_under_new_numbers():
    change = rewritten(Seal(KEY), tampering.frozen())
    first = state()
    change(first)
    later = bytearray(state())
    later[32:40] = (99).to_bytes(8, "little")
    later[64:72] = bytes(range(8))
    ((_, other),) = change(bytes(later))
    assert other[32:40] == later[32:40]
    assert other[HEADER.size : -SEAL] == first[HEADER.size : -SEAL]


def test_every_third_message_is_overtaken():
    change = tampering.reordered(0.01)
    assert [change(state())[0][0] for _ in range(6)] == [0, 0, 0.01, 0, 0, 0.01]


def test_a_joint_that_is_missing_is_missing_in_the_length_too():
    ((_, other),) = tampering.joint_missing(Seal(KEY))(state())
    assert len(other) == len(state()) - 8
    assert HEADER.unpack_from(other)[3] == len(other)
    assert Seal(KEY).fits(memoryview(other))


def test_the_relay_hands_messages_on_both_ways_and_delays_them():
    sent = state()
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as service,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client,
    ):
        service.bind(("127.0.0.1", 0))
        service.settimeout(5.0)
        client.settimeout(5.0)
        relay = Relay(service.getsockname()[1])
        try:
            client.sendto(sent, ("127.0.0.1", relay.port))
            message, sender = service.recvfrom(8192)
            assert message == sent
            service.sendto(b"an answer", sender)
            assert client.recv(8192) == b"an answer"
            relay.tamper = on(STATES, tampering.late(0.2))
            start = time.monotonic()
            client.sendto(sent, ("127.0.0.1", relay.port))
            assert service.recvfrom(8192)[0] == sent
            assert time.monotonic() - start >= 0.2
        finally:
            relay.close()
