"""Inputs of a job: datasets, recordings, plans and random motions, one by one."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from armguard.errors import StationError
from armguard.fleet.job import FleetError
from armguard.fleet.lerobot import Dataset, is_dataset, open_dataset
from armguard.recording.motions import SUFFIXES
from armguard.scene.trajectory_file import READERS

DATASET, RECORDING, PLAN, RANDOM = "dataset", "recording", "plan", "random motion"

# Random motions by their seeds, as in random:7 or random:0-999, and the most of them.
SEEDS = re.compile(r"random:(\d{1,9})(?:-(\d{1,9}))?")
MOST_SEEDS = 10_000_000

# Files of plans: what `Plan.read` reads.
OF_PLANS = (*READERS, ".npy")

# Bytes of a row of a plan, about: from the size of its file follows how long it takes.
ROW_BYTES = 100


@dataclass(frozen=True, slots=True)
class Input:
    """One input.

    Attributes:
        source: Its path, relative to the job; "random" for a random motion.
        kind: DATASET, RECORDING, PLAN or RANDOM.
        episode: Its number in a dataset, or its seed; -1 of others.
        frames: Its count of frames; of recordings and plans about that, of random
            motions 0.
        size: Bytes of its file.
        changed: When the file was changed [ns since 1970].
    """

    source: str
    kind: str
    episode: int
    frames: int
    size: int
    changed: int

    @property
    def name(self) -> str:
        """Its name for people."""
        episode = f", episode {self.episode}" if self.episode >= 0 else ""
        return f"{self.source}{episode}"

    def row(self) -> list[Any]:
        """The same as a list, ready for JSON."""
        return [getattr(self, name) for name in self.__slots__]


def inputs_of(given: Sequence[str], folder: Path) -> list[Input]:
    """All inputs of a job, in the order of the job, of paths, and of episodes.

    Args:
        given: Paths and patterns, relative to the folder, and seeds, see `SEEDS`.
        folder: The job's folder.

    Raises:
        FleetError: A path leads nowhere, a dataset contradicts itself, or an input is
            given twice.
        RecordingError: A recording cannot be read.
    """
    found: list[Input] = []
    for one in given:
        if one.partition(":")[0] == "random":
            found += random_motions(one)
            continue
        paths = sorted(folder.glob(one)) if any(c in one for c in "*?[") else []
        paths = paths or [folder / one]
        found += [item for path in paths for item in below(path, folder)]
    seen: set[tuple[str, int]] = set()
    for item in found:
        if (item.source, item.episode) in seen:
            raise FleetError(f"{item.name}: it is given twice; delete one of both")
        seen.add((item.source, item.episode))
    return found


def random_motions(given: str) -> Iterator[Input]:
    """The random motions of a range of seeds.

    Raises:
        FleetError: It is no range of seeds, an empty one, or one of too many.
    """
    seeds = SEEDS.fullmatch(given)
    if seeds is None:
        raise FleetError(
            f"'{given}' names no seeds; write random:SEED or random:FIRST-LAST with "
            "whole numbers from 0 on, as in random:0-999"
        )
    first, last = int(seeds[1]), int(seeds[2] or seeds[1])
    if last < first:
        raise FleetError(
            f"'{given}' has no episode; write the smaller seed first, as in "
            f"random:{last}-{first}"
        )
    if last - first >= MOST_SEEDS:
        raise FleetError(
            f"'{given}' has {last - first + 1:,} episodes; divide it into jobs of at "
            f"most {MOST_SEEDS:,}"
        )
    for seed in range(first, last + 1):
        yield Input("random", RANDOM, seed, 0, 0, 0)


def below(path: Path, folder: Path) -> Iterator[Input]:
    """The inputs of a path: it is one, or a folder of some."""
    if not path.exists():
        raise FleetError(
            f"'{path}': there is no such file or folder; an input is a path, or "
            "random:FIRST-LAST for random motions"
        )
    own = kind_of(path)
    if own is not None:
        yield from items_of(path, own, folder)
        return
    if not path.is_dir():
        raise FleetError(
            f"'{path}' is no input; an input is a LeRobot dataset, a recording, or a "
            f"plan that ends in {', '.join(OF_PLANS)}"
        )
    count = 0
    for inner in sorted(path.iterdir()):
        kind = kind_of(inner)
        if kind is not None:
            count += 1
            yield from items_of(inner, kind, folder)
    if not count:
        raise FleetError(
            f"'{path}': there is no LeRobot dataset, recording or plan in this folder"
        )


def kind_of(path: Path) -> str | None:
    """Which kind of input a path is; None if it is none."""
    if path.is_dir():
        if is_dataset(path):
            return DATASET
        found = any(path.glob("recording-*.mcap")) or (path / "metadata.yaml").is_file()
        return RECORDING if found else None
    ending = path.suffix.lower()
    if ending in SUFFIXES:
        return RECORDING
    return PLAN if ending in OF_PLANS else None


def items_of(path: Path, kind: str, folder: Path) -> Iterator[Input]:
    """The inputs of one dataset, recording or plan."""
    source = str(path.relative_to(folder)) if path.is_relative_to(folder) else str(path)
    if kind == DATASET:
        yield from episodes_of(open_dataset(path), source)
        return
    files = [path] if path.is_file() else sorted(path.iterdir())
    states = [file.stat() for file in files]
    size = sum(state.st_size for state in states)
    changed = max(state.st_mtime_ns for state in states)
    frames = size // ROW_BYTES
    if kind == RECORDING:
        frames = cycles_of(path) or frames
    yield Input(source, kind, -1, max(frames, 1), size, changed)


def episodes_of(dataset: Dataset, source: str) -> Iterator[Input]:
    """The episodes of a dataset."""
    states: dict[str, tuple[int, int]] = {}
    for one in dataset.episodes:
        if one.file not in states:
            try:
                state = (dataset.root / one.file).stat()
                states[one.file] = state.st_size, state.st_mtime_ns
            except OSError:
                # Its episodes get an error each, and the others are judged.
                states[one.file] = 0, 0
        yield Input(source, DATASET, one.number, one.frames, *states[one.file])


def cycles_of(path: Path) -> int:
    """About how many cycles a recording of ours holds; 0 if that is not known."""
    try:
        from armguard.recording import open_recording

        return open_recording(path).cycle_count
    except (ImportError, StationError):
        return 0
