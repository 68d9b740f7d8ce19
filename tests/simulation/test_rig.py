"""Simulated sensors as a process beside a service, and what a page asks of them."""

import json
import re
import signal
import socket
import subprocess
import sys
import time

import numpy as np
import pytest

import armguard as ag
from armguard.processes import free_port
from armguard.scene.two_pandas import sensed_table_path
from armguard.simulation.rig import APART, places_in_view
from armguard.simulation.rig_link import RigEnd, ask_rig
from service_arms import Arms

STATE = {"boxes": [{"size": [0.1, 0.1, 0.1], "xyz": [0, 0, 0]}]}
PATIENCE = 90.0


@pytest.fixture(scope="module")
def table():
    return ag.load_scene(sensed_table_path())


@pytest.fixture
def rig_end():
    end = RigEnd(free_port(), STATE)
    yield end
    end.close()


def answered(monkeypatch, end, port, faults=None):
    """An answer of the rig, which hears as soon as it is asked."""
    real = socket.socket.recv

    def recv(one, size):
        end.hear(["top", "skin"])
        return real(one, size)

    monkeypatch.setattr(socket.socket, "recv", recv)
    return ask_rig(port, faults)


def test_a_page_blindfolds_sensors_and_gets_the_boxes(monkeypatch, rig_end):
    port = int(rig_end._path.stem)
    assert answered(monkeypatch, rig_end, port) == {"faults": {}, **STATE}
    wrong = {"no sensor": "blind", "skin": "no fault"}
    found = answered(monkeypatch, rig_end, port, {"top": "blind", **wrong})
    assert found["faults"] == rig_end.faults == {"top": "blind"}
    assert answered(monkeypatch, rig_end, port)["faults"] == {"top": "blind"}


def test_the_link_is_closed_to_other_users_and_to_those_without_the_word(rig_end):
    path = rig_end._path
    assert path.stat().st_mode & 0o777 == 0o600
    to = int(path.read_text().split()[0])
    guessed = json.dumps({"word": "guessed", "faults": {"top": "blind"}}).encode()
    wrong = (b"", b"[]", b"{}", b'{"word": 3}', b"\xff", b"[" * 50_000, guessed)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.settimeout(0.2)
        for data in wrong:
            one.sendto(data, ("127.0.0.1", to))
        rig_end.hear(["top"])
        with pytest.raises(TimeoutError):
            one.recv(100)
    assert not rig_end.faults


def test_there_is_no_answer_without_a_rig():
    assert ask_rig(free_port()) is None


def test_boxes_stand_on_the_table_apart_from_the_robots(table):
    found = places_in_view(table, 4, np.random.default_rng(2))
    assert len(found) == 4
    guard = ag.Guard(table, self_test=False)
    guard.step(guard.home, 0.0)
    links = guard.poses[:, [3, 7, 11]]
    for size, xyz in found:
        # The table's top is at 0.
        assert xyz[2] - size[2] / 2 == pytest.approx(0.0, abs=2e-3)
        assert np.linalg.norm(links - xyz, axis=1).min() > APART


class Watched:
    """A service with simulated sensors, arms that sway, and a client of the sensors."""

    def __init__(self):
        command = [
            sys.executable, "-m", "armguard", "serve", "sensed-table", "--port=0",
            "--no-self-test", "--rate=100", "--late=0.1", "--stale=1",
            "--simulated-sensors",
        ]  # fmt: skip
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        line = self.process.stdout.readline()
        self.port = int(re.search(r":(\d+), ring", line)[1])
        self.client = ag.Client(self.port, watchdog=1.0)
        self.client.connect(PATIENCE)
        self.sensors = ag.SensorClient(self.port)
        self.sensors.connect(PATIENCE)
        self.arms = Arms(self.client)

    def until(self, done):
        end = time.monotonic() + PATIENCE
        still = 0.0 * self.arms.q
        while not done(self.arms.drive(still, 1)):
            assert time.monotonic() < end, self.sensors.health

    def close(self):
        self.client.close()
        self.sensors.close()
        self.process.send_signal(signal.SIGTERM)
        self.process.communicate(timeout=30)


@pytest.fixture(scope="module")
def watched():
    one = Watched()
    yield one
    one.close()


def blind(watched):
    return {name for name, says in watched.sensors.health.items() if "BLIND" in says}


def test_a_sensor_that_is_blindfolded_is_named_and_stops_the_arms(watched):
    watched.until(lambda a: a.reason is not ag.Reason.CELLS_STALE)
    assert ask_rig(watched.port, {"top": "blind"}) is not None
    watched.until(lambda a: blind(watched) == {"top"})
    watched.until(lambda a: a.reason is ag.Reason.CELLS_STALE)
    assert ask_rig(watched.port, {}) is not None
    watched.until(
        lambda a: a.reason is not ag.Reason.CELLS_STALE and not blind(watched)
    )
