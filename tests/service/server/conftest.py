"""Services as processes of their own, on a scene that tolerates a busy machine."""

import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from armguard import Client
from armguard.recording.counters import CountersReader
from armguard.scene.bay import bay_path

# How much later than its period a cycle may come here [s]. Tests share their machine,
# and it is no business of theirs how fast it is.
LATE = 0.4


class Served:
    """A service in a process.

    Attributes:
        process: The process.
        port: Its port.
        ring: Path of its ring.
    """

    def __init__(self, arguments: list[str]) -> None:
        command = [sys.executable, "-m", "armguard", "serve", *arguments]
        self.process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        found = re.fullmatch(r"listening on [\d.]+:(\d+), ring (.*)\n", line)
        if found is None:
            _, errors = self.process.communicate(timeout=30)
            raise AssertionError(line + errors)
        self.port = int(found[1])
        self.ring = Path(found[2])

    def client(self, **settings: object) -> Client:
        """A client that is connected, as patient as the service."""
        settings.setdefault("watchdog", LATE)
        client = Client(port=self.port, **settings)
        client.connect(timeout=20.0)
        return client

    @property
    def counters(self) -> CountersReader:
        """What it has counted."""
        return CountersReader(self.ring.with_name(self.ring.name + ".counters"))

    def end(self) -> str:
        """End it; what it said on standard error."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGCONT)
            self.process.send_signal(signal.SIGTERM)
        _, errors = self.process.communicate(timeout=30)
        return errors


@pytest.fixture(scope="session")
def patient_bay(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The bay, with arms whose states may be as old as `LATE`."""
    folder = tmp_path_factory.mktemp("scene")
    text = bay_path().read_text(encoding="utf-8")
    assert "stale: 0.010" in text
    text = text.replace("stale: 0.010", f"stale: {LATE}")
    text = text.replace("urdf: bay_arm.urdf", f"urdf: {bay_path().parent}/bay_arm.urdf")
    file = folder / "bay.yaml"
    file.write_text(text, encoding="utf-8")
    return file


@pytest.fixture(scope="session")
def serving(patient_bay: Path):
    """Starts services; each is ended with its block."""

    @contextmanager
    def start(*arguments: str, scene: str = "") -> Iterator[Served]:
        served = Served(
            [
                scene or str(patient_bay),
                "--port=0",
                "--no-self-test",
                "--mode=path",
                f"--late={LATE}",
                *arguments,
            ]
        )
        try:
            yield served
        finally:
            served.end()

    return start


@pytest.fixture(scope="session")
def served(serving) -> Iterator[Served]:
    """One service for all tests that do not end it; `Arms` begins anew."""
    with serving() as one:
        yield one
