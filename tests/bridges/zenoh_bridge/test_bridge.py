"""Real Zenoh sessions on loopback, a real bridge, a real service."""

import json
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import psutil
import pytest
import zenoh

from armguard.bridges.zenoh_bridge import ZenohClient
from armguard.errors import NoServiceError, RefusedError
from armguard.recording.counters import counters_path
from armguard.recording.rights import Role
from armguard.scene.bay import bay_path
from armguard.service.wire.keys import keys_path, read_keys, write_keys

# Nothing here takes longer than that, whatever else the machine does [s].
PATIENCE = 120.0

# How much later than its period a cycle may come here, and how old a state may be [s]:
# how fast the machine of the tests is, is no business of theirs.
LATE = 0.4

ROOT = "armguard/bay"

# A commander that is silent for half a second loses the command. A busy machine may
# cause that here; the commander then tries again.
TRIES = 5


def started(*words):
    """A module as a process, and the first line it wrote."""
    process = subprocess.Popen(
        [sys.executable, "-m", *words], stdout=subprocess.PIPE, text=True
    )
    watch = threading.Timer(PATIENCE, process.kill)
    watch.start()
    line = process.stdout.readline()
    watch.cancel()
    assert line
    return process, line


def free_port():
    """A free TCP port."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def session_at(port):
    """A Zenoh session that knows the bridge and no other peer."""
    config = zenoh.Config()
    for key, value in (
        ("mode", "peer"),
        ("listen/endpoints", []),
        ("connect/endpoints", [f"tcp/127.0.0.1:{port}"]),
        ("scouting/multicast/enabled", False),
        ("scouting/gossip/enabled", False),
        ("transport/shared_memory/enabled", False),
    ):
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)


class Party:
    """A program with a Zenoh session of its own, and the key of a role."""

    def __init__(self, tcp, port, role):
        self.session = session_at(tcp)
        self.client = ZenohClient(
            self.session, role=role, port=port, root=ROOT, watchdog=PATIENCE
        )
        self.welcome = self.client.connect(PATIENCE)
        self.heard = {"command": [], "verdict": [], "heartbeat": []}
        self._ends = [
            self.client.subscribe(name, heard.append)
            for name, heard in self.heard.items()
        ]

    def put(self, key, message):
        self.client.put(key, message)

    def call(self, name, /, **message):
        return self.client.call(name, timeout=PATIENCE, **message)

    def await_one(self, name, holds, meanwhile=lambda: None, patience=PATIENCE):
        """The first message of a key from now on for which something holds."""
        seen = len(self.heard[name])
        end = time.monotonic() + patience
        while time.monotonic() < end:
            meanwhile()
            while seen < len(self.heard[name]):
                message = self.heard[name][seen]
                seen += 1
                if holds(message):
                    return message
            time.sleep(0.01)
        raise AssertionError(f"no such {name}; last: {self.heard[name][-1:]}")

    def count(self, cause, more):
        """Wait until so many more of a cause were counted than before."""
        before = self.await_one("heartbeat", lambda m: True)["counts"].get(cause, 0)
        more()
        return (
            self.await_one("heartbeat", lambda m: m["counts"].get(cause, 0) > before)[
                "counts"
            ][cause]
            - before
        )

    def close(self):
        self.session.close()


class Arms:
    """A controller: both arms follow the commands, from home."""

    def __init__(self, controller, commander):
        self.controller, self.commander = controller, commander
        welcome = controller.welcome
        self.names = list(reversed(welcome["names"]))
        self.positions = np.array(welcome["home"])[::-1]
        self.velocities = np.zeros(len(self.names))
        self.sent = 0
        self.enough = threading.Event()
        self.desired = None
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    def state(self, **other):
        return {
            "names": self.names,
            "positions": self.positions.tolist(),
            "velocities": self.velocities.tolist(),
            **other,
        }

    def run(self):
        # The guard stops an arm whose positions contradict its velocities: the arms
        # move for as long as the cycle takes on this machine.
        before = time.monotonic()
        while not self.enough.wait(0.01):
            now = time.monotonic()
            self.positions = self.positions + (now - before) * self.velocities
            before = now
            self.sent = self.controller.client.put("state", self.state())
            if self.desired is not None:
                self.commander.put(*self.desired)
            for command in self.commander.heard["command"][-1:]:
                self.velocities = np.array(command["velocities"])[::-1]

    def end(self):
        self.enough.set()
        self.thread.join()


class Setup:
    """Everything that runs."""

    def __init__(self, scene):
        self.scene = scene
        self.service, line = self.serve("0")
        self.port = int(line.partition(",")[0].rpartition(":")[2])
        self.ring = Path(line.strip().rpartition("ring ")[2])
        self.tcp = free_port()
        self.bridge, _ = started(
            *("armguard.bridges.zenoh_bridge", "--port", str(self.port)),
            *("--listen", f"tcp/127.0.0.1:{self.tcp}", "--name", "bay"),
        )
        self.controller = Party(self.tcp, self.port, Role.COMMAND)
        self.commander = Party(self.tcp, self.port, Role.ADMINISTER)
        self.observer = Party(self.tcp, self.port, Role.OBSERVE)
        self.welcome = self.controller.welcome
        self.arms = Arms(self.controller, self.commander)
        self.commander.await_one("command", lambda m: m["cycle"] >= 0)

    def serve(self, port):
        return started(
            *("armguard", "serve", str(self.scene), "--port", port),
            *("--no-self-test", "--mode=path", f"--late={LATE}"),
        )

    def claim(self, name="test"):
        for _ in range(TRIES):
            self.commander.call("claim", name=name, force=True)
            try:
                self.commander.call("engage")
                return
            except RefusedError as error:
                last = error
        raise last

    def lead(self, holds):
        """The first command for which something holds while motion is desired.

        On a busy machine the commander may lose the command, or a stop that was
        ordered before arrives only after it has engaged: then it begins again.
        """
        for _ in range(TRIES):
            self.claim()
            self.arms.desired = self.desired()
            try:
                return self.commander.await_one("command", holds, patience=3.0)
            except AssertionError as error:
                last = error
            finally:
                self.arms.desired = None
        raise last

    def desired(self, speed=0.05):
        names = self.welcome["names"]
        return "wish/velocities", {"names": names, "velocities": [speed] * len(names)}

    def close(self):
        self.arms.end()
        for party in (self.controller, self.commander, self.observer):
            party.close()
        for process in (self.bridge, self.service):
            process.kill()
            process.communicate(timeout=PATIENCE)
        for path in (self.ring, counters_path(self.ring), keys_path(self.port)):
            path.unlink(missing_ok=True)


@pytest.fixture(scope="module")
def setup(tmp_path_factory):
    text = bay_path().read_text(encoding="utf-8")
    assert "stale: 0.010" in text
    text = text.replace("stale: 0.010", f"stale: {LATE}")
    text = text.replace("urdf: bay_arm.urdf", f"urdf: {bay_path().parent}/bay_arm.urdf")
    file = tmp_path_factory.mktemp("scene") / "bay.yaml"
    file.write_text(text, encoding="utf-8")
    found = Setup(file)
    yield found
    found.close()


def test_states_and_desired_motion_become_commands(setup):
    """Joints are found by their names: the states come in the opposite order."""
    command = setup.lead(
        lambda m: m["began_by"] and m["cause"] == "NONE" and min(m["velocities"]) > 0.0
    )
    assert command["names"] == setup.welcome["names"]
    assert max(command["velocities"]) <= 0.05 + 1e-9
    name = setup.controller.client.name
    assert command["began_by"]["sender"] == name
    assert 0 < command["began_by"]["sequence"] <= setup.arms.sent
    assert [one["sender"] for one in command["states"].values()] == [name] * 2
    assert not command["stop"]
    # From home in the desired direction, joint by joint.
    home = setup.welcome["home"]
    steps = [b - a for a, b in zip(home, command["positions"], strict=True)]
    assert all(0.0 <= step < 0.05 * 3.0 * TRIES for step in steps)


def test_positions_and_twists_are_desired_motion_too(setup):
    names = setup.arms.names
    ahead = (setup.arms.positions + 0.05).tolist()
    for desired in (
        ("wish/positions", {"names": names, "positions": ahead}),
        ("wish/twists", {"tools": ["left"], "twists": [[0, 0, 0.05, 0, 0, 0]]}),
    ):
        for _ in range(TRIES):
            setup.claim()
            setup.arms.desired = desired
            try:
                setup.commander.await_one(
                    "command",
                    lambda m: (
                        m["cause"] == "NONE"
                        and any(abs(v) > 1e-4 for v in m["velocities"])
                    ),
                    patience=3.0,
                )
                break
            except AssertionError:
                continue
            finally:
                setup.arms.desired = None
        else:
            raise AssertionError(desired)


def test_a_verdict_says_why(setup):
    verdict = setup.commander.await_one("verdict", lambda m: m["cycle"] >= 0)
    assert set(verdict["levels"]) == {"left", "right"} == set(verdict["speed_scale"])
    assert verdict["sentence"] and verdict["level"]
    assert set(verdict["ages"]) == {"left", "right"}


def test_there_is_one_commander(setup):
    def second_is_refused():
        setup.claim("first")
        setup.arms.desired = setup.desired(0.0)
        try:
            setup.controller.call("claim", name="second")
        except RefusedError as error:
            return "'first' has the command" in str(error)
        finally:
            setup.arms.desired = None
        return False

    # On a machine that is busy the first one may have lost the command by then.
    assert any(second_is_refused() for _ in range(TRIES))
    dropped = setup.commander.count(
        "dropped_not_commander", lambda: setup.controller.put(*setup.desired())
    )
    assert dropped >= 1
    with pytest.raises(RefusedError, match=r"has the command|no session commands"):
        setup.controller.call("engage")


def test_force_needs_the_key_to_administer(setup):
    with pytest.raises(RefusedError, match="'administer'"):
        setup.controller.call("claim", name="second", force=True)

    def take_and_lose():
        try:
            setup.controller.call("claim", name="first")
        except RefusedError:
            return False
        with pytest.raises(RefusedError, match=r"'administer'|no session commands"):
            setup.controller.call("configure")
        setup.claim("second")
        with pytest.raises(RefusedError):
            setup.controller.call("engage")
        try:
            setup.commander.call("give_back")
        except RefusedError:
            return False
        return True

    # The one who has the command now has to fall silent first.
    end = time.monotonic() + PATIENCE
    while not take_and_lose():
        assert time.monotonic() < end


def test_each_role_may_do_what_its_key_says(setup):
    assert setup.observer.call("why")["why"]
    for call, arguments in (
        ("claim", {"name": "observer"}),
        ("place", {"arguments": {"name": "rack"}}),
        ("remove", {"arguments": {"name": "rack"}}),
        ("configure", {}),
        ("engage", {}),
    ):
        with pytest.raises(RefusedError, match="needs the key for"):
            setup.observer.call(call, **arguments)
    for key, message in (("state", setup.arms.state()), setup.desired()):
        dropped = setup.commander.count(
            "dropped_role",
            lambda key=key, message=message: setup.observer.put(key, message),
        )
        assert dropped >= 1


def test_a_silent_commander_loses_the_command(setup):
    setup.claim("sleepy")
    setup.commander.await_one("heartbeat", lambda m: m["commander"] == "sleepy")
    setup.commander.await_one("heartbeat", lambda m: m["commander"] == "")
    # Commands of before may still be on their way.
    setup.commander.await_one("command", lambda m: m["cause"] == "NO_COMMANDER")


@pytest.mark.parametrize(
    ("key", "message", "cause"),
    [
        ("state", b"{", "malformed"),
        ("state", b"[1, 2]", "malformed"),
        ("state", b"[" * 5000, "malformed"),
        ("state", b" " * 70_000, "oversized"),
        ("state", {"positions": [0.0] * 14}, "payload"),
        ("wish/velocities", {"velocities": [0.0] * 14}, "not_commander"),
        ("wish/twists", b'{"tools": "\\ud800"}', "not_commander"),
        ("stop", b"[]", "malformed"),
    ],
)
def test_what_is_no_message_is_counted_and_dropped(setup, key, message, cause):
    more = setup.commander.count(
        f"dropped_{cause}", lambda: setup.controller.put(key, message)
    )
    assert more >= 1


@pytest.mark.parametrize("seal", [None, b"", b"AGZ1", b"AGZ1" + bytes(68), bytes(9999)])
def test_what_is_not_sealed_is_counted_and_dropped(setup, seal):
    session = setup.controller.session
    more = setup.commander.count(
        "dropped_seal",
        lambda: session.put(f"{ROOT}/stop", b"{}", attachment=seal),
    )
    assert more >= 1
    replies = list(session.get(f"{ROOT}/call/welcome", attachment=seal))
    assert [reply.ok for reply in replies] == [None]


def test_desired_motion_that_is_late_is_counted_and_dropped(setup):
    """As from a queue that grows: neither late ones, nor those of a clock ahead."""
    setup.claim("late")
    clock = setup.commander.client.clock
    offset = clock.offset
    try:
        for delay in (0.15, 0.3, 2.0, -0.5):
            clock.offset = offset - delay
            more = setup.observer.count(
                "dropped_late", lambda: setup.commander.put(*setup.desired())
            )
            assert more >= 1
    finally:
        clock.offset = offset


@pytest.mark.parametrize(
    ("other", "cause"),
    [
        ({"positions": [float("nan")] * 14}, "not_finite"),
        ({"positions": [1e999] * 14}, "not_finite"),
        ({"positions": [0.0] * 13}, "payload"),
        ({"positions": ["0"] * 14}, "payload"),
        ({"names": ["left/joint1"] * 14}, "names"),
        ({"names": ["left/joint1"], "positions": [0.0]}, "names"),
        ({"stamp": "now"}, "payload"),
    ],
)
def test_a_state_that_is_none_is_counted_and_dropped(setup, other, cause):
    state = {**setup.arms.state(), **other}
    more = setup.commander.count(
        f"dropped_{cause}", lambda: setup.controller.put("state", state)
    )
    assert more >= 1


def test_a_robot_has_one_controller(setup):
    more = setup.commander.count(
        "dropped_second_controller",
        lambda: setup.commander.put("state", setup.arms.state()),
    )
    assert more >= 1


def test_calls_reach_the_service(setup):
    clock = setup.observer.call("clock")
    assert abs(clock["time"] - time.monotonic()) < PATIENCE and clock["bound"] == 0.0
    setup.claim()
    for call, arguments, named in (
        ("enggage", {}, "engage"),
        ("engage", {"name": "third"}, "third"),
        ("engage", {"timeout": 1}, "arguments"),
    ):
        with pytest.raises(RefusedError, match=named):
            setup.commander.call(call, arguments=arguments)
    assert setup.commander.call("engage", arguments={"name": "left"}) is None


def test_every_client_may_order_a_stop(setup):
    stopped = setup.commander.await_one(
        "command",
        lambda m: m["cause"] == "STOP_ORDERED",
        meanwhile=lambda: setup.observer.put("stop", {}),
    )
    assert stopped["stop"] and not any(stopped["velocities"])
    setup.lead(lambda m: m["cause"] == "NONE" and not m["stop"])


def test_no_client_outside_this_machine_can_reach_it(setup):
    found = psutil.Process(setup.bridge.pid).net_connections()
    assert any(one.laddr.port == setup.tcp for one in found)
    assert {one.laddr.ip for one in found} <= {"127.0.0.1", "0.0.0.0"}
    for one in found:
        if one.laddr.ip == "0.0.0.0":
            # The client's socket, which sent to loopback only and is not connected.
            assert one.type == socket.SOCK_DGRAM and not one.raddr
            assert one.laddr.port not in (setup.tcp, 7446)


def test_an_endpoint_that_is_taken_is_said_in_words(setup):
    found = subprocess.run(
        [
            *(sys.executable, "-m", "armguard.bridges.zenoh_bridge"),
            *("--port", str(setup.port), "--listen", f"tcp/127.0.0.1:{setup.tcp}"),
        ],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert found.returncode == 2
    assert f"127.0.0.1:{setup.tcp}" in found.stderr


@pytest.mark.parametrize("kind", ["missing", "loose", "wrong"])
def test_a_key_file_that_is_of_no_use_is_said_in_words(setup, tmp_path, kind):
    file = tmp_path / "keys"
    if kind != "missing":
        keys = read_keys(keys_path(setup.port))
        write_keys(file, {role: key[::-1] for role, key in keys.items()})
    if kind == "loose":
        file.chmod(0o644)
    found = subprocess.run(
        [
            *(sys.executable, "-m", "armguard.bridges.zenoh_bridge"),
            *("--port", str(setup.port), "--listen", f"tcp/127.0.0.1:{free_port()}"),
            *("--key-file", str(file), "--wait", "0.5"),
        ],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert found.returncode == 2
    assert len(found.stderr.splitlines()) == 1
    named = {"missing": str(file), "loose": "chmod 600", "wrong": "its key"}
    assert named[kind] in found.stderr


def test_a_client_with_other_keys_is_not_answered(setup):
    keys = {role: b"0" * 15 + bytes([48 + role]) for role in Role}
    stranger = ZenohClient(setup.observer.session, keys=keys, root=ROOT)
    with pytest.raises(NoServiceError, match="not connected"):
        stranger.put("stop", {})
    said = ""
    end = time.monotonic() + PATIENCE
    while "seal does not fit" not in said and time.monotonic() < end:
        with pytest.raises(NoServiceError) as refused:
            stranger.connect(0.5)
        said = str(refused.value)
    assert "seal does not fit" in said


def test_a_service_that_is_killed_is_reported_as_a_stop_and_may_come_back(setup):
    """The last test but one: it ends the service."""
    companion, _ = started(
        *("armguard.bridges.zenoh_bridge", "--port", str(setup.port), "--companion"),
        *("--listen", f"tcp/127.0.0.1:{free_port()}", "--name", "other"),
    )
    before = read_keys(keys_path(setup.port))
    setup.service.send_signal(signal.SIGKILL)
    stopped = setup.commander.await_one(
        "command", lambda m: m["cycle"] < 0 and m["cause"] != "NO_ANSWER"
    )
    assert stopped["stop"] and not any(stopped["velocities"])
    assert set(stopped["actions"].values()) == {"STOP"}
    beat = setup.commander.await_one("heartbeat", lambda m: m["service"] != "ALIVE")
    assert beat["commander"] == ""
    setup.service.communicate(timeout=PATIENCE)
    for path in (setup.ring, counters_path(setup.ring)):
        path.unlink(missing_ok=True)
    # Every command of this time has zero velocity for every joint.
    for _ in range(30):
        received = setup.commander.await_one("command", lambda m: True)
        assert received["names"] == setup.welcome["names"] and received["stop"]
        assert received["velocities"] == [0.0] * len(received["names"])
        assert len(received["positions"]) == len(received["names"])
    setup.service, line = setup.serve(str(setup.port))
    setup.ring = Path(line.strip().rpartition("ring ")[2])
    # Its keys are others, and the bridge has begun a new session.
    assert read_keys(keys_path(setup.port)) != before
    for party in (setup.commander, setup.controller):
        end = time.monotonic() + PATIENCE
        while True:
            try:
                party.client.connect(1.0)
                break
            except NoServiceError:
                assert time.monotonic() < end
    setup.commander.await_one("command", lambda m: m["cycle"] >= 0 and m["began_by"])
    # One that the service has started itself does not wait for another service.
    assert companion.wait(PATIENCE) == 0
    companion.communicate()


def test_the_last_word_of_a_bridge_is_a_stop(setup):
    """The last test: it ends the bridge."""
    setup.bridge.terminate()
    last = setup.commander.await_one("command", lambda m: m["cycle"] < 0)
    assert last["stop"] and last["names"] == setup.welcome["names"]
    assert last["velocities"] == [0.0] * len(last["names"])
    assert setup.bridge.wait(PATIENCE) == 0
