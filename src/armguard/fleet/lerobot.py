"""LeRobot datasets, versions 2.0 to 3.0, from `meta/info.json` and Parquet alone."""

import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.bounded import check_file
from armguard.fleet.job import FleetError
from armguard.fleet.store import ParquetError, columns_of, quoted

Floats = NDArray[np.float64]

VERSIONS = ("v2.0", "v2.1", "v3.0")

# Columns of the follower's and the leader's joints.
STATE, ACTION = "observation.state", "action"

# The largest `info.json` that is read [byte].
LARGEST = 64 << 20

# A place in a path's pattern: the dataset is untrusted, and may name nothing else.
PLACE = re.compile(r"\{(\w+):0(\d)d\}")

# Frames a second of any dataset [Hz].
MOST_RATE = 1e5

# Columns of a feature; a robot has fewer joints.
MOST_COLUMNS = 512


@dataclass(frozen=True, slots=True)
class Episode:
    """Where an episode is.

    Attributes:
        number: Its number in the dataset.
        file: Its file, relative to the dataset.
        frames: Its count of frames.
    """

    number: int
    file: str
    frames: int


@dataclass(frozen=True, slots=True)
class EpisodeRows:
    """Frames of several episodes, one after another.

    Attributes:
        first: Where each begins, and the end of the last, shape (e + 1,).
        state: Positions of the follower, in the dataset's numbers: k columns of (n,).
        action: Positions that the leader requested, likewise; None if not there.
        stamps: Times as the file has them, shape (n,) [s].
    """

    first: NDArray[np.intp]
    state: list[Floats]
    action: list[Floats] | None
    stamps: Floats


@dataclass(frozen=True, slots=True)
class Dataset:
    """A dataset.

    Attributes:
        root: Its folder.
        version: Its version, as in "v3.0".
        fps: Frames a second [Hz].
        state: Name of each column of the follower's joints.
        action: Name of each of the leader's; empty if there are none.
        episodes: Its episodes, by number.
    """

    root: Path
    version: str
    fps: float
    state: tuple[str, ...]
    action: tuple[str, ...]
    episodes: tuple[Episode, ...]

    def read(self, episodes: Sequence[Episode]) -> EpisodeRows:
        """The frames of some episodes, in the order of their numbers.

        Raises:
            FleetError: A file is missing or damaged, or does not hold what `meta` says.
        """
        files = list(dict.fromkeys(one.file for one in episodes))
        for file in files:
            if not (self.root / file).is_file():
                raise FleetError(
                    f"{self.root / file}: the file is missing, but meta lists it; copy "
                    "the dataset again"
                )
        chosen = {"number": "episode_index", "frame": "frame_index", "t": "timestamp"}
        state = [f"{quoted(STATE)}[{k + 1}]" for k in range(len(self.state))]
        action = [f"{quoted(ACTION)}[{k + 1}]" for k in range(len(self.action))]
        names = [*chosen.values(), f"len({quoted(STATE)})", *state, *action]
        low, high = episodes[0].number, episodes[-1].number
        try:
            found = columns_of(
                [self.root / file for file in files],
                names,
                f"episode_index between {low} and {high}",
            )
        except ParquetError as error:
            raise FleetError(f"{self.root}: {error}") from None
        return self._checked(episodes, found, len(state))

    def _checked(
        self, episodes: Sequence[Episode], found: list[Floats], width: int
    ) -> EpisodeRows:
        """Rows as columns, in order; refused where they contradict the metadata."""
        frames = np.array([one.frames for one in episodes])
        first = np.concatenate(([0], np.cumsum(frames)))
        numbers = np.repeat([one.number for one in episodes], frames)
        if not np.array_equal(found[0], numbers):
            known, many = np.unique(found[0], return_counts=True)
            there = dict(zip(known.tolist(), many.tolist(), strict=True))
            for one in episodes:
                count = there.get(one.number, 0)
                if count != one.frames:
                    raise FleetError(
                        f"{self.root / one.file}: episode {one.number} has {count} "
                        f"frames, but meta says {one.frames}; correct meta, or record "
                        "it again"
                    )
            order = np.lexsort((found[1], found[0]))
            found = [column[order] for column in found]
        number, frame, stamps, counts, *joints = found
        within = np.arange(len(frame)) - np.repeat(first[:-1], frames)
        for row in np.flatnonzero(frame != within)[:1].tolist():
            raise FleetError(
                f"{self.root}: episode {int(number[row])}: frame {int(within[row])} "
                f"has number {frame[row]:g}; a frame is missing or twice"
            )
        for row in np.flatnonzero(counts != width)[:1].tolist():
            raise FleetError(
                f"{self.root}: episode {int(number[row])}, frame {int(within[row])}: "
                f"{STATE} has {counts[row]:g} numbers, but info.json says {width}"
            )
        action = joints[width:] if self.action else None
        return EpisodeRows(first, joints[:width], action, stamps)


def is_dataset(folder: Path) -> bool:
    """Whether a folder looks like a LeRobot dataset."""
    return (folder / "meta" / "info.json").is_file()


