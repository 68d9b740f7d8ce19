"""A data set of episodes of an arm at a table, written as LeRobot 3.0 has it."""

import json
from pathlib import Path

import duckdb
import numpy as np

from arrays import Floats

SCENE = """
mode: path
robots:
  arm:
    urdf: panda
    home: {panda_finger_joint1: 0.03}
objects:
  table: {box: [1.4, 1.6, 0.04], at: {xyz: [0.35, 0, -0.03]}}
  crate: {box: [0.3, 0.3, 0.25], at: {xyz: [0.55, 0.42, 0.12]}}
  post: {capsule: {radius: 0.05, length: 0.7}, at: {xyz: [0.35, -0.5, 0.4]}}
"""

FRAMES, FPS = 500, 30

# Episodes of a file.
PER_FILE = 2000

# The joints swing about home; some of these episodes touch something [rad].
SWING = 0.3


def states(home: Floats, count: int, seed: int) -> Floats:
    """Positions of some episodes, shape (count, FRAMES, joints) [rad or m]."""
    rng = np.random.default_rng(seed)
    t = np.arange(FRAMES) / FPS
    q = np.tile(home, (count, FRAMES, 1))
    for k in range(3):
        size = rng.uniform(0.0, SWING / (k + 1), (count, 1, len(home)))
        rate = rng.uniform(0.2, 0.6 + 0.3 * k, (count, 1, len(home)))
        phase = rng.uniform(0.0, 2.0 * np.pi, (count, 1, len(home)))
        turn = rate * t[None, :, None] + phase
        q += size * (np.sin(turn) - np.sin(phase))
    q[..., -1] = home[-1] + 0.005 * np.sin(t)
    # Single precision, as data sets have it.
    return q.astype(np.float32).astype(np.float64)


def write(root: Path, names: list[str], home: Floats, count: int) -> None:
    """A data set of so many episodes; one that is there stays."""
    if (root / "meta" / "info.json").exists():
        return
    (root / "meta" / "episodes" / "chunk-000").mkdir(parents=True)
    (root / "data" / "chunk-000").mkdir(parents=True)
    feature = {"dtype": "float32", "shape": [len(names)], "names": names}
    rows = []
    for file, first in enumerate(range(0, count, PER_FILE)):
        part = min(PER_FILE, count - first)
        q = states(home, part, file)
        columns(root / f"data/chunk-000/file-{file:03d}.parquet", q, first)
        place = {"data/chunk_index": 0, "data/file_index": file}
        rows += [
            {"episode_index": first + k, "length": FRAMES, **place} for k in range(part)
        ]
    with duckdb.connect() as data:
        data.execute(
            "create table e as select unnest(from_json(?::json, ?), max_depth := 2)",
            [json.dumps(rows), json.dumps([dict.fromkeys(rows[0], "BIGINT")])],
        )
        data.execute(
            f"copy e to '{root}/meta/episodes/chunk-000/file-000.parquet' "
            "(format parquet)"
        )
    about = {
        "codebase_version": "v3.0",
        "fps": FPS,
        "total_episodes": count,
        "total_frames": count * FRAMES,
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "features": {"observation.state": feature, "action": feature},
    }
    (root / "meta" / "info.json").write_text(json.dumps(about), encoding="utf-8")


def columns(path: Path, q: Floats, first: int) -> None:
    """Write episodes from the number `first` on; leaders are a frame ahead."""
    count, frames, joints = q.shape
    leader = np.concatenate((q[:, 1:], q[:, -1:]), axis=1)
    table = {
        "episode_index": np.repeat(np.arange(first, first + count), frames),
        "frame_index": np.tile(np.arange(frames), count),
        "timestamp": np.tile(np.arange(frames) / FPS, count).astype(np.float32),
    }
    for k in range(joints):
        table[f"s{k}"] = q[..., k].ravel().astype(np.float32)
        table[f"a{k}"] = leader[..., k].ravel().astype(np.float32)
    state, action = (", ".join(f"{c}{k}" for k in range(joints)) for c in "sa")
    with duckdb.connect(config={"threads": 1}) as data:
        data.register("given", table)
        data.execute(
            f'copy (select episode_index, frame_index, "timestamp", [{state}] as '
            f'"observation.state", [{action}] as action from given) to '
            f"'{path}' (format parquet)"
        )
