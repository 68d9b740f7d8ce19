"""The service: one thread, one loop, messages in, cycles, messages out."""

import gc
import logging
import secrets
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from armguard.scene import Scene
from armguard.station.errors import ServiceError
from armguard.station.ring import RingWriter
from armguard.station.service import machine
from armguard.station.service.answers import Answers
from armguard.station.service.calls import Calls
from armguard.station.service.companions import Companions
from armguard.station.service.complaints import Complaints
from armguard.station.service.counters import PLACE, Counters, counters_path
from armguard.station.service.cycles import NANO, Cycles
from armguard.station.service.door import Door
from armguard.station.service.hub import Hub
from armguard.station.service.judge import Judge, scene_word
from armguard.station.service.peers import Peers
from armguard.station.service.post import Post
from armguard.station.service.reception import Reception
from armguard.station.service.rings import new_ring, was_killed
from armguard.station.service.settings import ServiceSettings
from armguard.station.service.states import States
from armguard.station.service.welcome import Welcome, welcome_text
from armguard.station.service.wishes import Command, Wishes
from armguard.station.wire.keys import keys_path, new_keys, write_keys
from armguard.station.wire.layout import (
    HEARTBEAT,
    MOST,
    MOST_ROBOTS,
    ROBOT,
    ROBOTS_AT,
    SEAL,
    Kind,
)
from armguard.station.wire.outbox import Outbox
from armguard.station.wire.words import Cause

log = logging.getLogger("armguard.service")

# Messages that are read before the clock is looked at again.
BATCH = 8

# Time from one checkpoint in the ring to the next [ns].
CHECKPOINT = 10 * NANO

SENDERS = PLACE["senders"]
COMMANDER_LOST = PLACE["commander_lost"]
COMPANIONS_ENDED = PLACE["companions_ended"]
COMPANIONS_RESTARTED = PLACE["companions_restarted"]


