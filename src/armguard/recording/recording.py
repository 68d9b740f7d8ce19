"""Recordings as they are read back: frames in order, and the scene they are about.

A recording is untrusted input. Sizes are checked before memory is allocated. A frame
with impossible contents is left out, as a damaged one is; any other error becomes one
sentence.
"""

import json
import mmap
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import MCAP0_MAGIC as MAGIC
from numpy.typing import NDArray

from armguard.errors import ArmguardError, RecordingError
from armguard.guard import layout
from armguard.guard.layout import IN_HEADER
from armguard.recording.blocks import unpack_block
from armguard.recording.frames import Form, Frame, Kind, frame_of
from armguard.recording.mcap_file import attachment, chunks, messages, span_of
from armguard.recording.ros import FRAMES, Stored
from armguard.scene.archive import scene_of
from armguard.scene.scene import Scene

Floats = NDArray[np.float64]

# Bytes of an attachment; a larger one is none of ours.
MOST_ATTACHED = 64 << 20

# Latest time of a clock [s]: a few hundred years.
LATEST = 1e10

# Cycles are counted exactly up to here.
MOST_CYCLES = 1 << 53

# Joints and robots of a scene.
MOST_NAMES = 4096

# Places of an answer that hold whole numbers.
WHOLE_PLACES = (
    IN_HEADER.reason,
    IN_HEADER.joint,
    IN_HEADER.robot,
    IN_HEADER.nearest,
    IN_HEADER.near_count,
)

# The layout of recordings that do not name one.
FIRST_LAYOUT = 1

# Names of what is attached to a recording.
SCENE, ABOUT = "armguard scene", "armguard about"


@contextmanager
def reading(what: object) -> Iterator[None]:
    """Turn any error of reading a recording of that name into one sentence.

    Raises:
        RecordingError: Something in it is not what it should be.
    """
    try:
        yield
    except ArmguardError:
        raise
    except Exception as error:  # the bytes may be anything
        raise RecordingError(
            f"{what}: something in it is not what a recording holds "
            f"({type(error).__name__}: {error})"
        ) from error


