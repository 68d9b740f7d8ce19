"""The loop of the map: joint positions and frames in, changes and health out."""

import logging
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, suppress
from io import BufferedIOBase
from pathlib import Path
from typing import Any

import numpy as np

from armguard.errors import StationError
from armguard.scene.scene import Scene
from armguard.sense import Intake, Sense
from armguard.service.client import Client
from armguard.service.mapping.delivery import Delivery
from armguard.service.mapping.gate import FrameGate, count_of
from armguard.service.mapping.joints import JointStream
from armguard.service.mapping.receiver import FrameReceiver
from armguard.service.server.service import region_of
from armguard.service.wire import Keys, Kind, Role
from armguard.service.wire.keys import found_keys
from armguard.service.wire.layout import Header
from armguard.service.wire.sensing import (
    CELLS_TAKEN,
    HEALTH,
    MOST_ROWS,
    SENSOR,
    CellsTaken,
)

log = logging.getLogger("armguard.map")

# Longest time between two looks at frames, positions and answers [s].
TURN = 0.002

# Time between two reports of the health of sensors [s].
REPORT = 0.2

# Frames that are taken before the service's answers are looked at.
BATCH = 4

# A service that is silent for so long is looked for, how often, and how long that takes
# [s].
SILENT, AGAIN, ATTEMPT = 1.0, 0.5, 0.2

# Bytes for the state of a sensor in words.
WORDS = SENSOR.dtype["words"].itemsize

# Joint positions by which all is tried out first, and the time between them [s].
TRIED, TRIED_PERIOD = 100, 0.004

# The thread that takes frames gets the interpreter after so long [s].
SWITCH = 1e-4


class MapLink(Client):
    """The map as a client of the service.

    Attributes:
        keys: Keys of the service, or a file that holds them; None to look for them.

    Args:
        port: Port of the service.
        keys: See there.
    """

    def __init__(self, port: int, keys: Keys | str | Path | None = None) -> None:
        super().__init__(port, role=Role.SENSE, keys=keys, name="map", every=0)
        self.keys = keys

    @property
    def session(self) -> tuple[int, int]:
        """Session and scene in the headers of the service."""
        return self._connection.outbox.session, self._connection.outbox.scene

    @property
    def alive(self) -> bool:
        """Whether the service was heard lately."""
        return not self._gone and self.clock() - self._heard < SILENT

    def answers(self) -> Iterator[CellsTaken]:
        """Answers to CELLS that came since the last call."""
        self._drain()
        self._connection.keep_alive()
        while self._taken_cells:
            yield self._taken_cells.pop(0)

    def find_again(self) -> None:
        """Look for a service that went away."""
        with suppress(StationError):
            self.connect(ATTEMPT)

    def send(self, kind: Kind, payload: bytes) -> None:
        """Send a message."""
        self._connection.say(kind, payload)

    def _forget(self) -> None:
        super()._forget()
        self._taken_cells: list[CellsTaken] = []

    def _take_other(self, head: Header, payload: memoryview) -> bool:
        known = self.connected and head.session == self._connection.outbox.session
        if head.kind != Kind.CELLS_TAKEN or not known:
            return super()._take_other(head, payload)
        self._connection.last = head.sequence
        self._taken_cells.append(CELLS_TAKEN.unpack_from(payload))
        return True


