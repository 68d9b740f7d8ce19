"""The recorder: reads the ring, writes recordings, keeps near misses apart."""

import json
import logging
import platform
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.guard import layout
from armguard.recording import frames, ros
from armguard.recording.blocks import (
    MOST_BYTES,
    MOST_FRAMES,
    kept_cycle,
    pack_block,
)
from armguard.recording.disk import Budget, Disk, DiskFile
from armguard.recording.frames import Kind, frame_of, text_frame
from armguard.recording.mcap_file import McapFile
from armguard.recording.messages import (
    MessageMaker,
    Summary,
    maker_of,
    nameless,
)
from armguard.recording.near_misses import Before, Trigger
from armguard.recording.recording import ABOUT, SCENE
from armguard.recording.ring import RingReader, beat, end_pulse
from armguard.recording.ros import Stored

Floats = NDArray[np.float64]

log = logging.getLogger("armguard.blackbox")

RECORDINGS = "recording-*.mcap"
NEAR_MISSES = "near-miss-*.mcap"

VERSION = version("armguard")

# What is read is handed to the disk so often [s].
FLUSH = 0.5

# A cycle is kept with all its pairs and poses so often, and with every level [s].
WHOLE_EVERY = 1.0 / 30.0

# Where nothing is to be read: until the ring is looked at again [s].
NAP = 0.004

# At the end the disk is waited for so long [s].
PATIENCE = 10.0

# A new recording begins with the next checkpoint; without one, at this much more than
# it may have.
WITHOUT = 1.5

# What every recording begins with is written twice: a wrong bit must not cost all.
COPIES = 2

SCENE_KIND = "application/vnd.armguard.scene"


@dataclass(frozen=True, slots=True, kw_only=True)
class RecorderSettings:
    """How much is kept."""

    keep: int = 20 << 30  # bytes of all recordings together, near misses apart
    keep_near: int = 200  # files of near misses
    keep_near_size: int = 4 << 30  # bytes of all near misses together
    file_size: int = 1 << 30  # bytes after which another recording begins
    file_time: float = 3600.0  # time after which another one begins [s]
    before: float = 30.0  # time that is kept before a near miss [s]
    after: float = 5.0  # and after it [s]
    longest: float = 120.0  # after which a file of near misses ends in any case [s]
    headroom: float = 0.0  # see `Trigger` [m]
    time_left: float = 0.0  # see `Trigger` [s]


class Writing(McapFile):
    """A recording that is being written.

    Args:
        disk: Disk of the file.
        path: Path of the file.
        began: When, on the clock of frames [s].
        about: Its metadata.
        scene: Archive of the scene; empty if there is none.
        wall: When it began, on the wall clock [ns].
    """

    def __init__(
        self,
        disk: Disk,
        path: Path,
        began: float,
        about: Mapping[str, Any],
        scene: bytes,
        wall: int,
    ) -> None:
        self.disk, self.file, self.began = disk, DiskFile(path), began
        put = partial(disk.put, self.file)
        super().__init__(put, f"armguard {VERSION}", {"armguard": about})
        text = json.dumps(about).encode()
        for _ in range(COPIES):
            self.attach(ABOUT, "application/json", text, wall)
            if scene:
                self.attach(SCENE, SCENE_KIND, scene, wall)

    def end(self) -> None:
        """Write the last bytes."""
        super().end()
        self.give_up()

    def give_up(self) -> None:
        """Close the file as it is."""
        self.disk.close(self.file)


