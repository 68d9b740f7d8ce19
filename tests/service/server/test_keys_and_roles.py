"""Rights of clients: keys, their roles, ages, objects, what a crash leaves behind."""

import os
import signal
import socket
import stat
import time

import numpy as np
import pytest

from armguard import Action, Client, Level, Pose
from armguard.chaos.relay import Relay
from armguard.chaos.tampering import DESIRED, late, on
from armguard.errors import KeyFileError, NoServiceError, RefusedError
from armguard.recording.rings import was_killed
from armguard.service.client import Answer
from armguard.service.wire import Cause, Kind, Outbox, Role, Seal, read_keys
from armguard.service.wire.keys import keys_path, new_keys, write_keys
from armguard.service.wire.layout import (
    CHALLENGE,
    CLAIM,
    HEADER,
    HELLO,
    MOST,
    NO_COOKIE,
)
from service_arms import ANSWERED, PATIENCE, Arms, until, wait_for

STILL = np.zeros(14)
WISH = np.full(14, 0.02)


class Raw:
    """A sender of its own making: a socket, a number, and any key."""

    def __init__(self, port: int, key: bytes) -> None:
        self.seal = Seal(key)
        self.outbox = Outbox(self.seal, 4711)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect(("127.0.0.1", port))
        self.socket.settimeout(PATIENCE)

    def __enter__(self) -> "Raw":
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()

    def say(self, kind: Kind, payload: bytes = b"") -> bytes:
        message = bytes(self.outbox.message(kind, payload))
        self.socket.send(message)
        return message

    def hear(self, kind: Kind) -> bytes:
        while True:
            message = self.socket.recv(MOST)
            if message[5] == kind:
                return message

    def hello(self, role: Role, cookie: bytes = NO_COOKIE) -> bytes:
        return self.say(Kind.HELLO, HELLO.pack(role, 0, cookie) + b"raw")

    def open(self, role: Role) -> tuple[bytes, bytes]:
        """Both HELLOs of a connection."""
        first = self.hello(role)
        challenge = self.hear(Kind.CHALLENGE)
        self.outbox.session = HEADER.unpack_from(challenge)[4]
        _, cookie = CHALLENGE.unpack_from(challenge, HEADER.size)
        second = self.hello(role, cookie)
        welcome = self.hear(Kind.WELCOME)
        self.outbox.scene = HEADER.unpack_from(welcome)[5]
        return first, second


def test_a_start_writes_keys_that_its_user_alone_can_read(served):
    path = keys_path(served.port)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700
    keys = read_keys(path)
    assert set(keys) == set(Role)
    assert len(set(keys.values())) == len(Role)


@pytest.mark.parametrize(
    ("text", "mode", "sentence"),
    [
        ("command 0123456789abcdef\n", 0o644, "others may read"),
        ("command 0123456789abcde\n", 0o600, "15 bytes; it must have 16 to 32"),
        ("command " + 33 * "k", 0o600, "33 bytes; it must have 16 to 32"),
        ("0123456789abcdef\n", 0o600, "no role and key"),
        ("comand 0123456789abcdef\n", 0o600, "no role and key"),
        ("", 0o600, "holds no key"),
        ("sense 0123456789abcdef\ncommand 0123456789abcdef\n", 0o600, "a separate key"),
        ("sense 0123456789abcdef\n", 0o600, "has no key for 'command'; it has sense"),
        ("#" * 5000, 0o600, "longer than 4096 bytes"),
    ],
)
def test_a_key_file_that_cannot_be_used_is_refused_in_a_sentence(
    tmp_path, text, mode, sentence
):
    file = tmp_path / "keys"
    file.write_text(text)
    file.chmod(mode)
    with pytest.raises(KeyFileError, match=sentence):
        Client(port=1, keys=file).connect()


def test_a_key_file_that_is_none_is_refused(tmp_path):
    link, pipe = tmp_path / "link", tmp_path / "pipe"
    write_keys(tmp_path / "keys", new_keys())
    link.symlink_to(tmp_path / "keys")
    os.mkfifo(pipe)
    for path in (link, pipe, tmp_path, tmp_path / "none"):
        with pytest.raises(KeyFileError):
            read_keys(path)


def test_where_no_service_of_this_user_runs_the_sentence_says_so():
    with pytest.raises(NoServiceError, match="no service of this user runs at"):
        Client(port=2).connect(timeout=0.1)


def test_a_client_sleeps_until_a_service_that_starts_has_written_its_keys(monkeypatch):
    keys, looks, sleeps = new_keys(), [], []

    def found_keys(given, port):
        looks.append(port)
        if len(looks) < 4:
            raise NoServiceError("no keys yet")
        return keys, "here"

    monkeypatch.setattr("armguard.service.wire.keys.found_keys", found_keys)
    monkeypatch.setattr("armguard.service.wire.keys.sleep", sleeps.append)
    with pytest.raises(NoServiceError, match="no service answers"):
        Client(port=2).connect(timeout=0.2)
    assert len(looks) == 4
    assert len(sleeps) == 3
    assert min(sleeps) > 0.0