class Recording:
    """One recording, or all of a folder one after another.

    Damaged parts are left out and named in `problems`, which is complete when all
    frames were read once.

    Attributes:
        paths: Its files, oldest first.
        info: Its metadata: version, names, period, settings.
        problems: Missing or damaged parts, in words.

    Args:
        paths: Its files, oldest first.

    Raises:
        RecordingError: A file cannot be opened, is empty, has metadata that no recorder
            writes, or verdicts of another layout.
    """

    info: dict[str, Any]

    def __init__(self, paths: list[Path]) -> None:
        self.paths = paths
        self.problems: list[str] = []
        self._data = [mapped(path) for path in paths]
        about = self._attached(ABOUT)
        try:
            self.info = {} if about is None else about_of(about)
        except ValueError as error:
            raise RecordingError(
                f"{paths[0]}: what this recording is about cannot be read: {error}"
            ) from None
        if self.info:
            check_layout(paths[0], self.info)
        if about is None:
            self.note("what the recording is about is damaged, or was never written")

    @property
    def names(self) -> tuple[str, ...]:
        """'robot/joint' of each place of q."""
        return tuple(self.info.get("names", ()))

    @property
    def robots(self) -> tuple[str, ...]:
        """Names of the robots."""
        return tuple(self.info.get("robots", ()))

    @property
    def has_scene(self) -> bool:
        """Whether the scene is in it, whole."""
        return self._attached(SCENE) is not None

    @property
    def cycle_count(self) -> int:
        """About how many cycles it holds, by its times; 0 if that is not known."""
        period = float(self.info.get("period") or 0.0)
        times = [time for data in self._data for time in span_of(data)]
        if not times or not period:
            return 0
        return int((max(times) - min(times)) * 1e-9 / period)

    def parts(self) -> "list[Recording]":
        """Recordings of one scene each: this one, where nothing was changed in it.

        A service whose settings are changed goes on in another scene.
        """
        scenes = groupby(self.paths, lambda p: Recording([p]).info.get("archive", ""))
        groups = [list(paths) for _, paths in scenes]
        return [self] if len(groups) == 1 else list(map(Recording, groups))

    def scene(self) -> Scene:
        """The scene it was made in, from what the recording holds.

        Raises:
            RecordingError: It holds none, or a damaged one.
            ArchiveError: It was made by a version whose scenes this one cannot read.
        """
        archive = self._attached(SCENE)
        if archive is None and all(d[: len(MAGIC)] != MAGIC for d in self._data):
            raise RecordingError(
                f"{self.paths[0]}: this is no MCAP file, or its first bytes are "
                "damaged; give a file that `armguard serve --record FOLDER` wrote"
            )
        if archive is None:
            raise RecordingError(
                f"{self.paths[0]}: the scene is not in this recording, or it is "
                "damaged; so nothing of it can be judged again"
            )
        return scene_of(archive)

    def frames(self) -> Iterator[Frame]:
        """Cycles, events, checkpoints and notes, in order.

        Of most cycles `verdict` holds the nearest pair only and `poses` nothing; all
        of them have in `data` the digest of the whole answer, see `blocks`.
        """
        last = -1
        for row in self.rows():
            try:
                frame = trimmed(plausible_frame(row, len(self.names), len(self.robots)))
            except ValueError as error:
                self.note(f"a frame cannot be read: {error}")
                continue
            if frame.kind is Kind.CYCLE:
                if last >= 0 and frame.cycle > last + 1:
                    self.note(f"cycles {last + 1} to {frame.cycle - 1} are missing")
                last = frame.cycle
            elif frame.kind is Kind.NOTE and frame.text.get("note") == "recorder":
                self.note(str(frame.text.get("problem")))
            yield frame

    def rows(self) -> Iterator[Floats]:
        """Frames as rows, see `armguard.recording.frames`."""
        for message in self.messages():
            if message.topic == FRAMES.number:
                try:
                    yield from unpack_block(message.data)
                except ValueError as error:
                    self.note(str(error))

    def messages(self) -> Iterator[Stored]:
        """Messages of all channels, in the order in which they were written."""
        for path, data in zip(self.paths, self._data, strict=True):
            found: list[str] = []
            for inner in chunks(data, found):
                yield from messages(inner)
            for problem in found:
                self.note(f"{path.name}: {problem}" if len(self.paths) > 1 else problem)

    def note(self, problem: str) -> None:
        """Add what is wrong, once."""
        if problem not in self.problems:
            self.problems.append(problem)

    def _attached(self, name: str) -> bytes | None:
        """What is attached to the first file that still has it whole."""
        found = (attachment(data, name) for data in self._data)
        whole = next((data for data in found if data is not None), None)
        if whole is not None and len(whole) > MOST_ATTACHED:
            raise RecordingError(
                f"{self.paths[0]}: '{name}' has {len(whole):,} bytes; no recording "
                f"attaches more than {MOST_ATTACHED:,}"
            )
        return whole


def check_layout(path: Path, info: dict[str, Any]) -> None:
    """Check the layout of verdicts in a file's metadata; the first one if not named.

    Raises:
        RecordingError: It is not the layout that this version reads.
    """
    made = info.get("layout", FIRST_LAYOUT)
    if made != layout.LAYOUT:
        raise RecordingError(
            f"{path}: its verdicts have layout {made!r}, this version of armguard "
            f"reads layout {layout.LAYOUT}; read it with the version that recorded it, "
            f"{info.get('recorder', 'which is not known')}"
        )


def open_recording(path: str | Path) -> Recording:
    """A recording: an MCAP file of the recorder, or a folder of them.

    Raises:
        RecordingError: There is none.

    Example:
        >>> open_recording("nowhere.mcap")
        Traceback (most recent call last):
        armguard.errors.RecordingError: nowhere.mcap: no such file or folder
    """
    place = Path(path)
    if place.is_dir():
        found = sorted(place.glob("recording-*.mcap"))
        if not found:
            text = f"{place}: there is no recording-*.mcap in this folder"
            raise RecordingError(text)
        return Recording(found)
    if not place.exists():
        raise RecordingError(f"{place}: no such file or folder")
    return Recording([place])


