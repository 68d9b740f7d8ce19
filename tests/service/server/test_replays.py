"""What a service records judges again to the bit, however early clients talk to it."""

import threading
import time

import numpy as np
import pytest

from armguard import Client
from armguard.errors import NoServiceError
from armguard.recording import open_recording
from armguard.recording.frames import IN_FRAME, Kind
from armguard.recording.recorder import Recorder, RecorderSettings
from armguard.recording.replay import replay
from armguard.recording.ring import RingReader
from armguard.service.server import Service, ServiceSettings
from armguard.service.server.scenes import open_scene
from service_arms import PATIENCE

LATE = 0.4

# How long an answer of the client is waited for where the service reads [s].
PAUSE = 0.05


def talk(port, over, cycles):
    """Say hello again and again; then take the command, move and be stopped."""
    with Client(port=port, watchdog=LATE) as client:
        while not over.is_set():
            try:
                client.connect(0.2)
                break
            except NoServiceError:
                continue
        q = client.welcome.home.copy()
        client.send_state(q, 0.0 * q)
        deadline = time.monotonic() + PATIENCE
        while not client.commands and time.monotonic() < deadline:
            client.send_state(q, 0.0 * q)
            try:
                client.claim(force=True, timeout=0.2)
            except NoServiceError:
                continue
        for k in range(cycles):
            if k == cycles // 2:
                client.stop()
            try:
                desired = 0.02 * np.sin(0.1 * k) * np.ones_like(q)
                answer = client.cycle(q, desired, 0.0 * q, timeout=0.5)
                q = q + 0.004 * answer.velocity
            except NoServiceError:
                break
            time.sleep(0.003)


def start(patient_bay, monkeypatch, folder, *, slowly):
    """A service beside a client that talks from the very beginning; its recordings."""
    settings = ServiceSettings(port=0, late=LATE, self_test=True)
    scene, file = open_scene(
        str(patient_bay), period=settings.period, late=LATE, mode="path"
    )
    one = Service(scene, settings, file=file)
    read, reads = one._reception.read, 0

    def patient_read():
        # So that all the client says at first is read in one go.
        nonlocal reads
        reads += 1
        if slowly and reads < 8:
            time.sleep(PAUSE)
        return read()

    monkeypatch.setattr(one._reception, "read", patient_read)
    reader = RingReader(one.ring.path)
    over = threading.Event()
    client = threading.Thread(target=talk, args=(one.port, over, 60))
    loop = threading.Thread(target=one.run, args=(over.is_set,))
    client.start()
    time.sleep(0.1)
    loop.start()
    client.join(2.0 * PATIENCE)
    over.set()
    loop.join(PATIENCE)
    assert not loop.is_alive()
    assert not client.is_alive()
    recorder = Recorder(folder, RecorderSettings(after=0.05, before=0.1))
    kinds = []
    for row in reader.unread():
        kinds.append(int(row[IN_FRAME.kind]))
        recorder.take(row)
        recorder.flush()
    recorder.end()
    return kinds, sorted(folder.glob("*.mcap"))


@pytest.mark.parametrize("slowly", [True, False])
def test_every_file_of_a_start_beside_a_client_that_talks_replays_alone(
    patient_bay, monkeypatch, tmp_path, slowly
):
    for k in range(2):
        kinds, files = start(patient_bay, monkeypatch, tmp_path / str(k), slowly=slowly)
        assert kinds.count(Kind.CYCLE) > 30
        assert kinds.index(Kind.CHECKPOINT) < kinds.index(Kind.CYCLE)
        assert any(path.name.startswith("near-miss") for path in files)
        for path in files:
            found = replay(open_recording(path))
            assert found.identical, (path.name, found.sentence)
            assert not found.skipped, (path.name, found.sentence)
            assert found.cycles > 0
