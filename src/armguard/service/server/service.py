"""The service: one thread, one loop, messages in, cycles, messages out."""

import gc
import logging
import secrets
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from armguard.errors import ServiceError
from armguard.recording.counters import Counters, counters_path
from armguard.recording.ring import RingWriter
from armguard.recording.rings import new_ring, was_killed
from armguard.scene import Scene
from armguard.service.server import machine
from armguard.service.server.answers import Answers
from armguard.service.server.authenticator import Authenticator
from armguard.service.server.companions import Companions
from armguard.service.server.context import Command, Context
from armguard.service.server.cycles import NANO, Cycles
from armguard.service.server.judge import Judge, scene_word
from armguard.service.server.mapped import MappedCells
from armguard.service.server.peers import Peers
from armguard.service.server.reception import Reception, send_welcome, welcome_parts
from armguard.service.server.rpc import Calls
from armguard.service.server.settings import ServiceSettings
from armguard.service.server.sockets import Sockets
from armguard.service.server.throttled_log import ThrottledLog
from armguard.service.wire import Cause, Kind, Outbox
from armguard.service.wire.keys import keys_path, new_keys, write_keys
from armguard.service.wire.layout import HEARTBEAT, MOST, MOST_ROBOTS, command_size
from armguard.service.wire.pulses import Pulses

log = logging.getLogger("armguard.service")

# Messages that are read before the clock is looked at again.
BATCH = 8

# Time from one checkpoint in the ring to the next [ns].
CHECKPOINT = 10 * NANO