class Service:
    """Guards a scene for controllers and a commander that talk to it by messages.

    Everything that can be refused is refused here; after that `run` raises nothing.

    Attributes:
        port: The port it listens on.
        session: Number of this start.
        ring: The ring it writes.
        counters: What it counts.

    Args:
        scene: What to guard; its period and lateness must be those of the settings.
        settings: How.
        file: The scene's file, or "".

    Raises:
        ServiceError: The port is taken, or the scene has too many robots.
        RingError: There is no room for a ring.
        ArmguardError: The scene cannot be guarded.
    """

    def __init__(
        self, scene: Scene, settings: ServiceSettings, *, file: str = ""
    ) -> None:
        if len(scene.robots) > MOST_ROBOTS:
            raise ServiceError(
                f"the scene has {len(scene.robots)} robots; a message can name "
                f"{MOST_ROBOTS}"
            )
        joints = len(scene.q_names)
        size = ROBOTS_AT + len(scene.robots) * ROBOT.size + 16 * joints + SEAL
        if size > MOST:
            raise ServiceError(
                f"the scene has {joints} joints of {len(scene.robots)} robots; what "
                f"they are told takes {size} bytes, and a message has {MOST}"
            )
        self._settings, self._file = settings, file
        post = Post(settings.bind, settings.port)
        self.port: int = post.port
        self.session = secrets.randbits(63) | 1
        outbox = Outbox(None, 0, self.session)
        buffer = bytearray(MOST + 8)
        # A key file that the service has written, and removes at its end.
        self._keys_file: Path | None = None
        keys = settings.keys or new_keys()
        killed = was_killed(self.port, settings.ring)
        try:
            path = settings.ring or new_ring(self.port)
            self.ring = RingWriter(path, settings.ring_size)
            try:
                self.counters = Counters(counters_path(path))
                judge = Judge(
                    scene,
                    file,
                    settings,
                    self.ring,
                    np.frombuffer(buffer, np.float64),
                    np.frombuffer(outbox.buffer, np.float64),
                )
                if not settings.keys:
                    self._keys_file = keys_path(self.port)
                    write_keys(self._keys_file, keys)
            except BaseException:
                self.ring.close()
                counters_path(path).unlink(missing_ok=True)
                raise
        except BaseException:
            post.close()
            raise
        peers = Peers(int(settings.forget * NANO))
        self._hub = Hub(
            settings=settings,
            post=post,
            counters=self.counters,
            complaints=Complaints(),
            peers=peers,
            door=Door(keys, self.session, 0, peers),
            outbox=outbox,
            answers=Answers(judge.desk, outbox),
            judge=judge,
            states=States(judge.desk),
            wishes=Wishes(int(settings.wish_watchdog * NANO)),
            command=Command(),
        )
        if settings.stopped or killed:
            self._hub.ordered = Cause.RESTARTED
            log.warning(
                "the last service on this port was killed: robots stay stopped until "
                "the commander engages them"
                if killed
                else "robots stay stopped until the commander engages them"
            )
        self._companions = Companions()
        self._welcome = Welcome()
        self._adopt_scene()
        self._cycles = Cycles(self._hub)
        calls = Calls(self._hub, self._begin_anew)
        self._reception = Reception(
            self._hub, self._cycles, calls, self._welcome, buffer
        )
        self._checkpoint = 0
        self._heartbeat = int(settings.heartbeat * NANO)
        self._beat_at = 0

    @property
    def notes(self) -> tuple[str, ...]:
        """What the user should know of the scene."""
        return self._hub.judge.guard.guard.tables.notes

    def run(self, until: Callable[[], bool] = lambda: False) -> None:
        """Serve until told otherwise, then stop every robot and say good-bye.

        Args:
            until: Asked at least as often as there are heartbeats.
        """
        settings = self._settings
        self._companions.start(settings.companions, self.ring.path, self.port)
        for wanted, refusal in (
            (settings.realtime, machine.ask_realtime),
            (settings.lock_memory, machine.ask_locked_memory),
        ):
            if wanted and (why := refusal()):
                log.warning("%s", why)
        if settings.cpu is not None and (why := machine.ask_cpu(settings.cpu)):
            log.warning("%s", why)
        gc.collect()
        gc.freeze()
        was_on = gc.isenabled()
        gc.disable()
        try:
            self._loop(until)
        finally:
            if was_on:
                gc.enable()
            gc.unfreeze()
            self._end()

    def _loop(self, until: Callable[[], bool]) -> None:
        """Wait, read, judge, answer, until told otherwise; nothing raises out of it."""
        self._beat_at = time.monotonic_ns()
        turn = self._begin
        while not until():
            try:
                turn()
            except Exception as error:  # doubt is a stop
                self._cycles.fail("loop", error, time.monotonic_ns())
            turn = self._turn

    def _begin(self) -> None:
        """Before the first message is read: whatever follows it can be replayed."""
        self._keep_checkpoint(time.monotonic_ns())

    def _turn(self) -> None:
        """Wait for what comes first: a message, a cycle, a heartbeat; do it."""
        cycles, read = self._cycles, self._reception.read
        # Who is about to be spoken to stays awake: sleeping costs him his caches.
        due = min(self._beat_at, cycles.next, cycles.expected)
        wait = due - time.monotonic_ns()
        if wait > 0:
            self._hub.post.wait(wait * 1e-9)
        for _ in range(BATCH):
            if not read() or time.monotonic_ns() >= cycles.next:
                break
        now = time.monotonic_ns()
        if now >= cycles.next:
            cycles.run()
        if now >= self._beat_at:
            self._beat_at = max(self._beat_at + self._heartbeat, now)
            self._beat(now)

    def _beat(self, now: int) -> None:
        """What is done some twenty times a second."""
        hub = self._hub
        if now >= self._checkpoint:
            self._keep_checkpoint(now)
        for silent in hub.peers.look(now):
            silent.controls = False
            hub.post.disfavour(silent.address)
        self._reception.renew()
        holder = hub.peers.find(hub.command.sender)
        if holder is not None:
            if now - holder.heard > self._settings.commander_watchdog * NANO:
                hub.lose_command("silent")
                self.counters.count(COMMANDER_LOST)
        for _ in range(self._companions.newly_ended()):
            self.counters.count(COMPANIONS_ENDED)
        for _ in range(self._companions.restart()):
            self.counters.count(COMPANIONS_RESTARTED)
        self.counters.put(SENDERS, len(hub.peers.here))
        outbox = hub.outbox
        HEARTBEAT.pack_into(
            outbox.payload, 0, hub.judge.guard.cycle, hub.command.sender
        )
        hub.send_to_all(outbox.seal(Kind.HEARTBEAT, HEARTBEAT.size))

    def _keep_checkpoint(self, now: int) -> None:
        """Write down all that the guard remembers, and when to do so again."""
        self._hub.judge.checkpoint()
        self._checkpoint = now + CHECKPOINT

    def _begin_anew(self, now: int) -> None:
        """The guard is a new one, of the scene as it is now."""
        hub = self._hub
        self._adopt_scene()
        # Who replays what follows needs a place to begin.
        self._keep_checkpoint(now)
        self._cycles.begin_anew(now)
        for peer in hub.peers.here:
            self._welcome.send(hub, peer, 0, now)

    def _adopt_scene(self) -> None:
        """Take over what follows from the scene as it is now."""
        from armguard import __version__

        hub, settings = self._hub, self._settings
        judge = hub.judge
        hub.door.scene = hub.outbox.scene = scene_word(judge.hash)
        text = welcome_text(
            judge.guard.guard.tables,
            settings,
            scene_file=self._file,
            scene_hash=judge.hash,
            ring=str(self.ring.path),
            counters=str(self.counters.path),
            session=self.session,
            version=__version__,
            rate=settings.rate,
        )
        self._welcome.adopt(text)

    def _end(self) -> None:
        """A last stop for every robot, good-bye, and everything closed."""
        hub = self._hub
        try:
            if hub.states.complete:
                self._cycles.force(Cause.SHUTDOWN)
                self._cycles.run()
            else:
                now = time.monotonic_ns()
                cycle = hub.judge.guard.cycle
                hub.send_to_all(
                    hub.answers.write_stop(hub.states, cycle, Cause.SHUTDOWN, now, 0)
                )
            hub.judge.note("end")
            hub.send_to_all(hub.outbox.message(Kind.BYE))
        finally:
            hub.post.close()
            self.ring.close()
            self._companions.end()
            self.counters.close()
            self._remove_keys()

    def _remove_keys(self) -> None:
        """Remove the key file that the service has written."""
        if self._keys_file is not None:
            self._keys_file.unlink(missing_ok=True)
