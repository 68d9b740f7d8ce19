"""Processes that end, or are made to pause: those that are left stop in time."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from armguard import Action
from armguard.errors import ServiceError
from armguard.recording.frames import Kind, frame_of
from armguard.recording.ring import RingReader
from armguard.service.client import Answer
from armguard.service.server import ServiceSettings
from armguard.service.wire import Cause
from armguard.service.wire.keys import new_keys
from service_arms import PATIENCE, Arms, until, wait_for

WISH = np.full(14, 0.02)

# A controller and commander that goes on until it is killed.
DRIVES = """
import sys
import numpy as np
from armguard import Client
from service_arms import Arms
client = Client(port=int(sys.argv[1]))
client.connect(20.0)
arms = Arms(client)
arms.drive(np.full(14, 0.02), 10)
print("drives", flush=True)
while True:
    arms.drive(np.full(14, 0.02), 1)
"""


def test_a_service_that_pauses_or_is_killed_is_a_stop_at_its_clients(serving):
    with serving() as served, served.client(watchdog=0.2) as client:
        arms = Arms(client)
        arms.lead(WISH)
        late = served.counters.value("deadline_missed")
        served.process.send_signal(signal.SIGSTOP)
        answer = until(lambda: client.latest, lambda a: a.stops)
        assert (answer.velocity == 0.0).all()
        assert answer.action is Action.STOP
        until(lambda: client.latest, lambda a: a.cause is Cause.SERVICE_SILENT)
        time.sleep(0.8)
        served.process.send_signal(signal.SIGCONT)
        # It knows that it was away: what it says then is a stop as well.
        wait_for(lambda: served.counters.value("deadline_missed") > late)
        assert until(lambda: client.latest, lambda a: a.cycle >= 0).stops

        arms.lead(WISH)
        served.process.kill()
        answer = until(lambda: client.latest, lambda a: a.stops)
        assert (answer.velocity == 0.0).all()
        until(lambda: client.latest, lambda a: a.cause is Cause.SERVICE_SILENT)
        # What it left behind is readable, up to its last cycle.
        rows = list(RingReader(served.ring).unread())
        assert frame_of(rows[-1]).kind in (Kind.CYCLE, Kind.CHECKPOINT)
        served.ring.unlink()
        served.ring.with_name(served.ring.name + ".counters").unlink()


def test_a_client_that_is_killed_leaves_robots_at_rest(served, patient_bay):
    path = os.pathsep.join(filter(None, [str(Path(__file__).parents[2]), *sys.path]))
    with (
        subprocess.Popen(
            [sys.executable, "-c", DRIVES, str(served.port)],
            stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": path},
        ) as driver,
        served.client() as observer,
    ):
        assert driver.stdout is not None
        assert driver.stdout.readline() == b"drives\n"
        moving = until(lambda: observer.receive(1.0) or observer.latest, moves)
        assert moving.commander != 0
        driver.kill()
        answer = until(
            lambda: observer.receive(1.0) or observer.latest,
            lambda a: a.cycle >= 0 and not a.commander and a.stops,
        )
        assert (answer.velocity == 0.0).all()
        # The next one begins without a commander.
        arms = Arms(observer)
        arms.lead(WISH)
        arms.drive(0 * WISH, 5)


def moves(answer: Answer) -> bool:
    """Whether robots are commanded to move."""
    return bool(answer.velocity.any())


def test_a_client_that_pauses_believes_nothing_old(served):
    with served.client() as client:
        arms = Arms(client)
        arms.lead(WISH)
        time.sleep(1.0)
        # Hundreds of answers came in meanwhile; the ones on top are old.
        first = client.latest
        assert first.stops
        answer = until(lambda: client.latest, lambda a: a.cycle >= 0)
        assert answer.stops
        assert not client.commands


def test_a_port_that_is_taken_is_named_in_words(served, patient_bay):
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "armguard",
            "serve",
            str(patient_bay),
            f"--port={served.port}",
            "--mode=path",
        ],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 2
    assert f"cannot listen on 127.0.0.1:{served.port}" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_service_that_listens_wider_needs_a_key():
    with pytest.raises(ServiceError, match="needs keys they can be given"):
        ServiceSettings(bind="0.0.0.0")
    assert ServiceSettings(bind="0.0.0.0", keys=new_keys()).bind == "0.0.0.0"


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        ("bind", "localhost"),
        ("bind", "::1"),
        ("rate", 5000.0),
        ("rate", float("nan")),
        ("late", 0.0),
        ("heartbeat", 0.2),
        ("port", 70000),
    ],
)
def test_settings_that_cannot_be_are_refused_by_name(setting, value):
    with pytest.raises(ServiceError, match=f"{setting} is"):
        ServiceSettings(**{setting: value})


def test_a_recorder_that_is_killed_costs_nothing_and_the_end_is_a_stop(
    serving, tmp_path
):
    with serving(f"--record={tmp_path}") as served, served.client() as client:
        arms = Arms(client)
        arms.lead(WISH)
        own = f"/proc/{served.process.pid}/task/{served.process.pid}/children"
        (recorder,) = map(int, Path(own).read_text().split())
        os.kill(recorder, signal.SIGKILL)
        wait_for(lambda: served.counters.value("companions_ended") == 1)
        arms.lead(WISH)

        served.process.send_signal(signal.SIGTERM)
        deadline = time.monotonic() + PATIENCE
        while client.latest.cause is not Cause.SERVICE_GONE:
            assert time.monotonic() < deadline
            client.send_state(arms.q, arms.velocity)
            time.sleep(0.004)
        last = None
        while (answer := client.receive()) is not None:
            last = answer
        assert last is not None
        assert last.cause is Cause.SHUTDOWN
        assert set(last.actions.values()) == {Action.STOP}
        assert served.process.wait(PATIENCE) == 0
        assert not served.ring.exists()
        errors = served.end()
    assert "companion 'record' has ended with code -9; the loop goes on" in errors
