"""A state and desired motion go out, and an answer comes back, or a stop."""

import time

import numpy as np
import pytest

from armguard import Client
from armguard.errors import NoServiceError, RefusedError
from armguard.service.wire import Cause, Kind
from armguard.service.wire.layout import HEADER, HEARTBEAT, SEAL, STATE, WISH

PATIENCE, ANSWERED, TOKEN = 20.0, 4.0, 77
Q, V, WANTED = np.array([0.1, 0.2, 0.3]), np.array([1.0, 2.0, 3.0]), np.full(3, 0.5)


def sequence_of(message: bytes) -> int:
    return HEADER.unpack_from(message)[7]


def answering(far, before=lambda: None):
    """What a service does: a COMMAND to every STATE."""

    def answer(message: bytes) -> None:
        before()
        far.send(far.command(sequence_of(message)))

    return far.hearing(Kind.STATE, answer)


def read(message: bytes, velocities: bool):
    """Robots, stamp, positions, velocities, token and values of a STATE with a WISH."""
    bits, flags, stamp = STATE.unpack_from(message, HEADER.size)
    assert flags == (3 if velocities else 2)
    at = HEADER.size + STATE.size
    rows = np.frombuffer(message[at : at + (48 if velocities else 24)])
    at += rows.nbytes
    token, form, count = WISH.unpack_from(message, at)
    assert (form, count) == (1, 3)
    desired = np.frombuffer(message[at + WISH.size : -SEAL])
    return bits, stamp, rows.tolist(), token, desired.tolist()


def test_a_cycle_says_what_it_is_given_and_returns_the_answer_to_it(far, client):
    heard: list[bytes] = []
    for k in range(3):
        shift = 0.01 * k
        with far.hearing(
            Kind.STATE,
            lambda message: (
                heard.append(message),
                far.send(far.command(sequence_of(message))),
            ),
        ):
            answer = client.cycle(Q + shift, WANTED, V, stamp=7.0 + k, timeout=ANSWERED)
        assert answer.began == (client.sender, sequence_of(heard[-1]))
        measured = [*(Q + shift), *V]
        assert read(heard[-1], True) == (3, 7.0 + k, measured, TOKEN, [*WANTED])
    assert sequence_of(heard[2]) == sequence_of(heard[0]) + 2


def test_velocities_and_stamp_may_be_left_out(far, client):
    heard: list[bytes] = []
    with far.hearing(Kind.STATE, heard.append):
        before = client.clock()
        client.cycle(Q, WANTED, timeout=0.01)
    bits, stamp, rows, _, _ = read(heard[0], False)
    assert (bits, rows) == (3, [*Q])
    assert before <= stamp <= client.clock()


@pytest.mark.parametrize(
    "form",
    [
        list,
        tuple,
        lambda x: x.astype(np.float32),
        lambda x: x.astype(">f8"),
        lambda x: np.repeat(x, 2)[::2],
        lambda x: np.asfortranarray(np.stack([x, x]))[0],
    ],
    ids=["list", "tuple", "float32", "big-endian", "strided", "row"],
)
def test_numbers_are_taken_in_any_form(far, client, form):
    heard: list[bytes] = []
    q, v, desired = (
        np.array([0.5, 0.25, -1.0]),
        np.array([1.0, 2.0, 4.0]),
        np.full(3, 8.0),
    )
    with far.hearing(Kind.STATE, heard.append):
        client.cycle(form(q), form(desired), form(v), timeout=0.01)
    assert read(heard[0], True)[2:] == ([*q, *v], TOKEN, [*desired])


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ((Q[:2], WANTED, V), r"q has shape \(2,\); it must be \(3,\)"),
        ((Q, WANTED[:1], V), r"the desired motion has shape \(1,\); it must be"),
        ((Q, 0.0, V), r"the desired motion has shape \(\); it must be"),
        ((Q, WANTED, np.zeros((3, 1))), r"velocity has shape \(3, 1\); it must"),
        ((["a", "b", "c"], WANTED, V), r"q is \['a', 'b', 'c'\]; it must be real numb"),
        ((["1", "2", "3"], WANTED, V), r"q is \['1', '2', '3'\]; it must be real numb"),
        ((Q + 1j, WANTED, V), r"q is array\(\[0.1.*\); it must be real numbers"),
        ((None, WANTED, V), r"q has shape \(\); it must be \(3,\)"),
        ((Q, WANTED, V, "now"), r"stamp is 'now'; it must be a number \[s\]"),
    ],
)
def test_what_is_no_vector_of_the_joints_is_refused_and_not_sent(
    far, client, given, sentence
):
    sent = client._connection.outbox.sequence
    with pytest.raises(RefusedError, match=sentence):
        client.cycle(*given)
    with answering(far):
        answer = client.cycle(Q, WANTED, V, timeout=ANSWERED)
    assert answer.began[1] > sent


