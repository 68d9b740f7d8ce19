"""LeRobot datasets in the layouts of their versions, written by DuckDB."""

import json

import duckdb
import numpy as np

# Paths of files: one for each episode, and for many.
ONE_EACH = "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet"
MANY = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"

NAMES = ("turn.pos", "bend.pos")


def sql_array(rows):
    """Rows of numbers as a list of lists that DuckDB reads."""
    return [[float(x) for x in row] for row in rows]


def write_dataset(
    root, version, states, actions=None, *, fps=30, names=NAMES, per_file=2, **info
):
    """A dataset of these episodes.

    Args:
        root: Its folder.
        version: "v2.0", "v2.1" or "v3.0".
        states: Positions of each episode, shape (frames, k).
        actions: The leader's, likewise; None for no such feature.
        fps: Frames a second.
        names: Names of the columns, as in info.json.
        per_file: Episodes of a file, of v3.0.
        info: Entries of info.json that replace the right ones.
    """
    old = version != "v3.0"
    width = states[0].shape[1]
    (root / "meta").mkdir(parents=True)
    feature = {"dtype": "float32", "shape": [width], "names": list_or(names)}
    about = {
        "codebase_version": version,
        "fps": fps,
        "total_episodes": len(states),
        "total_frames": sum(map(len, states)),
        "chunks_size": 1000,
        "data_path": ONE_EACH if old else MANY,
        "features": {"observation.state": feature}
        | ({} if actions is None else {"action": feature}),
    } | info
    (root / "meta" / "info.json").write_text(json.dumps(about))
    data = duckdb.connect()
    data.execute(
        "create table frames (episode_index bigint, frame_index bigint, "
        '"timestamp" float, "observation.state" float[], "action" float[])'
    )
    begin, episodes = 0, []
    for k, state in enumerate(states):
        action = None if actions is None else actions[k]
        add_frames(data, k, state, action, fps)
        place = {"data/chunk_index": 0, "data/file_index": k // per_file}
        span = {"dataset_from_index": begin, "dataset_to_index": begin + len(state)}
        episodes.append({"episode_index": k, "length": len(state), **place, **span})
        begin += len(state)
    columns = "*" if actions is not None else '* exclude ("action")'
    groups = (
        {f"data/chunk-000/episode_{k:06d}.parquet": [k] for k in range(len(states))}
        if old
        else {
            f"data/chunk-000/file-{k // per_file:03d}.parquet": [
                *range(k, k + per_file)
            ]
            for k in range(0, len(states), per_file)
        }
    )
    for name, numbers in groups.items():
        file = root / name
        file.parent.mkdir(parents=True, exist_ok=True)
        data.execute(
            f"copy (select {columns} from frames where list_contains({numbers}, "
            f"episode_index) order by all) to '{file}' (format parquet)"
        )
    if old:
        lines = [
            json.dumps({k: e[k] for k in ("episode_index", "length")}) for e in episodes
        ]
        (root / "meta" / "episodes.jsonl").write_text("\n".join(lines) + "\n")
        return
    file = root / "meta" / "episodes" / "chunk-000" / "file-000.parquet"
    file.parent.mkdir(parents=True)
    data.execute(
        "create table episodes as select unnest(from_json(?::json, ?), max_depth := 2)",
        [json.dumps(episodes), json.dumps([dict.fromkeys(episodes[0], "BIGINT")])],
    )
    data.execute(f"copy episodes to '{file}' (format parquet)")


def list_or(names):
    """Names as JSON has them: a list, or lists by group."""
    return names if isinstance(names, dict) or names is None else list(names)


def add_frames(data, number, state, action, fps):
    """Insert the frames of an episode."""
    rows = {
        "e": [number] * len(state),
        "f": [*range(len(state))],
        "t": [k / fps for k in range(len(state))],
        "s": sql_array(state),
        "a": [None] * len(state) if action is None else sql_array(action),
    }
    kinds = {"e": "bigint", "f": "bigint", "t": "float", "s": "float[]"}
    names = ", ".join(f"unnest(${name}::{kind}[])" for name, kind in kinds.items())
    data.execute(f"insert into frames select {names}, unnest($a::float[][])", rows)


def passing(count=60, low=-0.5, high=1.5, bend=0.0):
    """An episode in which the arm turns past the ball."""
    turn = np.linspace(low, high, count)
    return np.column_stack((turn, np.full(count, bend)))
