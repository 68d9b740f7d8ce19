"""What is read and refused without a service."""

import json
from dataclasses import replace

import numpy as np
import pytest

from armguard.bridges.zenoh_bridge.authority import (
    MOST_SESSIONS,
    Authority,
    Sequences,
)
from armguard.bridges.zenoh_bridge.schema import (
    DroppedError,
    command_of,
    plain,
    read,
    verdict_of,
)
from armguard.bridges.zenoh_bridge.seal import Sender
from armguard.bridges.zenoh_bridge.settings import (
    BridgeError,
    BridgeSettings,
    on_this_machine,
)
from armguard.service.client import Client
from armguard.service.client.answer import stop_answer
from armguard.service.client.welcome import NOTHING
from armguard.service.wire import Cause


@pytest.mark.parametrize(
    ("endpoint", "here"),
    [
        ("tcp/127.0.0.1:7447", True),
        ("tcp/[::1]:7447", True),
        ("udp/127.8.9.1:1", True),
        ("tcp/localhost:7447", True),
        ("unixsock-stream//tmp/x.sock", True),
        ("tcp/0.0.0.0:7447", False),
        ("tcp/[::]:7447", False),
        ("tcp/192.168.1.7:7447", False),
        ("tcp/127.0.0.1.example.org:7447", False),
        ("tcp/:7447", False),
        ("", False),
    ],
)
def test_endpoints_that_leave_the_machine_are_known(endpoint, here):
    assert on_this_machine(endpoint) == here


def test_endpoints_that_leave_the_machine_are_refused():
    for field in ("listen", "connect"):
        with pytest.raises(BridgeError, match="leaves this machine"):
            BridgeSettings(port=1, **{field: ("tcp/0.0.0.0:7447",)})


@pytest.mark.parametrize("name", ["", "*", "a/b", "a?b", "$*"])
def test_names_that_are_no_part_of_a_key_are_refused(name):
    with pytest.raises(BridgeError, match="no part of a key"):
        BridgeSettings(port=1, name=name)


@pytest.mark.parametrize(
    "text", ['{"a": NaN}', '{"a": [Infinity]}', '{"a": -Infinity}']
)
def test_json_has_no_infinity(text):
    with pytest.raises(DroppedError) as found:
        read(text.encode())
    assert found.value.cause == "not_finite"


def test_what_has_no_number_is_null():
    assert json.dumps([plain(1.5), plain(float("inf")), plain(float("nan"))]) == (
        "[1.5, null, null]"
    )


def test_a_stop_of_robots_without_a_measurement_is_json():
    """The last word of a service that ends before any state came."""
    nowhere = np.full(2, np.nan)
    welcome = replace(NOTHING, names=("a/j1", "a/j2"), robots=("a",))
    stop = stop_answer(Cause.SHUTDOWN, nowhere, welcome, Client(port=1).clock)
    command = json.loads(
        json.dumps(command_of(stop, lambda *state: None), allow_nan=False)
    )
    assert command["began_by"] is None and command["states"] == {"a": None}
    assert command["positions"] == [None, None]
    assert command["velocities"] == [0.0, 0.0] and command["stop"]
    verdict = json.loads(json.dumps(verdict_of(stop), allow_nan=False))
    assert verdict["headroom"] is None and verdict["ages"] == {"a": None}


def test_only_the_commander_commands():
    authority = Authority(watchdog=0.5)
    first, second = Sender(3, b"a" * 16), Sender(3, b"b" * 16)
    with pytest.raises(DroppedError):
        authority.check(first, 0.0)
    authority.grant(first, "first", 0.0)
    authority.check(first, 0.4)
    for other in (second, Sender(4, b"a" * 16)):
        with pytest.raises(DroppedError, match="'first' has the command"):
            authority.check(other, 0.4)
    assert not authority.silent(0.8) and authority.silent(1.0)
    authority.lose()
    with pytest.raises(DroppedError):
        authority.check(first, 1.0)


def test_no_number_is_taken_twice():
    sequences = Sequences(keep=2.0)
    sender = Sender(3, b"a" * 16)
    for sequence in (1, 7):
        sequences.check(sender, "wish", sequence, 0.0)
    for sequence in (7, 6, 0):
        with pytest.raises(DroppedError) as found:
            sequences.check(sender, "wish", sequence, 0.0)
        assert found.value.cause == "out_of_order"
    # Another kind of message, or another role, has numbers of its own.
    sequences.check(sender, "state", 1, 0.0)
    sequences.check(Sender(4, b"a" * 16), "wish", 1, 0.0)


def test_numbers_are_forgotten_only_when_their_messages_are_too_old_to_count():
    sequences = Sequences(keep=2.0)
    for k in range(MOST_SESSIONS):
        sequences.check(Sender(3, k.to_bytes(16)), "wish", 9, 0.001 * k)
    stranger = Sender(3, b"b" * 16)
    with pytest.raises(DroppedError) as found:
        sequences.check(stranger, "wish", 1, 1.9)
    assert found.value.cause == "overrun"
    sequences.check(stranger, "wish", 1, 2.5)
    with pytest.raises(DroppedError):
        sequences.check(Sender(3, (600).to_bytes(16)), "wish", 9, 2.5)
