"""Frames of inputs in the order of a scene's joints."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import radians
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from armguard.batch.room import LARGEST_ANGLE
from armguard.errors import ArmguardError
from armguard.fleet.inputs import DATASET, Input
from armguard.fleet.job import FleetError, JobModel, JointEntry
from armguard.fleet.lerobot import Dataset, Episode, open_dataset
from armguard.plans.plan import read_rows
from armguard.recording.motions import load_motion
from armguard.scene import Scene, Trajectory

Floats = NDArray[np.float64]

# Greatest position [rad or m]; the kernels judge none that is ten times as large.
LARGEST = LARGEST_ANGLE / 10.0

# Frames that are read at once.
MOST_FRAMES = 100_000

# The dataset of the last input stays open.
opened: Callable[[Path], Dataset] = lru_cache(maxsize=2)(open_dataset)


@dataclass(frozen=True)
class Frames:
    """Frames of several inputs, one after another.

    Attributes:
        inputs: The inputs.
        first: Where each begins, and the end of the last, shape (e + 1,).
        q: Joint positions, shape (n, joints) [rad or m].
        leader: Requested ones, NaN where there are none, of that shape; None if no
            joint has any.
        times: Times from the start of each, shape (n,) [s].
        timed: Whether they are known; else they are numbers of frames.
        late: How far times of the file are off the declared rate, shape (e,) [s].
        notes: What its reader had to decide, each a sentence.
    """

    inputs: Sequence[Input]
    first: NDArray[np.intp]
    q: Floats
    leader: Floats | None
    times: Floats
    timed: bool
    late: Floats
    notes: tuple[str, ...] = ()

    @cached_property
    def finite(self) -> NDArray[np.bool_]:
        """Whether each frame holds numbers that can be positions, shape (n,)."""
        return finite_rows(self.q)


def frames_of(
    inputs: Sequence[Input], job: JobModel, folder: Path, scene: Scene
) -> Iterator[Frames | tuple[Input, str]]:
    """Frames of inputs, as many at once as fit; an error of one is its sentence.

    Args:
        inputs: Inputs in the order of the job.
        job: The job.
        folder: Its folder.
        scene: The scene.
    """
    for together in batches(inputs):
        try:
            yield read(together, job, folder, scene)
        except ArmguardError as error:
            if len(together) == 1:
                yield together[0], str(error)
                continue
            for one in together:
                yield from frames_of([one], job, folder, scene)


def batches(inputs: Sequence[Input]) -> Iterator[list[Input]]:
    """Inputs that are read at once: episodes of one dataset that follow each other."""
    batch: list[Input] = []
    frames = 0
    for one in inputs:
        joins = bool(batch) and (one.kind, one.source) == (DATASET, batch[0].source)
        if batch and (not joins or frames + one.frames > MOST_FRAMES):
            yield batch
            batch, frames = [], 0
        batch.append(one)
        frames += one.frames
    if batch:
        yield batch


def read(inputs: list[Input], job: JobModel, folder: Path, scene: Scene) -> Frames:
    """Frames of one batch.

    Raises:
        ArmguardError: A file is damaged, or its joints are not those of the scene.
    """
    path = folder / inputs[0].source
    if inputs[0].kind == DATASET:
        return read_dataset(inputs, opened(path), job, scene)
    motion = read_rows(path, scene) if path.suffix == ".npy" else load_motion(path)
    if motion.ends_only:
        raise FleetError(f"{motion.source}: a request has no way between its ends")
    fill = home_of(scene) if job.hold_home else None
    q = motion.for_scene(scene, fill)
    times = motion.stamps
    if times is None:
        times = np.arange(len(q), dtype=np.float64)
    return Frames(
        inputs=inputs,
        first=np.array([0, len(q)]),
        q=q,
        leader=None,
        times=times - times[0],
        timed=motion.stamps is not None,
        late=np.zeros(1),
        notes=motion.notes,
    )


def read_dataset(
    inputs: list[Input], dataset: Dataset, job: JobModel, scene: Scene
) -> Frames:
    """Frames of episodes of one dataset."""
    by_number = {one.number: one for one in dataset.episodes}
    episodes: list[Episode] = [by_number[one.episode] for one in inputs]
    rows = dataset.read(episodes)
    counts = np.diff(rows.first)
    number = np.arange(len(rows.stamps)) - np.repeat(rows.first[:-1], counts)
    times = number / dataset.fps
    off = np.abs(rows.stamps - np.repeat(rows.stamps[rows.first[:-1]], counts) - times)
    source = dataset.root.name
    fill = home_of(scene) if job.hold_home else None
    q = columns(dataset.state, rows.state, job, source).for_scene(scene, fill)
    leader = None
    if rows.action is not None:
        nothing = dict.fromkeys(scene.q_names, np.nan)
        requested = columns(dataset.action, rows.action, job, source)
        leader = requested.for_scene(scene, nothing)
    return Frames(
        inputs=inputs,
        first=rows.first,
        q=q,
        leader=leader,
        times=times,
        timed=True,
        late=np.maximum.reduceat(off, rows.first[:-1]),
    )


def columns(
    names: Sequence[str], numbers: Sequence[Floats], job: JobModel, source: str
) -> Trajectory:
    """Columns of a dataset with the names and units of joints."""
    unknown = [name for name in job.joints if name not in names]
    if unknown and len(unknown) == len(job.joints):
        raise FleetError(
            f"{source}: the job's joints name no column of it; its columns are "
            f"{', '.join(names)}"
        )
    unit = radians(1.0) if job.units == "degrees" else 1.0
    kept, found = [], []
    for k, name in enumerate(names):
        entry = job.joints.get(name, name.removesuffix(".pos"))
        if entry is None:
            continue
        if isinstance(entry, str):
            entry = JointEntry(joint=entry)
        scale = unit if entry.scale is None else entry.scale
        kept.append(entry.joint)
        as_is = (scale, entry.zero) == (1.0, 0.0)
        found.append(numbers[k] if as_is else scale * numbers[k] + entry.zero)
    if not found:
        raise FleetError(f"{source}: the job leaves out all columns")
    return Trajectory(tuple(kept), np.column_stack(found), None, source)


def finite_rows(q: Floats) -> NDArray[np.bool_]:
    """Whether each row holds numbers that can be positions, shape (n,)."""
    return np.asarray((np.abs(q) < LARGEST).all(axis=1), dtype=np.bool_)


def home_of(scene: Scene) -> dict[str, float]:
    """Position of each joint at home, by name [rad or m]."""
    return dict(zip(scene.q_names, scene.home.tolist(), strict=True))
