"""What the loop writes down: the very bits that went in and came out."""

from pathlib import Path

import numpy as np

from armguard import Box, Guard, Pose, Reason, Sphere, bay_scene
from armguard.guard.answer import names_of
from armguard.guard.verdict import Verdict
from armguard.recording.calls import Place, Remove
from armguard.recording.frames import Form, Kind, frame_of
from armguard.recording.recorded import RecordedGuard
from armguard.recording.replay import do
from armguard.recording.ring import RingReader, RingWriter
from armguard.respond import Command

PERIOD = 0.004


def bay_guard() -> Guard:
    """A guard of the bay, with a cart that may come."""
    scene = bay_scene("path")
    scene.add(Sphere(radius=0.05), name="cart", present=False)
    return Guard(scene, self_test=False)


def test_every_form_is_written_with_its_bits(tmp_path: Path):
    guard = bay_guard()
    ring = RingWriter(tmp_path / "ring")
    taped = RecordedGuard(guard, ring, monotonic=lambda: 5.0, wall=lambda: 7.0)
    q = guard.home
    still = np.zeros_like(q)
    desired = np.full_like(q, 0.01)
    robot = guard.tables.robots[0].name
    answers = [
        taped.filter(q, desired, 0.0, velocity=still, received=4.5),
        taped.filter_positions(q, q + 0.001, PERIOD, velocity=still, now=PERIOD),
        taped.filter_twists(q, {robot: np.arange(6.0) * 1e-3}, 2 * PERIOD),
    ]
    taped.do(Place(name="cart", pose=Pose(xyz=(0.0, 0.0, 1.0))))
    verdict = taped.step(q, 3 * PERIOD, velocity=still)
    why = Reason.DEADLINE_MISSED
    stop = taped.stop(q, 4 * PERIOD, velocity=still, reason=why)
    found = [frame_of(row) for row in RingReader(tmp_path / "ring").unread()]
    kinds = [Kind.CYCLE] * 3 + [Kind.EVENT, Kind.CYCLE, Kind.CYCLE]
    assert [frame.kind for frame in found] == kinds
    assert [frame.cycle for frame in found] == [0, 1, 2, 3, 3, 4]
    forms = (Form.VELOCITIES, Form.POSITIONS, Form.TWISTS)
    names = names_of(guard.tables)
    for frame, answer, form in zip(found, answers, forms, strict=False):
        assert frame.form is form
        assert frame.q.tobytes() == q.tobytes()
        assert frame.told.tobytes() == answer.numbers.tobytes()
        assert frame.verdict.tobytes() == answer.verdict.numbers.tobytes()
        again = Verdict(frame.verdict, names, None, 0.0)
        assert again.why == answer.verdict.why
        command = Command(frame.told, guard.tables.robots, again)
        assert command.actions == answer.actions
        assert (command.velocity == answer.velocity).all()
    assert found[0].received == 4.5
    assert found[0].wall == 7.0
    assert found[0].velocity is not None
    assert found[0].now is None
    assert (found[0].asked == desired).all()
    assert found[1].now == PERIOD
    assert found[2].velocity is None
    assert found[2].text["tools"] == [robot]
    assert (found[2].asked == np.arange(6.0) * 1e-3).all()
    assert found[3].text["call"] == "place"
    assert found[3].text["name"] == "cart"
    assert found[4].form is Form.STEP
    assert (found[4].poses == guard.poses).all()
    assert guard.poses.shape == (len(guard.tables.parent), 12)
    assert found[4].verdict.tobytes() == verdict.numbers.tobytes()
    assert found[5].form is Form.STOP
    assert found[5].asked.tolist() == [why]
    assert found[5].told.tobytes() == stop.numbers.tobytes()


def test_input_that_is_none_is_written_as_nan_with_its_fault(tmp_path: Path):
    guard = bay_guard()
    ring = RingWriter(tmp_path / "ring")
    taped = RecordedGuard(guard, ring)
    command = taped.filter([1.0, 2.0], "nonsense", 0.0)
    frame = frame_of(next(RingReader(tmp_path / "ring").unread()))
    assert np.isnan(frame.q).all()
    assert np.isnan(frame.asked).all()
    assert frame.text["fault"] == command.verdict.fault != ""


def test_a_box_that_was_given_a_size_has_it_again_after_a_checkpoint(tmp_path: Path):
    def spare() -> Guard:
        scene = bay_scene("path")
        small = Box(size=(0.02, 0.02, 0.02))
        scene.add(small, name="spare", present=False)
        return Guard(scene, self_test=False)

    guard = spare()
    taped = RecordedGuard(guard, RingWriter(tmp_path / "ring"))
    q, still = guard.home, np.zeros(len(guard.q_names))
    x, y, z = guard.poses[-1, [3, 7, 11]].tolist()
    large = Box(size=(0.1, 0.1, 0.1))
    taped.do(Place(name="spare", pose=Pose(xyz=(x, y, z + 0.3)), shape=large))
    for k in range(3):
        taped.filter(q, still, k * PERIOD, velocity=still)
    taped.checkpoint()
    taped.do(Remove(name="spare"))
    taped.do(Place(name="spare", pose=Pose(xyz=(x + 0.15, y, z))))
    for k in range(3, 9):
        taped.filter(q, still, k * PERIOD, velocity=still)
    found = [frame_of(row) for row in RingReader(tmp_path / "ring").unread()]
    begin = next(k for k, frame in enumerate(found) if frame.kind is Kind.CHECKPOINT)
    again = spare()
    again.restore(found[begin].data)
    met = 0
    for frame in found[begin + 1 :]:
        if frame.kind is Kind.EVENT:
            do(again, frame)
            continue
        stamp = float(frame.stamps[0])
        command = again.filter(frame.q, frame.asked, stamp, velocity=frame.velocity)
        assert command.numbers.tobytes() == frame.told.tobytes()
        assert command.verdict.numbers.tobytes() == frame.verdict.tobytes()
        met += any("spare" in (p.a, p.b) for p in command.verdict.near)
    assert met == 6
