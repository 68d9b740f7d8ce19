"""What is not let in: one message of each kind of wrong, counted by its cause."""

import socket
from collections.abc import Callable

import numpy as np
import pytest

from armguard import Action, Client, Reason
from armguard.service.wire import Kind, Role
from armguard.service.wire.keys import new_keys, write_keys
from armguard.service.wire.layout import HEADER, MOST, SEAL
from messages import JOINTS, Forger
from service_arms import Arms, wait_for


def changed(message: bytearray, at: int, by: int = 1) -> bytearray:
    message[at] ^= by
    return message


WRONG: dict[str, tuple[str, Callable[[Forger], bytes]]] = {
    "too short": ("too_short", lambda f: f.state()[:40]),
    "empty": ("too_short", lambda f: b""),
    "oversized": ("oversized", lambda f: bytes(MOST + 1)),
    "not ours": ("magic", lambda f: changed(f.state(), 0)),
    "another version": ("version", lambda f: f.again(changed(f.state(), 4, 3))),
    "cut off": ("length", lambda f: f.state()[:-8]),
    "lengthened": ("length", lambda f: f.state() + bytes(8)),
    "corrupted": ("seal", lambda f: changed(f.state(), 80)),
    "corrupted seal": ("seal", lambda f: changed(f.state(), -1)),
    "unknown kind": ("kind", lambda f: f.again(changed(f.state(), 5, 0x40))),
    "a command": ("kind", lambda f: bytes(f.outbox.message(Kind.COMMAND, bytes(300)))),
    "another session": ("session", lambda f: f.again(changed(f.state(), 8))),
    "another scene": ("scene", lambda f: f.again(changed(f.state(), 16))),
    "a stranger": ("unknown_sender", lambda f: f.again(changed(f.state(), 24))),
    "no robots": ("robots", lambda f: bytes(f.state(bits=0))),
    "robots that are not": ("robots", lambda f: bytes(f.state(bits=7))),
    "too few joints": ("joints", lambda f: bytes(f.state(joints=13))),
    "too many joints": ("joints", lambda f: bytes(f.state(joints=15))),
    "no velocities": ("joints", lambda f: bytes(f.state(flags=1))),
    "half a state": ("payload", lambda f: bytes(f.outbox.message(Kind.STATE, b"1234"))),
    "half a WISH": ("payload", lambda f: bytes(f.outbox.message(Kind.WISH, b"1234"))),
    "a WISH of 13": ("joints", lambda f: bytes(f.desired(np.zeros(13)))),
    "a WISH of no form": ("payload", lambda f: bytes(f.desired(np.zeros(14), 9))),
    "twists of no tool": ("joints", lambda f: bytes(f.desired(np.full(7, 99.0), 3))),
    "a tool and a half": ("joints", lambda f: bytes(f.desired(np.full(7, 0.5), 3))),
    "a WISH of NaN": (
        "wish_not_finite",
        lambda f: bytes(f.desired(np.full(14, np.nan))),
    ),
    "an infinite WISH": (
        "wish_not_finite",
        lambda f: bytes(f.desired(np.r_[np.zeros(13), np.inf])),
    ),
    "an infinite twist": (
        "wish_not_finite",
        lambda f: bytes(f.desired(np.r_[0, np.zeros(5), -np.inf], 3)),
    ),
    "a call of garbage": (
        "call_unreadable",
        lambda f: bytes(f.outbox.message(Kind.CALL, b'{"id": 1, "call')),
    ),
    "a call of depth": (
        "call_unreadable",
        lambda f: bytes(f.outbox.message(Kind.CALL, b"[" * 8000)),
    ),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_what_is_wrong_is_counted_by_its_cause_and_dropped(served, wrong):
    cause, make = WRONG[wrong]
    with served.client() as client:
        client.claim()
        forger = Forger(client)
        counters = served.counters
        before = counters.values()
        forger.send(make(forger))
        name = f"dropped_{cause}"
        wait_for(lambda: counters.value(name) == before[name] + 1)
        after = counters.values()
        dropped = {k for k in after if k.startswith("dropped") and after[k] > before[k]}
        assert dropped == {name}
        assert after["states"] == before["states"]
        assert after["wishes"] == before["wishes"]
        assert client.call("ping")


def test_a_message_that_was_there_already_is_dropped(served):
    with served.client() as client:
        Arms(client).drive(np.zeros(JOINTS), 2)
        forger, counters = Forger(client), served.counters
        first, second = forger.state(), forger.state()
        before = counters.values()
        for message in (second, second, first):
            forger.send(message)
        client.call("ping")
        after = counters.values()
        assert after["dropped_replayed"] == before["dropped_replayed"] + 1
        assert after["dropped_out_of_order"] == before["dropped_out_of_order"] + 1
        assert after["states"] == before["states"] + 1


def test_a_message_from_another_address_is_dropped(served):
    with served.client() as client:
        forger, counters = Forger(client), served.counters
        before = counters.value("dropped_address")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
            other.sendto(forger.state(), forger.address)
        wait_for(lambda: counters.value("dropped_address") == before + 1)


def test_desired_motion_of_nan_ends_the_motion_desired_before_it(served):
    with served.client() as client:
        arms = Arms(client)
        client.claim()
        arms.lead(np.full(JOINTS, 0.02))
        client.send_velocities(np.full(JOINTS, np.nan))
        answer = arms.measure_until(lambda a: a.cause.name == "NO_WISH")
        answer = arms.measure_until(lambda a: not a.velocity.any())
        assert np.isfinite(answer.velocity).all()


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"stamp": 1.0}, Reason.STAMP_AHEAD),
        ({"stamp": np.nan}, Reason.STAMP_MISSING),
        ({"q": np.nan}, Reason.NOT_FINITE),
        ({"q": 2.0}, Reason.STATE_JUMPED),
    ],
    ids=["future", "no stamp", "NaN", "jumps"],
)
def test_a_state_that_cannot_be_is_a_stop_with_its_reason(served, change, reason):
    with served.client() as client:
        arms = Arms(client)
        arms.lead(np.full(JOINTS, 0.02))
        before = served.counters.stops().get(int(reason), 0)
        q = arms.q.copy()
        if "q" in change:
            q[3] = change["q"]
        stamp = client.clock() + change.get("stamp", 0.0)
        client.send_state(q, arms.velocity, stamp)
        wait_for(lambda: served.counters.stops().get(int(reason), 0) == before + 1)
        answer = client.latest
        assert answer.action is Action.STOP


def test_another_key_gets_no_answer_and_the_log_says_so_once_a_second(
    serving, tmp_path
):
    from armguard.errors import NoServiceError

    file = tmp_path / "keys"
    keys = new_keys()
    write_keys(file, keys)
    with serving(f"--key-file={file}") as one:
        for wrong in (keys[Role.SENSE], b"0123456789abcdeF"):
            with pytest.raises(NoServiceError, match="its key for 'command' is not"):
                Client(port=one.port, keys={Role.COMMAND: wrong}).connect(timeout=0.5)
        assert one.counters.value("dropped_seal") >= 2
        assert one.counters.value("accepted") == 0
        with one.client(keys=file) as client:
            # What is wrong a few hundred times is named a few times.
            forger = Forger(client)
            for _ in range(300):
                forger.send(forger.state(joints=13))
            client.call("ping")
            assert one.counters.value("dropped_joints") > 100
            errors = one.end()
        assert 1 <= errors.count("another number of joints") <= 5


def test_header_and_seal_are_where_the_page_says():
    assert HEADER.size == 48
    assert SEAL == 16
