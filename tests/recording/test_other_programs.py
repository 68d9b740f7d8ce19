"""What other people's programs read of a recording, by their own libraries."""

import numpy as np
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from armguard.recording import open_recording
from armguard.recording.frames import Kind
from armguard.recording.ros import TOPICS
from recording.tapes import PERIOD


def recorded(drive):
    """The one recording of a folder."""
    folder, tape = drive
    (path,) = folder.glob("recording-*.mcap")
    return path, tape


def test_the_library_of_the_format_finds_it_whole(drive):
    path, _ = recorded(drive)
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert {c.topic for c in summary.channels.values()} == {t.name for t in TOPICS}
        count = sum(1 for _ in reader.iter_messages())
        assert count == summary.statistics.message_count
        assert {a.name for a in reader.iter_attachments()} == {
            "armguard about", "armguard scene",
        }  # fmt: skip
        (about,) = reader.iter_metadata()
    assert about.metadata["scene_file"] == "bay"


def test_joint_states_levels_and_lines_are_read_as_a_bag_of_ros(drive):
    path, tape = recorded(drive)
    true = {
        round(f.monotonic / PERIOD): f
        for f in open_recording(path).frames()
        if f.kind is Kind.CYCLE
    }
    first = None
    seen = dict.fromkeys((t.name for t in TOPICS), 0)
    stops, sentences, lines = 0, [], 0
    with AnyReader([path]) as reader:
        for connection, time, data in reader.messages():
            seen[connection.topic] += 1
            if connection.topic == "/armguard/frames":
                continue
            message = reader.deserialize(data, connection.msgtype)
            if connection.topic in ("/joint_states", "/armguard/commands"):
                first = time if first is None else first
                stamp = message.header.stamp
                assert stamp.sec * 10**9 + stamp.nanosec == time
                assert tuple(message.name) == tape.guard.q_names
                cycle = round((time * 1e-9 - 1.7e9 + 1e3) / PERIOD)
                frame = true[cycle]
                if connection.topic == "/joint_states":
                    assert np.asarray(message.position).tobytes() == frame.q.tobytes()
                else:
                    assert (message.velocity == frame.told[:14]).all()
            elif connection.topic == "/armguard/level":
                stops += message.data >= 30
            elif connection.topic == "/armguard/log":
                sentences.append(message.msg)
            elif connection.topic == "/armguard/near":
                for marker in message.markers:
                    lines += len(marker.points) // 2
                    ends = [(p.x, p.y, p.z) for p in marker.points]
                    assert np.isfinite(ends).all()
    assert all(seen.values())
    assert stops > 0
    assert lines > 0
    assert any("STOP" in sentence and " mm" in sentence for sentence in sentences)
    assert any("near miss" in sentence for sentence in sentences)
    assert any("engage" in sentence for sentence in sentences)