def test_without_a_key_nothing_is_accepted(served):
    with served.client() as client:
        arms = Arms(client)
        arms.lead(WISH)
        before = served.counters.values()
        for role in Role:
            with Raw(served.port, b"armguard-public-") as raw:
                for _ in range(50):
                    raw.hello(role)
                    raw.say(Kind.CLAIM, CLAIM.pack(1, 0))
                    raw.say(Kind.STOP)
                    raw.outbox.session = client.welcome.session
                    raw.outbox.scene = client._connection.outbox.scene
                    raw.say(Kind.CALL, b'{"id":1,"call":"remove","arguments":{}}')
                    # More under way, and the system drops some unread.
                    arms.drive(WISH, 1)
        after = served.counters.values()
        for name in ("hellos", "calls", "stop_orders"):
            assert after[name] == before[name], name
        assert after["dropped_seal"] - before["dropped_seal"] == 200
        assert client.latest.commander == client.sender


def test_a_hello_that_was_heard_is_worth_nothing_to_another(served):
    key = read_keys(keys_path(served.port))[Role.OBSERVE]
    with Raw(served.port, key) as raw, Raw(served.port, key) as thief:
        heard = raw.open(Role.OBSERVE)
        hellos = served.counters.value("hellos")
        for message in heard:
            thief.socket.send(message)
        # The same from its own address, after it has left and is forgotten.
        raw.say(Kind.BYE)
        dropped = served.counters.value("dropped_challenge")
        raw.socket.send(heard[1])
        wait_for(lambda: served.counters.value("dropped_challenge") > dropped)
        assert served.counters.value("hellos") == hellos
        thief.socket.settimeout(0.1)
        with pytest.raises(TimeoutError):
            thief.hear(Kind.WELCOME)


def test_a_cookie_is_good_for_its_sender_only(served):
    key = read_keys(keys_path(served.port))[Role.OBSERVE]
    with Raw(served.port, key) as raw, Raw(served.port, key) as other:
        raw.hello(Role.OBSERVE)
        challenge = raw.hear(Kind.CHALLENGE)
        other.outbox.session = HEADER.unpack_from(challenge)[4]
        dropped = served.counters.value("dropped_challenge")
        other.hello(Role.OBSERVE, CHALLENGE.unpack_from(challenge, HEADER.size)[1])
        wait_for(lambda: served.counters.value("dropped_challenge") == dropped + 1)


def test_an_observer_may_watch_ask_and_stop_and_nothing_else(served):
    with served.client() as client, served.client(role=Role.OBSERVE) as observer:
        arms = Arms(client)
        arms.lead(WISH)
        for send in (
            lambda: observer.send_state(arms.q),
            lambda: observer.send_velocities(WISH),
        ):
            before = served.counters.value("dropped_role")
            send()
            wait_for(lambda: served.counters.value("dropped_role") > before)  # noqa: B023
        with pytest.raises(RefusedError, match="has the key for 'observe'"):
            observer.claim(force=True)
        assert "why" in observer.call("why")
        observer.stop()
        arms.drive_until(WISH, lambda a: a.cause is Cause.STOP_ORDERED)
        client.call("engage")


def test_the_command_is_taken_by_force_with_the_key_for_that_alone(served):
    with served.client() as client, served.client() as second:
        Arms(client)
        client.claim()
        with pytest.raises(RefusedError, match="the key for 'administer'"):
            second.claim(force=True)
        assert client.call("ping")
        assert client.commands


def test_fixtures_stay_where_they_are(served):
    fixtures = ("rack", "bench")
    with (
        served.client() as client,
        served.client(role=Role.SENSE, name="camera") as sensor,
        served.client(role=Role.ADMINISTER, name="admin") as administrator,
    ):
        arms = Arms(client)
        client.claim()
        for name in fixtures:
            for one in (client, sensor):
                with pytest.raises(RefusedError, match="is a fixture"):
                    one.call("remove", name=name)
                with pytest.raises(RefusedError, match="is a fixture"):
                    one.call("place", name=name, pose=Pose(xyz=(9.0, 0.0, 0.0)))
        arms.lead(WISH)
        with pytest.raises(RefusedError, match="only while every robot rests"):
            administrator.call("remove", name="rack")
        arms.drive_until(STILL, lambda a: not a.velocity.any())
        arms.drive(STILL, 3)
        assert not client.latest.objects_changed
        administrator.call("remove", name="rack")
        answer = arms.drive_until(STILL, lambda a: a.objects_changed)
        assert answer.level >= Level.CAUTION
        administrator.call("place", name="rack", pose=rack_pose())


