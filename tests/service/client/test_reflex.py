"""A controller obeys the pulses of a reflex, whatever the service says."""

import socket
import time

import pytest

from armguard import Client
from armguard.errors import StationError
from armguard.guard.levels import Level
from armguard.service.wire import Cause, Kind
from armguard.service.wire.pulses import Pulses
from reflex.rack import RESET_KEY, Rack, pulse_bytes

PATIENCE, WATCHDOG = 20.0, 0.5
CLEAR, NEAR = 0, 4
Q = [0.0, 0.0, 0.0]


@pytest.fixture
def rack(tmp_path):
    it = Rack(tmp_path, more={"watchdog": WATCHDOG})
    it.listener.close()
    yield it
    it.out.close()


@pytest.fixture
def client(far, rack):
    """A client that is connected; its scene has a reflex."""
    far.text["reflex"] = str(rack.file)
    with Client(port=far.port, watchdog=5.0, keys=far.keys) as one:
        with far.hearing(Kind.HELLO):
            one.connect(PATIENCE)
        yield one


def say(rack, trip, stamp=None, **more):
    stamp = time.monotonic_ns() if stamp is None else stamp
    to = ("127.0.0.1", rack.given["listeners"][0])
    rack.out.sendto(pulse_bytes(trip, stamp, **more), to)


def controls(far, client):
    """The client sends a state, as a controller."""
    with far.hearing(Kind.STATE):
        client.send_state(Q)


def test_a_controller_moves_only_with_pulses(far, client, rack):
    controls(far, client)
    far.send(far.command(1))
    answer = client.receive(PATIENCE)
    assert (answer.cause, answer.reason) == (Cause.REFLEX_SILENT,) * 2
    assert answer.level is Level.STOP and answer.stops
    assert not answer.velocity.any()
    say(rack, CLEAR, key=RESET_KEY)
    say(rack, CLEAR, stamp=time.monotonic_ns() - int(1.01e9 * WATCHDOG))
    assert client.latest.cause is Cause.REFLEX_SILENT


def test_an_observer_needs_no_pulses(far, client):
    with far.hearing(Kind.HEARTBEAT):
        time.sleep(0.25)
        client.receive()
    far.send(far.command(1))
    assert client.receive(PATIENCE).cause is Cause.NONE


def test_its_stop_is_at_once_and_ends_only_when_the_guard_waits_for_engage(
    far, client, rack
):
    controls(far, client)
    say(rack, CLEAR)
    far.send(far.command(1))
    assert client.receive(PATIENCE).cause is Cause.NONE
    # Without any message of the service.
    say(rack, NEAR)
    assert client.receive(PATIENCE).cause is Cause.REFLEX_STOPPED
    assert client.receive() is None
    far.send(far.command(3))
    assert client.receive(PATIENCE).cause is Cause.REFLEX_STOPPED
    # It is reset, and the guard, which knows nothing of it, would let the arms go on.
    say(rack, CLEAR)
    far.send(far.command(4))
    with far.hearing(Kind.STOP):
        assert client.receive(PATIENCE).cause is Cause.REFLEX_STOPPED
    say(rack, CLEAR)
    assert client.latest.cause is Cause.REFLEX_STOPPED
    # A stop that the guard ends by itself does not suffice.
    far.send(far.command(5, action=10))
    say(rack, CLEAR)
    assert client.receive(PATIENCE).cause is Cause.REFLEX_STOPPED
    far.send(far.command(6, action=10, cause=Cause.STOP_ORDERED))
    say(rack, CLEAR)
    assert client.receive(PATIENCE).cause is Cause.STOP_ORDERED
    assert client.latest.cycle == 6
    far.send(far.command(7))
    assert client.receive(PATIENCE).cause is Cause.NONE


def test_silence_of_the_service_is_named_first(far, client, rack):
    controls(far, client)
    far.say(Kind.BYE)
    time.sleep(0.02)
    assert client.latest.cause is Cause.SERVICE_GONE


def test_a_file_that_cannot_be_used_is_an_error_in_words(far, client, rack):
    rack.file.chmod(0o644)
    with pytest.raises(StationError, match="chmod 600"):
        client.send_state(Q)


def test_without_a_free_port_there_is_an_error_in_words(rack):
    taken = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in "abcd"]
    for one, port in zip(taken, rack.given["listeners"], strict=True):
        one.bind(("127.0.0.1", port))
    with pytest.raises(StationError, match="add one for each controller"):
        Pulses(rack.file)
    for one in taken:
        one.close()
