"""A result as frames of a recording, for the view."""

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from armguard.fleet.audit import Auditor, speeds_at
from armguard.fleet.episodes import frames_of
from armguard.fleet.inputs import Input
from armguard.fleet.job import FleetError
from armguard.fleet.loops import Loops
from armguard.fleet.manifest import Manifest
from armguard.recording.frames import Frame
from armguard.recording.recorded import Tape, judged
from armguard.recording.ring import in_memory
from armguard.scene import Scene
from armguard.simulation.judge import rising

# Frames a second of an input without times [Hz].
RATE = 30.0


def item_frames(out: Path, item: int) -> tuple[Scene, Iterator[Frame]]:
    """The scene of a result, and its frames, judged by a guard one by one.

    Args:
        out: Folder of the results.
        item: Number of the result.

    Raises:
        FleetError: There is no such result, or its input cannot be read.
    """
    manifest = Manifest.read(out)
    if manifest.work == "replay":
        raise FleetError("a replayed recording is shown by `armguard view RECORDING`")
    if not 0 <= item < manifest.items:
        raise FleetError(f"{out} has results 0 to {manifest.items - 1}, not {item}")
    group, one = manifest.item(item)
    if manifest.work == "run":
        loops = Loops(manifest, group)
        return loops.scene, looped(loops, one)
    scene, budget = manifest.scene(group)
    [frames] = frames_of([one], manifest.job, manifest.folder, scene)
    if isinstance(frames, tuple):
        raise FleetError(frames[1])
    auditor = Auditor(scene, budget, manifest.job)
    times = rising(frames.times) / (1.0 if frames.timed else RATE)
    speeds = None if auditor.fixed else speeds_at(frames.q, times)
    return scene, judged(auditor.guard_for(times), frames.q, times, speeds)


def looped(loops: Loops, one: Input) -> Iterator[Frame]:
    """Frames of a closed loop."""
    with TemporaryDirectory(dir=in_memory()) as folder:
        tape = Tape(loops.guard, folder)
        loop, longest = loops.loop(one, tape.guard.filter)
        for _ in loop.run(longest):
            tape.now = loop.times[-1]
            yield from tape.unread()
