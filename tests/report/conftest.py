"""A run in the bay with stops, a fault and a gap, recorded as it is in earnest."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from armguard import Guard, Sphere, bay_scene
from armguard.guard.verdict import Verdict
from armguard.recording.calls import Engage, Place
from armguard.recording.frames import Frame, frame_of
from armguard.recording.recorded import RecordedGuard
from armguard.recording.recorder import Recorder, RecorderSettings
from armguard.recording.ring import RingReader, RingWriter
from armguard.scene import Scene, bay_task
from armguard.scene.settings import ResponseSettings

PERIOD = 0.004
CYCLES = 3000

# The clock is stopped for the guard and goes on for the recording here [s].
GAP_AT, GAP = 2500, 0.5

# A measurement that is none.
FAULT_AT = 2000

BEGIN = 100.0

# A name that a careless page would run.
EVIL = "<img src=x onerror=alert(1)><script>alert(2)<"


@dataclass(frozen=True)
class Evening:
    """What was recorded, and what the guard answered.

    Attributes:
        scene: The scene.
        guard: The guard.
        times: When each cycle was judged [s].
        verdicts: Its answers.
        held: Names of the robots that were held after each cycle.
        frames: What came through the ring.
        file: The recording.
    """

    scene: Scene
    guard: Guard
    times: list[float]
    verdicts: list[Verdict]
    held: list[set[str]]
    frames: list[Frame]
    file: Path


def evening_scene() -> Scene:
    """The bay with arms that stop, and something with an evil name."""
    scene = bay_scene("path")
    scene.period = PERIOD
    for name, robot in list(scene.robots.items()):
        scene._robots[name] = replace(robot, response=ResponseSettings(kind="stop"))
    scene.add(Sphere(radius=0.05), name=EVIL, present=False)
    return scene


def bad_goals(guard: Guard, count: int) -> list[np.ndarray]:
    """Configurations in which something overlaps."""
    rng = np.random.default_rng(1)
    task = bay_task(700)
    rows = task.q[:, [task.names.index(name) for name in guard.q_names]]
    found: list[np.ndarray] = []
    while len(found) < count:
        q = rows[rng.integers(len(rows))] + rng.normal(size=rows.shape[1]) * 0.6
        q = np.clip(q, guard.tables.lower + 0.05, guard.tables.upper - 0.05)
        nearest = guard.judge_at_rest(q).nearest
        if nearest is not None and nearest.distance < -0.02:
            found.append(q)
    return found


@pytest.fixture(scope="session")
def evening(tmp_path_factory: pytest.TempPathFactory) -> Evening:
    """Both arms are driven at what is in their way, time and again."""
    folder = tmp_path_factory.mktemp("evening")
    scene = evening_scene()
    guard = Guard(scene, self_test=False)
    goals = bad_goals(guard, 8)
    guard.reset()
    clock = [BEGIN]
    ring = RingWriter(folder / "ring", 16 << 20)
    reader = RingReader(folder / "ring")
    taped = RecordedGuard(
        guard, ring, monotonic=lambda: clock[0], wall=lambda: 1.7e9 + clock[0]
    )
    recorder = Recorder(folder, RecorderSettings())
    taped.describe(scene, {"version": "0.1.0", "settings": {"rate": 250, "evil": EVIL}})
    taped.checkpoint()
    frames: list[Frame] = []
    times: list[float] = []
    verdicts: list[Verdict] = []
    held: list[set[str]] = []
    q, v = guard.home.copy(), np.zeros(14)
    for k in range(CYCLES):
        t = k * PERIOD
        clock[0] = BEGIN + t + (GAP if k > GAP_AT else 0.0)
        if k % 400 == 0:
            # Let go of them and lead them on, as an operator does after a stop.
            taped.do(Engage())
            goal = goals[k // 400 % 8] if k // 400 % 3 else guard.home
        if k == 1200:
            here = np.eye(4)
            here[:3, 3] = guard.poses.reshape(-1, 3, 4)[6, :, 3] + [0.0, 0.0, 0.14]
            taped.do(Place(name=EVIL, pose=here))
        desired = np.clip(2.0 * (goal - q), -0.8, 0.8)
        measured = np.full(14, np.nan) if k == FAULT_AT else q
        command = taped.filter(
            measured,
            desired,
            t - 0.001,
            velocity=v,
            now=t,
            received=clock[0] - 1e-4 * (1 + k % 7),
        )
        times.append(clock[0])
        verdicts.append(command.verdict)
        held.append(set(command.held))
        v = command.velocity.copy()
        q = q + v * PERIOD
        if k % 200 == 199 or k == CYCLES - 1:
            for row in reader.unread():
                recorder.take(row)
                frames.append(frame_of(row))
            recorder.flush()
    recorder.end()
    ring.close()
    (file,) = folder.glob("recording-*.mcap")
    return Evening(scene, guard, times, verdicts, held, frames, file)
