"""A recording of cycles with cells is judged again to the bit."""

import numpy as np

from armguard.recording import open_recording
from armguard.recording.calls import UpdateCells
from armguard.recording.recorded import RecordedGuard
from armguard.recording.recorder import Recorder, RecorderSettings
from armguard.recording.replay import replay
from armguard.recording.ring import RingReader, RingWriter
from armguard.respond import Action, Guard
from sensed import PERIOD, changes, grid, sensed_scene

CYCLES = 400


def recorded(folder, checkpoints=100):
    """Drive an arm among cells that come and go, and record it; its actions."""
    scene = sensed_scene("moving")
    guard = Guard(scene, self_test=False)
    ring, at = RingWriter(folder / "ring", 32 << 20), [0.0]
    tape = RecordedGuard(guard, ring, monotonic=lambda: at[0], wall=lambda: at[0])
    tape.describe(scene, {})
    tape.checkpoint()
    rng = np.random.default_rng(7)
    q, v, actions = guard.home, np.zeros(len(guard.home)), []
    wall = grid()
    wall[46, 24:40, 24:40] = True
    for k in range(CYCLES):
        at[0] = t = k * PERIOD
        if k % 20 == 0:
            occupied = wall & (rng.random(wall.shape) < 0.5)
            found = changes(occupied, grid(), t, np.float32(0.003), motion=k // 20 % 2)
            tape.do(UpdateCells(deltas=found, stamp=t))
        if k % checkpoints == checkpoints - 1:
            tape.checkpoint()
        wanted = 0.4 * np.sign(np.sin(0.02 * k + np.arange(len(q))))
        command = tape.filter(q, wanted, t, velocity=v)
        actions.append(command.action)
        v = command.velocity
        q = q + PERIOD * v
    recorder = Recorder(folder / "tapes", RecorderSettings())
    for row in RingReader(folder / "ring").unread():
        recorder.take(row)
    recorder.end()
    return actions


def test_cells_and_cycles_are_the_same_again(tmp_path):
    actions = recorded(tmp_path)
    # Cells changed what was commanded.
    assert max(actions) >= Action.STOP
    assert min(actions) == Action.FOLLOW
    found = replay(open_recording(tmp_path / "tapes"))
    assert found.sentence == f"{CYCLES} cycles, bit-identical"
    assert found.checkpoints == 4
    part = replay(open_recording(tmp_path / "tapes"), start=1.0)
    assert part.identical