class Recorder:
    """Takes frames in order and writes them into files of a folder.

    Attributes:
        cycles: Cycles taken.
        near_misses: Files of near misses begun.
    """

    def __init__(self, folder: Path, settings: RecorderSettings) -> None:
        self.folder, self.settings = folder, settings
        self.disk = Disk(
            folder,
            Budget(RECORDINGS, settings.keep),
            Budget(NEAR_MISSES, settings.keep_near_size, settings.keep_near),
        )
        self.cycles = 0
        self.near_misses = 0
        self._about: dict[str, Any] = {}
        self._scene = b""
        self._maker: MessageMaker | None = None
        self._main: Writing | None = None
        self._apart: Writing | None = None
        self._apart_until = -np.inf
        # Until when everything is in a file of near misses.
        self._apart_to = -np.inf
        self._before = Before(settings.before)
        self._trigger = Trigger(settings.headroom, settings.time_left)
        self._rows: list[Floats] = []
        self._checkpoint = False
        self._levels: tuple[int, ...] = ()
        self._whole_at = -np.inf
        self._now, self._time = 0.0, 0
        self._offset: float | None = None
        self._unnoted: list[str] = []

    def run(self, ring: RingReader, ends: Callable[[], bool]) -> None:
        """Record until the ring is closed, or `ends` says so."""
        flushed, lost = time.monotonic(), 0
        while True:
            # Asked before the ring is read: what came before is still written.
            last = ring.closed or ends()
            for row in ring.unread():
                if ring.lost != lost:
                    missing, lost = ring.lost - lost, ring.lost
                    self.note(f"{missing} records were lost: the recorder was too slow")
                self.take(row)
            if time.monotonic() - flushed >= FLUSH:
                flushed = time.monotonic()
                self.flush()
                if not self.disk.problem:
                    beat(ring.path)
            if last:
                self.end()
                end_pulse(ring.path)
                return
            time.sleep(NAP)

    def take(self, row: Floats) -> None:
        """Take the next frame."""
        self._set_clock(row)
        kind = int(row[frames.IN_FRAME.kind])
        if kind == Kind.CYCLE:
            self._take_cycle(row)
            return
        frame = frame_of(row)
        if kind == Kind.NOTE and frame.text.get("note") == "scene":
            self._take_scene(frame.text, frame.data)
            return
        if kind == Kind.CHECKPOINT:
            self._rotate()
        self._open()
        self._close_block()
        self._checkpoint = kind == Kind.CHECKPOINT
        self._rows.append(row)
        self._close_block()
        if kind == Kind.EVENT:
            call = {k: v for k, v in frame.text.items() if v is not None}
            self._store(ros.log(self._time, ros.INFO, json.dumps(call)))

    def note(self, problem: str) -> None:
        """Write down that something of the recording is missing, and log it."""
        log.warning("%s", problem)
        if self._main is None:
            self._unnoted.append(problem)
            return
        note = {"note": "recorder", "problem": problem}
        wall = (self._offset or 0.0) + self._now
        self._close_block()
        self._rows.append(text_frame(Kind.NOTE, 0, self._now, wall, note))
        self._close_block()
        self._store(ros.log(self._time, ros.WARN, problem))

    def flush(self) -> None:
        """Hand all that was taken to the disk."""
        self._close_block()
        if self._apart is not None and self._now > self._apart_until:
            self._end_apart()
        for writing in self._files:
            writing.flush()
        if self._main is not None and self._main.file.given_up:
            # It has a hole: another one begins with the next frame.
            self._main.give_up()
            self._main = None
            why = self.disk.problem or "the disk was too slow"
            self.note(f"earlier frames are missing: {why}")
        if self._apart is not None and self._apart.file.given_up:
            self._apart.give_up()
            self._apart = None

    def end(self) -> None:
        """Write all that is left, and the ends of files."""
        self._end_files()
        if not self.disk.end(PATIENCE):
            log.warning(
                "%s: the end was not written: %s", self.folder, self.disk.problem
            )

    @property
    def _files(self) -> list[Writing]:
        """Recordings that are being written."""
        return [one for one in (self._main, self._apart) if one is not None]

    def _end_files(self) -> None:
        """Write all that was taken, and the ends of files."""
        self.flush()
        for writing in self._files:
            writing.end()
        self._main = self._apart = None

    def _take_cycle(self, row: Floats) -> None:
        """Take a cycle."""
        self._open()
        if self._maker is None:
            self._maker = nameless(row)
        summary = Summary(row, self._maker.first_row)
        due = self._now - self._whole_at >= WHOLE_EVERY
        whole = due or summary.levels != self._levels
        if whole:
            self._whole_at, self._levels = self._now, summary.levels
        kept = kept_cycle(row, self._maker.first_row, whole)
        if self._rows and len(self._rows[-1]) != len(kept):
            self._close_block()
        self._rows.append(kept)
        count = len(self._rows)
        if count >= MOST_FRAMES or 2 * count * kept.nbytes > MOST_BYTES:
            self._close_block()
        for message in self._maker.cycle(row, self._now, self._time):
            self._store(message)
        self.cycles += 1
        if what := self._trigger.look(self._now, summary):
            self._near_miss(what)

    def _near_miss(self, what: str) -> None:
        """Keep what was before apart, and what is to come."""
        self._close_block()
        self._store(ros.log(self._time, ros.WARN, f"near miss: {what}"))
        self._apart_until = self._now + self.settings.after
        apart = self._apart
        if apart is not None and self._now - apart.began < self.settings.longest:
            return
        self._end_apart()
        self.near_misses += 1
        self._apart = self._new("near-miss", {"near_miss": what})
        for message in self._before.messages(self._apart_to):
            self._apart.add(message)

    def _end_apart(self) -> None:
        """Write the end of the file of near misses, if there is one."""
        if self._apart is not None:
            self._apart.end()
            self._apart, self._apart_to = None, self._now

    def _take_scene(self, about: Mapping[str, Any], archive: bytes) -> None:
        """Take what the next cycles are about; another scene is another recording."""
        if self._about == about:
            return
        if self._main is not None:
            self._end_files()
            self._before = Before(self.settings.before)
            self._apart_to = -np.inf
        self._about, self._scene = dict(about), archive
        self._maker = maker_of(about, archive)

    def _rotate(self, more: float = 1.0) -> None:
        """End this recording if it has so much more than it may have."""
        if self._main is None:
            return
        size, age = self._main.size, self._now - self._main.began
        limits = self.settings
        if size >= more * limits.file_size or age >= more * limits.file_time:
            self._close_block()
            self._main.end()
            self._main = None

    def _open(self) -> None:
        """Begin a recording if there is none."""
        self._rotate(WITHOUT)
        if self._main is None and not (self.disk.problem and self.disk.waiting):
            self._main = self._new("recording", {})
            waiting, self._unnoted = self._unnoted, []
            for problem in waiting:
                self.note(problem)

    def _new(self, name: str, more: Mapping[str, str]) -> Writing:
        """A recording that begins now."""
        began = datetime.fromtimestamp(self._time * 1e-9, UTC)
        stem = f"{name}-{began:%Y%m%dT%H%M%S.%f}Z"
        path, k = self.folder / f"{stem}.mcap", 1
        while path.exists():
            k += 1
            path = self.folder / f"{stem}-{k}.mcap"
        about = {
            **self._about,
            **more,
            "recorder": VERSION,
            "layout": layout.LAYOUT,
            "machine": f"{platform.machine()} {platform.system()}",
            "began": began.isoformat(),
            "settings_of_recorder": asdict(self.settings),
        }
        return Writing(self.disk, path, self._now, about, self._scene, self._time)

    def _close_block(self) -> None:
        """Store the frames that wait."""
        if self._rows:
            rows, self._rows = self._rows, []
            self._store(Stored(ros.FRAMES.number, self._time, pack_block(rows)))
        self._checkpoint = False

    def _store(self, message: Stored) -> None:
        """Keep a message wherever it belongs."""
        self._before.add(self._now, message, self._checkpoint)
        for writing in self._files:
            writing.add(message)

    def _set_clock(self, row: Floats) -> None:
        """Take the time of a frame: a wall clock that never goes back."""
        self._now = float(row[frames.IN_FRAME.monotonic])
        if self._offset is None:
            self._offset = float(row[frames.IN_FRAME.wall]) - self._now
        self._time = max(self._time, int((self._offset + self._now) * 1e9))
