"""The service beside a real reflex: neither lifts the other's stop."""

import signal
import subprocess
import sys

import numpy as np
import pytest

from armguard.errors import RefusedError
from armguard.recording.frames import frame_of
from armguard.recording.ring import RingReader
from armguard.service.wire import Cause
from armguard.service.wire.pulses import reset
from reflex.rack import PATIENCE, Rack
from service_arms import Arms, until, wait_for

# Listeners are as patient as the services of these tests [s].
WATCHDOG = 0.4
WISH, STILL = np.full(14, 0.02), np.zeros(14)


@pytest.fixture
def rack(tmp_path):
    with Rack(tmp_path, more={"watchdog": WATCHDOG}, timeout=0.4) as it:
        it.sensor = it.start_sensor()
        wait_for(lambda: not reset(it.file, PATIENCE))
        yield it
        it.sensor.send_signal(signal.SIGCONT)
        it.sensor.kill()
        it.sensor.wait()


@pytest.fixture
def served(serving, rack):
    with serving("--reflex", str(rack.file)) as it:
        yield it


def lift(rack):
    rack.sensor.send_signal(signal.SIGUSR2)
    wait_for(lambda: not reset(rack.file, PATIENCE))


def test_the_stop_of_the_reflex_stays_until_reset_and_engaged(served, rack):
    frames = RingReader(served.ring, newest=True)
    with served.client() as client, served.client(name="observer", every=1) as observer:
        arms = Arms(client)
        arms.lead(WISH)
        rack.sensor.send_signal(signal.SIGUSR1)
        answer = arms.drive_until(WISH, lambda a: a.cause is Cause.REFLEX_STOPPED)
        assert not answer.velocity.any()
        seen = until(
            lambda: observer.receive(PATIENCE),
            lambda a: a.cause is Cause.REFLEX_STOPPED,
        )
        assert seen.stops and seen.cycle >= 0
        arms.drive_until(STILL, lambda a: len(seen_held(observer)) == 2)
        assert "zone" in client.call("why")["reflex"]
        # The guard's own engagement does not lift the stop of the reflex.
        with pytest.raises(RefusedError, match="a zone is nearer") as error:
            client.call("engage")
        assert error.value.reason == "REFLEX_STOPPED"
        # Its reset does not lift that of the guard.
        lift(rack)
        answer = arms.drive_until(WISH, lambda a: a.cycle >= 0)
        answer = arms.drive(WISH, 20)
        assert answer.cause is Cause.REFLEX_STOPPED and not answer.velocity.any()
        until(lambda: arms.drive(STILL, 1), lambda a: engaged(client))
        arms.lead(WISH)
        arms.drive(STILL, 10)
    notes = [frame.text for frame in map(frame_of, frames.unread()) if frame.text]
    assert any("REFLEX_STOPPED" in str(note) for note in notes)


def seen_held(observer):
    """Robots that the newest answer holds."""
    observer.receive(PATIENCE)
    return observer.latest.held


def engaged(client):
    """Engage the robots, if the service has heard of the reset."""
    try:
        client.call("engage")
    except RefusedError:
        return False
    return True


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_reflex_that_is_dead_or_frozen_stops_the_arms(served, rack, number):
    with served.client() as client, served.client(name="observer", every=1) as observer:
        arms = Arms(client)
        arms.lead(WISH)
        rack.process.send_signal(number)
        answer = arms.drive_until(WISH, lambda a: a.cause is Cause.REFLEX_SILENT)
        assert not answer.velocity.any()
        until(
            lambda: observer.receive(PATIENCE),
            lambda a: a.cause is Cause.REFLEX_SILENT,
        )
        with pytest.raises(RefusedError, match="the reflex is silent"):
            client.call("engage")


def test_a_service_without_the_file_ends_in_a_sentence(patient_bay, tmp_path):
    words = ("serve", str(patient_bay), "--port=0", "--no-self-test", "--mode=path")
    words = (*words, "--reflex", str(tmp_path / "reflex.json"))
    done = subprocess.run(
        [sys.executable, "-m", "armguard", *words],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 2
    assert "`armguard check SCENE --reflex` writes this file" in done.stderr