class Service:
    """Guards a scene for controllers and a commander that send it messages.

    Everything that can be refused is refused here; after that `run` raises nothing.

    Attributes:
        port: The port it listens on.
        session: Number of this start.
        ring: The ring it writes.
        counters: Its counters.

    Args:
        scene: What to guard; its period and lateness must be those of the settings.
        settings: How.
        file: The scene's file, or "".

    Raises:
        ServiceError: The port is taken, or the scene has too many robots.
        StationError: The file of the reflex cannot be used.
        RingError: There is no room for a ring.
        ArmguardError: The scene cannot be guarded.
    """

    def __init__(
        self, scene: Scene, settings: ServiceSettings, *, file: str = ""
    ) -> None:
        check_size(scene)
        self._settings, self._file = settings, file
        sockets = Sockets(settings.bind, settings.port)
        self.port: int = sockets.port
        self.session = secrets.randbits(63) | 1
        outbox = Outbox(None, 0, self.session)
        buffer = bytearray(MOST + 8)
        # A key file that the service has written, and removes at its end.
        self._keys_file: Path | None = None
        keys = settings.keys or new_keys()
        killed = was_killed(self.port, settings.ring)
        with ExitStack() as opened:
            opened.callback(sockets.close)
            path = settings.ring or new_ring(self.port)
            self.ring = RingWriter(path, settings.ring_size)
            opened.callback(counters_path(path).unlink, missing_ok=True)
            opened.callback(self.ring.close)
            self.counters = Counters(counters_path(path))
            pulses = None
            if settings.reflex is not None:
                pulses = Pulses(settings.reflex)
                opened.callback(pulses.close)
                sockets.beside = (pulses,)
            words = (np.frombuffer(one, np.float64) for one in (buffer, outbox.buffer))
            judge = Judge(scene, file, settings, self.ring, *words)
            if not settings.keys:
                self._keys_file = keys_path(self.port)
                write_keys(self._keys_file, keys)
            # All is well: nothing of it is closed before the end.
            opened.pop_all()
        peers = Peers(int(settings.forget * NANO))
        self._context = Context(
            settings=settings,
            sockets=sockets,
            counters=self.counters,
            log=ThrottledLog(),
            peers=peers,
            authenticator=Authenticator(keys, self.session, peers),
            outbox=outbox,
            answers=Answers(judge, outbox),
            judge=judge,
            command=Command(int(settings.wish_watchdog * NANO)),
            pulses=pulses,
        )
        if settings.stopped or killed:
            self._stay_stopped(killed)
        self._companions = Companions()
        self._adopt_scene()
        self._mapped = MappedCells(self._context)
        self._cycles = Cycles(self._context, self._mapped)
        calls = Calls(self._context, self._begin_anew)
        self._reception = Reception(
            self._context, self._cycles, calls, self._mapped, buffer
        )
        self._checkpoint = 0
        self._heartbeat = int(settings.heartbeat * NANO)
        self._beat_at = 0

    def _stay_stopped(self, killed: bool) -> None:
        """Stop all robots until they are engaged, and say whether a service died."""
        self._context.ordered = Cause.RESTARTED
        log.warning(
            "the last service on this port was killed: robots stay stopped until "
            "the commander engages them"
            if killed
            else "robots stay stopped until the commander engages them"
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """What the user should know of the scene."""
        return self._context.judge.guard.guard.tables.notes

    def run(self, until: Callable[[], bool] = lambda: False) -> None:
        """Serve until asked to end, then stop every robot and say good-bye.

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
        """Wait, read, judge, answer, until asked to end; nothing raises out of it."""
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
        """Wait for a message, a cycle or a heartbeat, and do what is due first."""
        cycles, read = self._cycles, self._reception.read
        # The loop stays awake while a state is expected: sleeping costs it its caches.
        due = min(self._beat_at, cycles.next, cycles.expected)
        wait = due - time.monotonic_ns()
        if wait > 0:
            self._context.sockets.wait(wait * 1e-9)
        for _ in range(BATCH):
            if not read() or time.monotonic_ns() >= cycles.next:
                break
        now = time.monotonic_ns()
        self._context.look_at_reflex(now)
        if now >= cycles.next:
            cycles.run()
        if now >= self._beat_at:
            self._beat_at = max(self._beat_at + self._heartbeat, now)
            self._beat(now)

    def _beat(self, now: int) -> None:
        """What is done some twenty times a second."""
        context = self._context
        if now >= self._checkpoint:
            self._keep_checkpoint(now)
        for silent in context.peers.look(now):
            silent.controls = False
            context.sockets.close_own(silent.address)
        self._reception.renew()
        if self._cycles.next > now + NANO:
            # No cycle does so.
            self._mapped.renew()
        self._cycles.look_at_unit(now)
        holder = context.peers.find(context.command.sender)
        if holder is not None:
            if now - holder.heard > self._settings.commander_watchdog * NANO:
                context.lose_command("silent")
                self.counters.count("commander_lost")
        for _ in range(self._companions.newly_ended()):
            self.counters.count("companions_ended")
        for _ in range(self._companions.restart()):
            self.counters.count("companions_restarted")
        self.counters.put("senders", len(context.peers.here))
        beat = HEARTBEAT.pack(context.judge.guard.cycle, context.command.sender)
        context.send_to_all(context.outbox.message(Kind.HEARTBEAT, beat))

    def _keep_checkpoint(self, now: int) -> None:
        """Write down all that the guard remembers, and when to do so again."""
        self._context.judge.checkpoint()
        self._checkpoint = now + CHECKPOINT

    def _begin_anew(self, now: int) -> None:
        """The guard is a new one, of the scene as it is now."""
        context = self._context
        self._adopt_scene()
        # A replay of what follows needs a place to begin.
        self._keep_checkpoint(now)
        self._cycles.begin_anew(now)
        self._mapped.begin_anew()
        for peer in context.peers.here:
            send_welcome(context, peer, 0, now)

    def _adopt_scene(self) -> None:
        """Take over what follows from the scene as it is now."""
        from armguard import __version__

        context, settings = self._context, self._settings
        judge = context.judge
        word = scene_word(judge.hash)
        context.authenticator.scene = context.outbox.scene = word
        parts = welcome_parts(
            judge.guard.guard.tables,
            settings,
            scene_file=self._file,
            scene_hash=judge.hash,
            ring=str(self.ring.path),
            counters=str(self.counters.path),
            session=self.session,
            version=__version__,
            rate=settings.rate,
            sensors=list(judge.scene.sensors),
            sensing=region_of(judge.scene),
            **{} if settings.reflex is None else {"reflex": str(settings.reflex)},
        )
        context.welcome = tuple(parts)

    def _end(self) -> None:
        """A last stop for every robot, good-bye, and everything closed."""
        context = self._context
        try:
            if context.judge.complete:
                self._cycles.force(Cause.SHUTDOWN)
                self._cycles.run()
            else:
                now, cycle = time.monotonic_ns(), context.judge.guard.cycle
                stop = context.answers.write_stop(cycle, Cause.SHUTDOWN, now, 0)
                context.send_to_all(stop)
            context.judge.note("end")
            context.send_to_all(context.outbox.message(Kind.BYE))
        finally:
            context.sockets.close()
            if context.pulses is not None:
                context.pulses.close()
            self.ring.close()
            self._companions.end()
            self.counters.close()
            if self._keys_file is not None:
                self._keys_file.unlink(missing_ok=True)


def region_of(scene: Scene) -> dict[str, Any] | None:
    """Place and size of the cells that the guard has; None without sensed space."""
    space = scene.sensing
    if space is None:
        return None
    region = space.region
    return {"centre": list(region.centre), "size": region.size, "cell": space.cell}


def check_size(scene: Scene) -> None:
    """Refuse a scene of which no message can hold all robots and joints.

    Raises:
        ServiceError: It has too many.
    """
    robots, joints = len(scene.robots), len(scene.q_names)
    if robots > MOST_ROBOTS:
        raise ServiceError(
            f"the scene has {robots} robots; a message can name {MOST_ROBOTS}"
        )
    size = command_size(robots, joints)
    if size > MOST:
        raise ServiceError(
            f"the scene has {joints} joints of {robots} robots; their COMMAND takes "
            f"{size} bytes, and a message has {MOST}"
        )