class MapProcess:
    """Fills the map of a service by frames of sensors, also after it was started anew.

    Each service gets a map that begins with nothing: what another one knew is old.

    Args:
        scene: The scene, with its sensors and its sensed space.
        link: A client that is connected.
        port: Port for frames; 0 for a free one.
        record: File for joint positions and frames; none if None. The next map of this
            process gets another file, with its number behind the name.

    Raises:
        SceneError: The scene has no sensors, or no sensed space.
        StationError: The service guards other cells, or has other sensors.
    """

    def __init__(
        self, scene: Scene, link: MapLink, port: int = 0, record: Path | None = None
    ) -> None:
        self._scene, self._link, self._port = scene, link, port
        self._record, self._count = record, 0
        try_out(scene)
        self._check()

    def run(self, until: Callable[[], bool] = lambda: False) -> None:
        """Fill maps until something is true.

        Raises:
            StationError: The port for frames is taken, or a service that was started
                anew guards other cells.
        """
        interval = sys.getswitchinterval()
        sys.setswitchinterval(SWITCH)
        try:
            while not until():
                self._fill(until)
                self._check()
        finally:
            sys.setswitchinterval(interval)

    def _check(self) -> None:
        """Make sure that the service has the cells and the sensors of the scene.

        Raises:
            StationError: It has others.
        """
        text = self._link.welcome.text if self._link.connected else None
        if text is None:
            return
        own: Mapping[str, Any] = {
            "sensing": region_of(self._scene), "sensors": [*self._scene.sensors]
        }  # fmt: skip
        for name, value in own.items():
            if text[name] != value:
                raise StationError(
                    f"the service has other {name} than the scene, {text[name]}; start "
                    "both with the same scene"
                )

    def _fill(self, until: Callable[[], bool]) -> None:
        """Fill one map, until it has to begin anew."""
        link, session = self._link, self._link.session
        keys = found_keys(link.keys, link.port)[0]
        with ExitStack() as opened:
            joints = JointStream(Path(link.welcome.ring), link.welcome.parts)
            opened.callback(joints.close)
            gate = FrameGate(self._scene.sensors, keys, *session)
            receiver = FrameReceiver(gate, self._port)
            opened.callback(receiver.close)
            sense = Sense(self._scene, record=self._opened(opened))
            delivery: Delivery | None = None
            report = again = 0.0
            log.info("frames are taken on port %d", receiver.port)
            while not until():
                receiver.came.wait(TURN)
                receiver.came.clear()
                read = time.monotonic_ns()
                for q, stamp in joints.unread():
                    sense.joints(q, stamp)
                take_frames(sense, receiver, joints.newest, read)
                if delivery is None and joints.newest > -float("inf"):
                    delivery = Delivery(sense, link.send, link.welcome.period)
                for taken in link.answers():
                    if delivery is not None and not delivery.take(taken):
                        log.warning(
                            "the service has another guard: the map begins anew"
                        )
                        return
                if delivery is not None:
                    delivery.run()
                now = time.monotonic()
                if now >= report:
                    report = now + REPORT
                    for one in health_of(sense, receiver):
                        link.send(Kind.HEALTH, one)
                if not link.alive and now >= again:
                    again = now + AGAIN
                    link.find_again()
                if link.connected and link.session != session:
                    log.warning("the service was started anew: the map begins anew")
                    return

    def _opened(self, opened: ExitStack) -> BufferedIOBase | None:
        """The file for the frames of the next map; None without one."""
        if self._record is None:
            return None
        self._count += 1
        path = self._record
        if self._count > 1:
            path = path.with_stem(f"{path.stem}-{self._count}")
        return opened.enter_context(KeptFile(path))


def try_out(scene: Scene) -> None:
    """Compile, or load, all that frames need, before the first one counts.

    Raises:
        SceneError: The scene has no sensors, or no sensed space.
    """
    sense = Sense(scene)
    # Far apart, positions between two of them would be uncertain, and masks large.
    for k in range(TRIED):
        sense.joints(scene.home, k * TRIED_PERIOD)
    kinds = {one.form: (name, one) for name, one in scene.sensors.items()}
    for name, sensor in kinds.values():
        far = np.full(count_of(sensor) or (1, 3), sensor.range[1])
        now = sensor.delay + TRIED * TRIED_PERIOD / 2.0
        sense.frame(name, far, None, now)
    sense.changes()


def take_frames(
    sense: Sense, receiver: FrameReceiver, newest: float, read: int
) -> None:
    """Take some of the frames that wait.

    Args:
        sense: Takes them.
        receiver: Has them.
        newest: Stamp of the newest joint positions [s].
        read: When these were read, monotonic [ns].
    """
    for _ in range(BATCH):
        frame = receiver.next(newest, read)
        if frame is None:
            return
        sense.frame(frame.name, frame.values, frame.status, frame.stamp)


def health_of(sense: Sense, receiver: FrameReceiver) -> Iterator[bytes]:
    """Payloads of HEALTHs about all sensors."""
    usable = (Intake.TAKEN, Intake.HITS_ONLY)
    rows, taken = [], 0
    dropped = receiver.dropped
    for one in sense.health.values():
        own = sum(one.intakes[kind] for kind in usable)
        taken, dropped = taken + own, dropped + one.intakes.total() - own
        rows.append(
            SENSOR.pack(
                faults=sum(1 << fault for fault in one.faults),
                frees=one.trusted,
                taken=own,
                dropped=one.intakes.total() - own,
                stamp=one.stamp,
                words=str(one).encode()[:WORDS],
            )
        )
    for first in range(0, len(rows), MOST_ROWS):
        some = rows[first : first + MOST_ROWS]
        head = HEALTH.pack(
            stamp=sense.stamp, taken=taken, dropped=dropped, port=receiver.port,
            first=first, rows=len(some), sensors=len(rows),
        )  # fmt: skip
        yield head + b"".join(some)


class KeptFile(BufferedIOBase):
    """A file that is given up, with a warning, when it cannot be written any more.

    Args:
        path: The file, made anew.

    Raises:
        OSError: It cannot be made.
    """

    def __init__(self, path: Path) -> None:
        self._file, self._path, self._full = path.open("wb"), path, False

    def write(self, data: Any) -> int:
        """Write bytes, or nothing once that was not possible."""
        if not self._full:
            try:
                self._file.write(data)
            except OSError as error:
                self._full = True
                log.warning("%s: no more frames are recorded: %s", self._path, error)
        return len(memoryview(data).cast("B"))

    def close(self) -> None:
        """Close the file."""
        with suppress(OSError):
            self._file.close()
        super().close()
