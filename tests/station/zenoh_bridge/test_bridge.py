"""Real Zenoh sessions on loopback, a real bridge, a real service."""

import json
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import psutil
import pytest
import zenoh

from armguard.scene.bay import bay_path
from armguard.station.service.counters import counters_path

# Nothing here takes longer than that, whatever else the machine does [s].
PATIENCE = 120.0

# How much later than its period a cycle may come here, and how old a state may be [s]:
# how fast the machine of the tests is, is no business of theirs.
LATE = 0.4

ROOT = "armguard/bay"

# A commander who is silent for half a second loses the command, as he would here if the
# machine has no time for him; he tries again.
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
    """A TCP port that nobody has."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def session_at(port):
    """A Zenoh session that knows the bridge and nobody else."""
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
    """Somebody with a Zenoh session of his own."""

    def __init__(self, port):
        self.session = session_at(port)
        self.heard = {"command": [], "verdict": [], "heartbeat": []}
        self._ends = [
            self.session.declare_subscriber(f"{ROOT}/{name}", self._into(name))
            for name in self.heard
        ]

    def _into(self, name):
        return lambda sample: self.heard[name].append(
            json.loads(sample.payload.to_bytes())
        )

    def put(self, key, message):
        text = message if isinstance(message, str) else json.dumps(message)
        self.session.put(f"{ROOT}/{key}", text)

    def call(self, name, /, **message):
        replies = list(
            self.session.get(
                f"{ROOT}/call/{name}", payload=json.dumps(message), timeout=PATIENCE
            )
        )
        assert len(replies) == 1
        return json.loads(replies[0].ok.payload.to_bytes())

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
    """A controller: both arms stand at home, and say so again and again."""

    def __init__(self, party, welcome):
        self.party = party
        self.names = list(reversed(welcome["names"]))
        self.positions = list(reversed(welcome["home"]))
        self.sequence = 0
        self.enough = threading.Event()
        self.wish = None
        self.wished = 0
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    def state(self, **other):
        self.sequence += 1
        return {
            "sender": "arms",
            "sequence": self.sequence,
            "names": self.names,
            "positions": self.positions,
            "velocities": [0.0] * len(self.names),
            **other,
        }

    def run(self):
        while not self.enough.wait(0.01):
            self.party.put("state", self.state())
            if self.wish is not None:
                self.wished += 1
                key, message = self.wish
                self.party.put(key, {"sequence": self.wished, **message})

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
            *("armguard.station.zenoh_bridge", "--port", str(self.port)),
            *("--listen", f"tcp/127.0.0.1:{self.tcp}", "--name", "bay"),
        )
        self.controller, self.commander = Party(self.tcp), Party(self.tcp)
        welcome = self.controller.call("welcome")
        assert welcome["ok"]
        self.welcome = welcome["result"]
        self.arms = Arms(self.controller, self.welcome)
        self.commander.await_one("command", lambda m: m["cycle"] >= 0)

    def serve(self, port):
        return started(
            *("armguard", "serve", str(self.scene), "--port", port),
            *("--no-self-test", "--mode=path", f"--late={LATE}"),
        )

    def claim(self, name="test"):
        for _ in range(TRIES):
            reply = self.commander.call("claim", name=name, force=True)
            assert reply["ok"], reply
            token = reply["result"]["token"]
            engaged = self.commander.call("engage", token=token)
            if engaged["ok"]:
                return token
        raise AssertionError(engaged)

    def lead(self, holds):
        """The first command for which something holds while somebody wishes.

        A machine that is busy takes the command from him, or brings a stop that was
        ordered before only when he has engaged: then he begins again.
        """
        for _ in range(TRIES):
            self.arms.wish = self.wish_of(self.claim())
            try:
                return self.commander.await_one("command", holds, patience=3.0)
            except AssertionError as error:
                last = error
            finally:
                self.arms.wish = None
        raise last

    def wish_of(self, token, speed=0.05):
        names = self.welcome["names"]
        wish = {"token": token, "names": names, "velocities": [speed] * len(names)}
        return "wish/velocities", wish

    def close(self):
        self.arms.end()
        self.controller.close()
        self.commander.close()
        for process in (self.bridge, self.service):
            process.kill()
            process.communicate(timeout=PATIENCE)
        for path in (self.ring, counters_path(self.ring)):
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


def test_states_and_wishes_become_commands(setup):
    """Names say which joint is meant: the states come in the opposite order."""
    command = setup.lead(
        lambda m: m["began_by"] and m["cause"] == "NONE" and min(m["velocities"]) > 0.0
    )
    assert command["names"] == setup.welcome["names"]
    assert max(command["velocities"]) <= 0.05 + 1e-9
    assert command["began_by"]["sender"] == "arms"
    assert 0 < command["began_by"]["sequence"] <= setup.arms.sequence
    assert not command["stop"]
    # A step from home in the direction of the wish, joint by joint.
    home = setup.welcome["home"]
    steps = [b - a for a, b in zip(home, command["positions"], strict=True)]
    assert all(0.0 <= step < 0.02 for step in steps)


def test_positions_and_twists_are_wishes_too(setup):
    token = setup.claim()
    names, home = setup.welcome["names"], setup.welcome["home"]
    ahead = [x + 0.05 for x in home]
    for wish in (
        ("wish/positions", {"token": token, "names": names, "positions": ahead}),
        (
            "wish/twists",
            {"token": token, "tools": ["left"], "twists": [[0, 0, 0.05, 0, 0, 0]]},
        ),
    ):
        setup.arms.wish = wish
        setup.commander.await_one(
            "command",
            lambda m: (
                m["cause"] == "NONE" and any(abs(v) > 1e-4 for v in m["velocities"])
            ),
        )
    setup.arms.wish = None


def test_a_verdict_says_why(setup):
    verdict = setup.commander.await_one("verdict", lambda m: m["cycle"] >= 0)
    assert set(verdict["levels"]) == {"left", "right"} == set(verdict["speed_scale"])
    assert verdict["sentence"] and verdict["level"]
    assert set(verdict["ages"]) == {"left", "right"}


def test_there_is_one_commander(setup):
    token = setup.claim("first")
    setup.arms.wish = setup.wish_of(token, 0.0)
    refused = setup.controller.call("claim", name="second")
    assert not refused["ok"] and "'first' has the command" in refused["sentence"]
    dropped = setup.commander.count(
        "dropped_not_commander",
        lambda: setup.controller.put(*setup.wish_of("0" * 32)),
    )
    assert dropped >= 1
    assert not setup.controller.call("engage")["ok"]

    def take_and_give_back():
        taken = setup.controller.call("claim", name="second", force=True)
        assert taken["ok"] and taken["result"]["token"] != token
        return setup.controller.call("give_back", token=taken["result"]["token"])["ok"]

    # On a machine that is busy the command may be lost between the two.
    assert any(take_and_give_back() for _ in range(TRIES))
    # The first one's token is worth nothing any more.
    assert setup.commander.count("dropped_not_commander", lambda: None) >= 1
    setup.arms.wish = None


def test_a_silent_commander_loses_the_command(setup):
    setup.claim("sleepy")
    setup.commander.await_one("heartbeat", lambda m: m["commander"] == "sleepy")
    setup.commander.await_one("heartbeat", lambda m: m["commander"] == "")
    command = setup.commander.await_one("command", lambda m: m["cycle"] >= 0)
    assert command["cause"] == "NO_COMMANDER"


@pytest.mark.parametrize(
    ("key", "message", "cause"),
    [
        ("state", "{", "malformed"),
        ("state", "[1, 2]", "malformed"),
        ("state", "[" * 5000, "malformed"),
        ("state", " " * 70_000, "oversized"),
        ("state", {"positions": [0.0] * 14}, "payload"),
        ("wish/velocities", {"velocities": [0.0] * 14}, "not_commander"),
        ("wish/twists", '{"token": "\\ud800"}', "not_commander"),
        ("stop", "", "malformed"),
    ],
)
def test_what_is_no_message_is_counted_and_dropped(setup, key, message, cause):
    more = setup.commander.count(
        f"dropped_{cause}", lambda: setup.controller.put(key, message)
    )
    assert more >= 1


@pytest.mark.parametrize(
    ("other", "cause"),
    [
        ({"positions": [float("nan")] * 14}, "not_finite"),
        ({"positions": [1e999] * 14}, "not_finite"),
        ({"positions": [0.0] * 13}, "payload"),
        ({"positions": ["0"] * 14}, "payload"),
        ({"names": ["left/joint1"] * 14}, "names"),
        ({"names": ["left/joint1"], "positions": [0.0]}, "names"),
        ({"sender": ""}, "payload"),
        ({"sequence": 1}, "out_of_order"),
        ({"sequence": True}, "payload"),
        ({"stamp": "now"}, "payload"),
        ({"sender": "thief"}, "second_controller"),
    ],
)
def test_a_state_that_is_none_is_counted_and_dropped(setup, other, cause):
    state = {**setup.arms.state(), **other}
    more = setup.commander.count(
        f"dropped_{cause}", lambda: setup.controller.put("state", state)
    )
    assert more >= 1


def test_calls_reach_the_service(setup):
    why = setup.controller.call("why")
    assert why["ok"] and why["result"]["why"]
    clock = setup.controller.call("clock")["result"]
    assert abs(clock["time"] - time.monotonic()) < PATIENCE and clock["bound"] == 0.0
    token = setup.claim()
    unknown = setup.commander.call("enggage", token=token)
    assert not unknown["ok"] and "engage" in unknown["sentence"]
    named = setup.commander.call("engage", token=token, arguments={"name": "left"})
    assert named["ok"], named
    refused = setup.commander.call("engage", token=token, arguments={"name": "third"})
    assert not refused["ok"] and "third" in refused["sentence"]
    assert not setup.controller.call("place", arguments={"name": "x"})["ok"]


def test_everybody_may_order_a_stop(setup):
    stopped = setup.commander.await_one(
        "command",
        lambda m: m["cause"] == "STOP_ORDERED",
        meanwhile=lambda: setup.controller.put("stop", {}),
    )
    assert stopped["stop"] and not any(stopped["velocities"])
    setup.lead(lambda m: m["cause"] == "NONE" and not m["stop"])


def test_nobody_outside_this_machine_can_reach_it(setup):
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
            *(sys.executable, "-m", "armguard.station.zenoh_bridge"),
            *("--port", str(setup.port), "--listen", f"tcp/127.0.0.1:{setup.tcp}"),
        ],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert found.returncode == 2
    assert f"127.0.0.1:{setup.tcp}" in found.stderr


def test_a_service_that_is_killed_is_told_as_a_stop_and_may_come_back(setup):
    """The last test but one: it ends the service."""
    companion, _ = started(
        *("armguard.station.zenoh_bridge", "--port", str(setup.port), "--companion"),
        *("--listen", f"tcp/127.0.0.1:{free_port()}", "--name", "other"),
    )
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
    # Whatever is told meanwhile tells every joint to stand still.
    for _ in range(30):
        told = setup.commander.await_one("command", lambda m: True)
        assert told["names"] == setup.welcome["names"] and told["stop"]
        assert told["velocities"] == [0.0] * len(told["names"])
        assert len(told["positions"]) == len(told["names"])
    setup.service, line = setup.serve(str(setup.port))
    setup.ring = Path(line.strip().rpartition("ring ")[2])
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
