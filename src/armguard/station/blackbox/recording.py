"""Recordings as they are read back: frames in order, and the scene they are about."""

import mmap
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.guard import layout
from armguard.scene.archive import scene_of
from armguard.scene.scene import Scene
from armguard.station.blackbox.blocks import unpack_block
from armguard.station.blackbox.plausible import (
    MOST_ATTACHED,
    about_of,
    plausible_frame,
)
from armguard.station.blackbox.recovery import attachment, chunks, messages, span_of
from armguard.station.blackbox.ros import FRAMES, Stored
from armguard.station.errors import RecordingError
from armguard.station.frames import Frame, Kind

Floats = NDArray[np.float64]

# The layout of recordings that do not name one.
FIRST_LAYOUT = 1

# Names of what is attached to a recording.
SCENE, ABOUT = "armguard scene", "armguard about"


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
        groups: list[tuple[str, list[Path]]] = []
        for path in self.paths:
            scene = str(Recording([path]).info.get("archive", ""))
            if groups and groups[-1][0] == scene:
                groups[-1][1].append(path)
            else:
                groups.append((scene, [path]))
        if len(groups) == 1:
            return [self]
        return [Recording(paths) for _, paths in groups]

    def scene(self) -> Scene:
        """The scene it was made in, from what the recording holds.

        Raises:
            RecordingError: It holds none, or a damaged one.
            ArchiveError: It was made by a version whose scenes this one cannot read.
        """
        archive = self._attached(SCENE)
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
        """Frames as rows, see `armguard.station.frames`."""
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
        armguard.station.errors.RecordingError: nowhere.mcap: no such file or folder
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
    if numbers[layout.NEAR_COUNT] > 0:
        return frame
    return replace(frame, verdict=numbers[: -layout.NEAR_WIDTH])
