"""Which messages of a service count at a client, and what it makes of them."""

import struct

import numpy as np
import pytest

from armguard import Client
from armguard.service.wire import Cause, Kind, Seal
from armguard.service.wire.layout import HEADER, HEARTBEAT
from service_arms import wait_for

KEY = b"0123456789abcdef"
PATIENCE, SECOND = 20.0, 1_000_000_000


def again(message: bytearray, at: int, form: str, value: int) -> bytearray:
    """Changed, and sealed anew."""
    struct.pack_into(form, message, at, value)
    Seal(KEY).put(memoryview(message))
    return message


def flipped(message: bytearray, at: int) -> bytearray:
    message[at] ^= 1
    return message


WRONG = {
    "empty": lambda far: b"",
    "too short": lambda far: far.command(1)[:40],
    "too long": lambda far: bytes(8193),
    "not ours": lambda far: again(far.command(1), 0, "<I", 1),
    "another version": lambda far: again(far.command(1), 4, "<B", 9),
    "another length": lambda far: again(far.command(1), 6, "<H", 99),
    "cut off": lambda far: far.command(1)[:-8],
    "lengthened": lambda far: far.command(1) + bytes(8),
    "changed": lambda far: flipped(far.command(1), -20),
    "changed seal": lambda far: flipped(far.command(1), -1),
    "another session": lambda far: again(far.command(1), 8, "<Q", 6),
    "another scene": lambda far: again(far.command(1), 16, "<Q", 8),
    "not of the service": lambda far: again(far.command(1), 24, "<Q", 3),
    "old": lambda far: again(far.command(1), 32, "<Q", 1),
    "of no number": lambda far: again(far.command(1), 32, "<Q", 0),
    "other joints": lambda far: far.command(1, joints=2),
    "a cause that is none": lambda far: far.command(1, cause=77),
    "a body that is none": lambda far: far.command(1, b=3),
    "a bye not ours": lambda far: again(far.message(Kind.BYE), 0, "<I", 1),
    "a bye of another version": lambda far: again(far.message(Kind.BYE), 4, "<B", 9),
    "a bye of another length": lambda far: again(far.message(Kind.BYE), 6, "<H", 99),
    "a bye of another session": lambda far: again(far.message(Kind.BYE), 8, "<Q", 6),
    "the bye of another client": lambda far: again(far.message(Kind.BYE), 24, "<Q", 3),
    "an old bye": lambda far: again(far.message(Kind.BYE), 32, "<Q", 1),
    "a bye with another seal": lambda far: flipped(far.message(Kind.BYE), -1),
    "half a heartbeat": lambda far: far.outbox.message(Kind.HEARTBEAT, bytes(8)),
    "half a grant": lambda far: far.outbox.message(Kind.GRANT, bytes(8)),
    "half a welcome": lambda far: far.outbox.message(Kind.WELCOME, bytes(8)),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_what_is_wrong_is_dropped_and_is_no_answer(far, client, wrong):
    message, dropped = WRONG[wrong](far), client.dropped
    far.send(bytes(message))
    far.say(Kind.HEARTBEAT, HEARTBEAT.pack(1, far.sender))
    assert client.receive(0.02) is None
    assert client.dropped == dropped + 1
    assert client.latest.cause is Cause.NO_ANSWER
    assert client.commands
    far.send(far.command(2))
    assert client.receive(PATIENCE).cycle == 2


def test_a_message_that_comes_twice_counts_once(far, client):
    first, second, dropped = far.command(1), far.command(2), client.dropped
    for message in (first, second, second, first):
        far.send(message)
    assert [client.receive(PATIENCE).cycle for _ in range(2)] == [1, 2]
    assert client.receive(0.02) is None
    assert client.dropped == dropped + 2
    assert client.latest.cycle == 2


def test_an_answer_says_what_its_message_did_whatever_comes_after_it(far, client):
    message = bytes(far.command(1))
    far.send(message)
    answer = client.receive(PATIENCE)
    # Nothing of it was looked at before the next ones came into the same room.
    for k in range(2, 12):
        far.send(far.command(k, offset=float(k), a=1))
        assert client.receive(PATIENCE).cycle == k
    assert answer.cycle == 1
    assert answer.began == (client.sender, 1)
    assert answer.velocity.tolist() == [0.0, 1.0, 2.0]
    assert answer.position.tolist() == [3.0, 4.0, 5.0]
    assert (answer.headroom, answer.time_left, answer.time) == (0.0, 0.7, 1.5)
    assert answer.inside == pytest.approx(1e-8)
    near = answer.nearest
    assert (near.a, near.b) == ("left/hand", "bench")
    assert (near.distance, near.headroom) == (0.3, 0.2)
    assert [*near.point_a, *near.point_b] == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    assert answer.cause is Cause.NONE
    assert answer.missed and not answer.stops
    assert answer.commander == client.sender
    assert answer.sent == HEADER.unpack_from(message)[8] * 1e-9
    assert answer.speed_scale == {"left": 0.5, "right": 0.5}
    assert answer.ages == {"left": 0.0, "right": 1.0}
    assert [int(why) for why in answer.blocked.values()] == [0, 10]
    assert answer.answers(client.sender, 1) and not answer.answers(client.sender, 2)
    assert "cycle=1" in repr(answer)
    with pytest.raises(ValueError, match="read-only"):
        answer.velocity[:] = 0.0
    with pytest.raises(AttributeError):
        answer.velocity = np.zeros(3)


def test_an_answer_without_a_near_pair_names_no_body(far, client):
    far.send(far.command(1, a=0xFFFFFFFF, b=0xFFFFFFFF))
    assert client.receive(PATIENCE).nearest is None


def test_an_answer_is_as_old_as_its_own_clock_says(far, client):
    far.behind = 60 * SECOND
    far.send(far.command(1))
    answer = client.receive(PATIENCE)
    assert 60.0 < answer.age < 120.0
    newest = client.latest
    assert newest.cause is Cause.NO_ANSWER
    assert newest.stops and not newest.velocity.any()


def test_a_service_of_which_everything_is_old_is_silent(far):
    far.behind = 60 * SECOND
    with Client(port=far.port, watchdog=5.0, keys=far.keys) as late:
        with far.hearing(Kind.HELLO):
            late.connect(PATIENCE)
        far.send(far.command(1))
        far.say(Kind.HEARTBEAT, HEARTBEAT.pack(1, 0))
        assert late.receive(PATIENCE) is not None
        assert late.latest.cause is Cause.SERVICE_SILENT
        far.behind = 0
        far.say(Kind.HEARTBEAT, HEARTBEAT.pack(1, 0))
        wait_for(lambda: late.latest.cause is Cause.NO_ANSWER)
        far.send(far.command(2))
        wait_for(lambda: late.latest.cycle == 2)