def mapped(path: Path) -> mmap.mmap:
    """A file's bytes.

    Raises:
        RecordingError: It cannot be opened, or is empty.
    """
    try:
        with path.open("rb") as file:
            return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except (OSError, ValueError) as error:
        raise RecordingError(f"{path}: nothing can be read: {error}") from error


def trimmed(frame: Frame) -> Frame:
    """A frame whose verdict ends with its last near pair."""
    numbers = frame.verdict
    if frame.kind is not Kind.CYCLE or frame.poses.size or len(numbers) == 0:
        return frame
    if numbers[IN_HEADER.near_count] > 0:
        return frame
    return replace(frame, verdict=numbers[: -layout.NEAR_WIDTH])


def about_of(text: bytes) -> dict[str, Any]:
    """The metadata of a recording.

    Raises:
        ValueError: They are not as a recorder writes them.
    """
    try:
        about = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"it is no JSON: {error}") from error
    if not isinstance(about, dict):
        raise ValueError("it is no mapping")
    for key in ("names", "robots"):
        names = about.get(key, [])
        if not are_names(names) or len(names) > MOST_NAMES:
            raise ValueError(f"'{key}' are no names")
    period, budget = about.get("period", 1.0), about.get("budget", 1)
    if type(period) not in (int, float) or not 0.0 <= period <= LATEST:
        raise ValueError(f"'period' is {period!r}")
    if type(budget) is not int or not 1 <= budget <= MOST_CYCLES:
        raise ValueError(f"'budget' is {budget!r}")
    return about


def are_names(found: object) -> bool:
    """Whether a value is a list of strings."""
    return isinstance(found, list) and all(isinstance(name, str) for name in found)


def plausible_frame(row: Floats, joints: int, robots: int) -> Frame:
    """The frame of a row; numbers of joints and robots are 0 if they are not known.

    Raises:
        ValueError: The row is none, or its contents are impossible.
    """
    try:
        frame = frame_of(row)
    except (OverflowError, RecursionError) as error:
        raise ValueError(str(error)) from error
    if not isinstance(frame.text, dict):
        raise ValueError("its text is no mapping")
    for name in ("monotonic", "wall"):
        if not abs(getattr(frame, name)) <= LATEST:
            raise ValueError(f"its {name} clock says {getattr(frame, name)} s")
    if not 0 <= frame.cycle <= MOST_CYCLES:
        raise ValueError(f"it is of cycle {frame.cycle}")
    if frame.kind is Kind.CYCLE:
        check_cycle(frame, joints or len(frame.q), robots or len(frame.stamps))
    return frame


def check_cycle(frame: Frame, joints: int, robots: int) -> None:
    """Check the frame of a cycle.

    Raises:
        ValueError: Its contents are impossible.
    """
    asked = joints
    if frame.form is Form.TWISTS:
        tools = frame.text.get("tools", [])
        if not are_names(tools):
            raise ValueError("its tools are no names")
        asked = 6 * len(tools)
    elif frame.form is Form.STOP:
        asked = 1
    counts = (len(frame.q), len(frame.stamps), len(frame.asked), len(frame.told))
    wanted = (joints, robots, asked, 4 * joints + 4 * robots)
    steps = frame.form is Form.STEP
    for k, (count, right) in enumerate(zip(counts, wanted, strict=True)):
        if count != right and not (steps and k >= 2 and not count):
            raise ValueError(f"it has {count} numbers where {right} belong")
    times = frame.received, frame.ended, frame.cycle_time
    if any(abs(time) > LATEST for time in times):
        raise ValueError(f"its times are {times} s")
    answer = frame.verdict
    if len(answer) < layout.HEADER:
        raise ValueError(f"its answer has {len(answer)} numbers")
    numbers = answer[list(WHOLE_PLACES)]
    if not (np.abs(numbers) <= MOST_CYCLES).all() or (numbers % 1.0).any():
        raise ValueError("its answer counts in parts")
