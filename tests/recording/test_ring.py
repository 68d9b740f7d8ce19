"""The ring: whole records in order, or the number of those that were lost."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from armguard.errors import RingError
from armguard.recording.ring import RingReader, RingWriter

SMALL = 8 * 1024

# A process that writes records of drawn lengths, each full of its own number.
WRITES = """
import sys
import numpy as np
from pathlib import Path
from armguard.recording.ring import RingWriter
path, count = Path(sys.argv[1]), int(sys.argv[2])
ring = RingWriter(path, 64 * 1024)
print("ready", flush=True)
sys.stdin.readline()
rng = np.random.default_rng(1)
for k in range(count):
    ring.append(np.full(int(rng.integers(1, 300)), float(k)))
ring.close()
"""


def test_records_come_back_in_order_with_their_lengths(tmp_path: Path):
    writer = RingWriter(tmp_path / "ring", SMALL)
    reader = RingReader(tmp_path / "ring")
    rng = np.random.default_rng(0)
    for k in range(2000):
        row = rng.normal(size=int(rng.integers(1, 200)))
        writer.append(row)
        got = list(reader.unread())
        assert len(got) == 1, k
        assert got[0].tobytes() == row.tobytes()
        latest = reader.latest()
        assert latest is not None
        assert latest.tobytes() == row.tobytes()
    assert reader.lost == 0
    assert list(reader.unread()) == []


def test_a_reader_that_comes_late_knows_how_many_it_lost(tmp_path: Path):
    writer = RingWriter(tmp_path / "ring", SMALL)
    reader = RingReader(tmp_path / "ring")
    writer.append(np.array([0.0]))
    assert [int(row[0]) for row in reader.unread()] == [0]
    for k in range(1, 1000):
        writer.append(np.full(10, float(k)))
    got = [int(row[0]) for row in reader.unread()]
    assert got == list(range(got[0], 1000))
    assert reader.lost == got[0] - 1
    assert reader.lost + len(got) + 1 == reader.written


def test_nan_and_signed_zero_keep_their_bits(tmp_path: Path):
    writer = RingWriter(tmp_path / "ring", SMALL)
    row = np.array([np.nan, -0.0, np.inf, -np.inf, 5e-324])
    writer.append(row)
    latest = RingReader(tmp_path / "ring").latest()
    assert latest is not None
    assert latest.tobytes() == row.tobytes()


def test_what_is_reserved_is_not_seen_before_it_is_committed(tmp_path: Path):
    writer = RingWriter(tmp_path / "ring", SMALL)
    reader = RingReader(tmp_path / "ring")
    writer.append(np.array([1.0]))
    writer.reserve(3)[:] = 2.0
    assert [row.tolist() for row in reader.unread()] == [[1.0]]
    writer.commit()
    assert [row.tolist() for row in reader.unread()] == [[2.0] * 3]


def test_refusals_name_the_file(tmp_path: Path):
    with pytest.raises(RingError, match="no ring is there"):
        RingReader(tmp_path / "none")
    (tmp_path / "other").write_bytes(b"x" * 4096)
    with pytest.raises(RingError, match="no ring"):
        RingReader(tmp_path / "other")
    (tmp_path / "empty").touch()
    with pytest.raises(RingError, match="no ring"):
        RingReader(tmp_path / "empty")
    with pytest.raises(RingError, match="can be made"):
        RingWriter(tmp_path / "no folder" / "ring")
    writer = RingWriter(tmp_path / "ring", SMALL)
    with pytest.raises(RingError, match="no room"):
        writer.reserve(SMALL)


def test_a_reader_in_another_process_never_sees_half_a_record(tmp_path: Path):
    count = 60_000
    path = tmp_path / "ring"
    arguments = [sys.executable, "-c", WRITES, str(path), str(count)]
    with subprocess.Popen(
        arguments, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as writer:
        assert writer.stdout is not None
        assert writer.stdin is not None
        assert writer.stdout.readline() == "ready\n"
        reader = RingReader(path)
        writer.stdin.write("go\n")
        writer.stdin.flush()
        last, read = -1.0, 0
        while not (reader.closed and reader.written == last + 1):
            for row in reader.unread():
                assert (row == row[0]).all()
                assert row[0] > last
                last, read = row[0], read + 1
            latest = reader.latest()
            if latest is not None:
                assert (latest == latest[0]).all()
        assert writer.wait(30) == 0
    assert last == count - 1
    assert read + reader.lost == count
    assert not path.exists()