def open_dataset(root: Path) -> Dataset:
    """A dataset and the places of its episodes; no frame is read.

    Raises:
        FleetError: It is none that can be read, or its metadata contradict each other.
    """
    info = json_of(root / "meta" / "info.json")
    version = info.get("codebase_version")
    if version not in VERSIONS:
        raise FleetError(
            f"{root}: it is of version {version!r}; versions {', '.join(VERSIONS)} are "
            "read: convert it with LeRobot"
        )
    fps = info.get("fps")
    if not isinstance(fps, int | float) or not 0.0 < float(fps) < MOST_RATE:
        raise FleetError(f"{root}: fps is {fps!r} in info.json; it must be > 0")
    features = info.get("features")
    if not isinstance(features, dict) or STATE not in features:
        raise FleetError(f"{root}: info.json lists no feature '{STATE}'")
    state = names_of(root, features, STATE)
    action = names_of(root, features, ACTION) if ACTION in features else ()
    old = version != "v3.0"
    episodes = tuple(listed(root, info) if old else tabled(root, info))
    check_totals(root, info, episodes)
    return Dataset(root, version, float(fps), state, action, episodes)


def json_of(path: Path) -> dict[str, Any]:
    """A JSON object of a file.

    Raises:
        FleetError: There is none in it.
    """
    try:
        check_file(path, LARGEST)
        found = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise FleetError(
            f"'{path}' cannot be read: {error.strerror or error}"
        ) from None
    except (ValueError, RecursionError) as error:
        raise FleetError(f"{path}: it is no JSON: {error}") from None
    if not isinstance(found, dict):
        raise FleetError(f"{path}: it is no mapping")
    return found


def names_of(root: Path, features: dict[str, Any], feature: str) -> tuple[str, ...]:
    """Name of each column of a feature: a list, or lists by group; else numbers.

    Raises:
        FleetError: The names or the shape are none.
    """
    one = features[feature]
    shape = one.get("shape") if isinstance(one, dict) else None
    if (
        not isinstance(shape, list)
        or len(shape) != 1
        or type(shape[0]) is not int
        or not 1 <= shape[0] <= MOST_COLUMNS
    ):
        raise FleetError(
            f"{root}: feature '{feature}' has shape {shape!r} in info.json; it must be "
            "one count of joints"
        )
    names = one.get("names")
    if isinstance(names, dict):
        groups = [group for group in names.values() if isinstance(group, list)]
        names = [name for group in groups for name in group]
    if names is None:
        names = [f"{feature}[{k}]" for k in range(shape[0])]
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise FleetError(
            f"{root}: the names of feature '{feature}' are no list of names"
        )
    if len(names) != shape[0] or len(set(names)) != len(names):
        raise FleetError(
            f"{root}: feature '{feature}' has {shape[0]} columns and the names "
            f"{', '.join(names)}; each needs its own name"
        )
    return tuple(names)


def path_of(root: Path, info: dict[str, Any], values: dict[str, int]) -> str:
    """The file of an episode by the pattern in `info.json`.

    Raises:
        FleetError: The pattern leads out of the dataset, or has other places.
    """
    pattern = info.get("data_path")
    if not isinstance(pattern, str):
        raise FleetError(f"{root}: info.json has no data_path")
    names = {name for name, _ in PLACE.findall(pattern)}
    rest = PLACE.sub("", pattern)
    if names - set(values) or re.search(r"[{}]|\.\.|^/", rest):
        raise FleetError(
            f"{root}: data_path is '{pattern}' in info.json; it must lead into the "
            f"dataset by {', '.join(values)}"
        )
    return PLACE.sub(lambda m: f"{values[m[1]]:0{m[2]}d}", pattern)


def listed(root: Path, info: dict[str, Any]) -> Iterator[Episode]:
    """Episodes of a dataset with a file for each."""
    path, size = root / "meta" / "episodes.jsonl", info.get("chunks_size", 1000)
    if type(size) is not int or size < 1:
        raise FleetError(f"{root}: chunks_size is {size!r} in info.json")
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise FleetError(
            f"'{path}' cannot be read: {error.strerror or error}"
        ) from None
    for row, line in enumerate(filter(str.strip, lines), 1):
        try:
            one = json.loads(line)
            number, frames = int(one["episode_index"]), int(one["length"])
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            raise FleetError(
                f"{path}, line {row}: an episode needs episode_index and length "
                f"({type(error).__name__}: {error})"
            ) from None
        places = {"episode_chunk": number // size, "episode_index": number}
        yield Episode(number, path_of(root, info, places), frames)


def tabled(root: Path, info: dict[str, Any]) -> Iterator[Episode]:
    """Episodes of a dataset with many in a file."""
    files = sorted((root / "meta" / "episodes").glob("*/*.parquet"))
    if not files:
        raise FleetError(f"{root}: there is no meta/episodes/*/*.parquet")
    places = "data/chunk_index", "data/file_index"
    names = ["episode_index", "length", *(quoted(one) for one in places)]
    try:
        rows = np.column_stack(columns_of(files, names)).astype(np.int64).tolist()
    except ParquetError as error:
        raise FleetError(f"{root}: {error}") from None
    for number, frames, chunk, file in sorted(rows):
        found = path_of(root, info, {"chunk_index": chunk, "file_index": file})
        yield Episode(number, found, frames)


def check_totals(root: Path, info: dict[str, Any], episodes: Sequence[Episode]) -> None:
    """Refuse metadata that contradict each other.

    Raises:
        FleetError: They do.
    """
    numbers = [one.number for one in episodes]
    if sorted(set(numbers)) != numbers:
        raise FleetError(f"{root}: an episode is listed twice, or not in order")
    for one in episodes:
        if one.frames < 1:
            raise FleetError(f"{root}: episode {one.number} has {one.frames} frames")
    frames = sum(one.frames for one in episodes)
    for what, count in (("episodes", len(episodes)), ("frames", frames)):
        said = info.get(f"total_{what}")
        if said != count:
            raise FleetError(
                f"{root}: info.json says {said} {what}, but meta lists {count}; "
                "correct info.json, or copy the dataset again"
            )