def rack_pose() -> np.ndarray:
    """Where the bay has its rack."""
    from armguard import bay_scene

    return bay_scene().objects["rack"].pose.matrix()


def test_an_object_belongs_to_the_client_that_placed_it(served):
    pose = Pose(xyz=(0.0, 1.5, 0.3))
    with served.client(role=Role.SENSE, name="left camera") as owner:
        owner.call("place", name="box4", pose=pose)
        with served.client(role=Role.SENSE, name="right camera") as other:
            with pytest.raises(RefusedError, match="belongs to client 'left camera'"):
                other.call("remove", name="box4")
            owner.close()
            wait_for(lambda: removed(other, "box4"))


def removed(client: Client, name: str) -> bool:
    """Whether a client could remove an object."""
    try:
        client.call("remove", name=name)
    except RefusedError:
        return False
    return True


@pytest.mark.parametrize("delay", [0.15, 0.3, 2.0])
def test_desired_motion_that_comes_late_is_counted_and_not_obeyed(served, delay):
    with served.client() as client:
        arms = Arms(client)
        arms.drive(STILL, 2)
        relay = Relay(served.port)
        keys = keys_path(served.port)
        try:
            with (
                Client(relay.port, keys=keys, watchdog=ANSWERED) as operator,
                served.client(role=Role.ADMINISTER) as administrator,
            ):
                operator.connect(PATIENCE)
                administrator.claim(force=True)
                administrator.give_back()
                operator.claim()
                relay.tamper = on(DESIRED, late(delay))
                before = served.counters.values()
                sent = 0

                def step() -> Answer:
                    nonlocal sent
                    operator.send_velocities(WISH)
                    sent += 1
                    operator.receive()
                    answer = arms.measure()
                    assert not answer.velocity.any()
                    return answer

                end = time.monotonic() + delay + 0.2
                while time.monotonic() < end:
                    step()
                wait_for(
                    lambda: (
                        served.counters.value("dropped_wish_late")
                        == before["dropped_wish_late"] + sent
                    )
                )
                assert served.counters.value("wishes") == before["wishes"]
        finally:
            relay.close()


def test_a_controller_whose_states_are_dropped_is_stopped(served):
    with served.client() as client, served.client(name="second") as second:
        arms = Arms(client)
        arms.lead(WISH)

        def step() -> Answer:
            arms.drive(WISH, 1)
            second.send_state(arms.q)
            return second.latest

        answer = until(step, lambda a: a.cause is Cause.NOT_YOURS)
        assert answer.action is Action.STOP
        assert not answer.velocity.any()
        until(step, lambda _: second.refusal is not None)
        assert second.refusal is not None
        assert second.refusal[0] == "second_controller"
        for _ in range(20):
            assert step().cause is Cause.NOT_YOURS


def test_many_connections_come_and_go(served):
    for _ in range(300):
        with Client(served.port, role=Role.OBSERVE) as one:
            one.connect(PATIENCE)
    assert served.counters.value("dropped_too_many_senders") == 0


def test_observers_leave_room_for_commanders(serving):
    with serving() as own:
        crowd = [Client(own.port, role=Role.OBSERVE, every=0) for _ in range(60)]
        try:
            with pytest.raises(RefusedError, match="no room for another client"):
                for one in crowd:
                    one.connect(PATIENCE)
                    for other in crowd:
                        if other.connected:
                            other.receive()
            with own.client() as client:
                assert client.call("ping")
        finally:
            for one in crowd:
                one.close()


def test_a_flood_of_calls_does_not_keep_states_away(served):
    with served.client() as client, served.client(role=Role.OBSERVE) as noisy:
        arms = Arms(client)
        arms.lead(WISH)
        busy = served.counters.value("dropped_busy")
        for _ in range(40):
            for _ in range(50):
                payload = b'{"id": 1, "call": "why"}'
                noisy._connection.say(Kind.CALL, payload)
            noisy._drain()
            arms.drive(WISH, 1)
        assert served.counters.value("dropped_busy") > busy
        arms.lead(WISH)


def test_a_service_that_follows_a_killed_one_keeps_robots_stopped(serving, tmp_path):
    ring = tmp_path / "ring"
    with serving(f"--ring={ring}") as first:
        with first.client() as client:
            Arms(client).lead(WISH)
            first.process.send_signal(signal.SIGKILL)
            first.process.wait()
    assert was_killed(0, ring)
    with serving(f"--ring={ring}") as second:
        with second.client() as client:
            arms = Arms(client, anew=False)
            for _ in range(20):
                assert not arms.drive(WISH, 1).velocity.any()
            client.call("engage")
            arms.lead(WISH)
    assert not was_killed(0, ring)
    with serving(f"--ring={ring}") as third, third.client() as client:
        arms = Arms(client, anew=False)
        arms.lead(WISH)