@pytest.mark.parametrize(
    ("desired", "sentence"),
    [
        (Q[:2], r"the desired motion has shape \(2,\); it must be \(3,\)"),
        (["a", "b", "c"], "the desired motion is .*; it must be real numbers"),
    ],
)
def test_desired_motion_that_is_no_vector_of_the_joints_is_refused(
    client, desired, sentence
):
    for send in (client.send_velocities, client.send_positions):
        with pytest.raises(RefusedError, match=sentence):
            send(desired)


def test_other_messages_on_the_way_are_no_answer(far, client):
    def say() -> None:
        far.say(Kind.HEARTBEAT, HEARTBEAT.pack(1, far.sender))
        far.send(far.command(0))

    with answering(far, say):
        answer = client.cycle(Q, WANTED, V, timeout=ANSWERED)
    assert answer.began[1] == client._connection.outbox.sequence
    # Answers to what others asked are not kept either.
    assert client.receive() is None


@pytest.mark.parametrize("timeout", [0.0, 0.0004, 0.03, 0.3])
def test_silence_is_a_stop_where_the_arms_are_when_its_time_is_over(client, timeout):
    begin = time.monotonic()
    answer = client.cycle(Q, WANTED, V, timeout=timeout)
    assert timeout <= time.monotonic() - begin < timeout + 10.0
    assert answer.cause in (Cause.SERVICE_SILENT, Cause.NO_ANSWER)
    assert answer.stops and answer.cycle == -1
    assert (answer.velocity == 0.0).all()
    assert (answer.position == Q).all()
    assert {row[:-1] for row in answer.numbers} == {
        (30, 10, 0, 0, 0.0, 1.0, np.inf, 0, 0)
    }
    assert answer.held == {}


def test_an_answer_that_is_too_old_when_it_is_read_is_a_stop(far, client):
    """As when the client's own program paused meanwhile."""
    far.behind = 60_000_000_000
    with answering(far):
        answer = client.cycle(Q, WANTED, V, timeout=ANSWERED)
    assert answer.cause is Cause.NO_ANSWER
    assert (answer.velocity == 0.0).all() and (answer.position == Q).all()


def test_positions_of_arms_are_unknown_before_a_client_sends_them(far, observer):
    assert np.isnan(observer.latest.position).all()
    far.behind = 60_000_000_000
    far.send(far.command(1))
    assert observer.receive(PATIENCE) is not None
    stop = observer.latest
    assert stop.stops and stop.cycle == -1
    assert stop.position.tolist() == [3.0, 4.0, 5.0]


def test_the_last_word_of_a_service_is_a_stop(far, client):
    with answering(far):
        client.cycle(Q, WANTED, V, timeout=ANSWERED)
    far.say(Kind.BYE)
    assert client.cycle(Q, WANTED, V, timeout=0.0).cause is Cause.SERVICE_GONE
    client.close()
    with pytest.raises(NoServiceError, match="connect"):
        client.cycle(Q, WANTED, V)
    assert client.latest.cause is Cause.NOT_CONNECTED


def test_states_of_robots_may_be_sent_one_by_one(far, client):
    heard: list[bytes] = []
    with far.hearing(Kind.STATE, heard.append):
        number = client.send_state(Q[2:], robots="right", stamp=1.0)
    assert sequence_of(heard[0]) == number
    assert STATE.unpack_from(heard[0], HEADER.size) == (2, 0, 1.0)
    assert np.frombuffer(heard[0][HEADER.size + STATE.size : -SEAL]) == Q[2]
    with pytest.raises(RefusedError, match="no robot 'middle'"):
        client.send_state(Q, robots=("left", "middle"))
    with pytest.raises(NoServiceError):
        Client(port=1).send_state(Q)
