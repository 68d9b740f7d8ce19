"""One recording with a stop in it, for all tests that only read."""

import pytest

from recording.tapes import Tape, record_here


@pytest.fixture(scope="session")
def drive(tmp_path_factory):
    """Folder of the recording, and the tape it is of."""
    folder = tmp_path_factory.mktemp("drive")
    tape = Tape(folder)
    tape.begin()
    recorder = record_here(tape, folder / "tapes", 5.0, before=1.0, after=0.5)
    tape.close()
    assert tape.stops
    assert recorder.near_misses == 1
    return folder / "tapes", tape
