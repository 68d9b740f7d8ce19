"""The service: one thread, one loop, messages in, cycles, messages out."""

import gc
import logging
import secrets
import select
import socket
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from armguard.scene import Scene
from armguard.station.errors import ServiceError
from armguard.station.ring import RingWriter
from armguard.station.service import machine
from armguard.station.service.answers import STOP_LEVEL, Answers
from armguard.station.service.calls import Calls, read_call, region_of
from armguard.station.service.companions import Companions
from armguard.station.service.complaints import Complaints
from armguard.station.service.counters import (
    DROPS,
    FIRST_CAUSE,
    PLACE,
    Counters,
    counters_path,
)
from armguard.station.service.door import Door
from armguard.station.service.judge import Judge, scene_word
from armguard.station.service.peers import Address, Peer, Peers
from armguard.station.service.rings import new_ring
from armguard.station.service.settings import ServiceSettings
from armguard.station.service.states import States
from armguard.station.service.welcome import (
    parts_of,
    tools_of,
    welcome_part,
    welcome_text,
)
from armguard.station.service.wishes import Command, Wishes
from armguard.station.wire.layout import (
    CLAIM,
    GIVE_BACK,
    GRANT,
    HEADER,
    HEARTBEAT,
    HELD,
    HELLO,
    MISSED,
    MOST,
    MOST_ROBOTS,
    REPLY,
    SEAL,
    SENSOR,
    Kind,
)
from armguard.station.wire.outbox import Outbox
from armguard.station.wire.seal import Seal
from armguard.station.wire.words import Cause

log = logging.getLogger("armguard.service")

NANO = 1_000_000_000

# Messages that are read before the clock is looked at again.
BATCH = 8

# Time from one checkpoint in the ring to the next [ns].
CHECKPOINT = 10 * NANO

NEVER = 1 << 62

INSIDE, JUDGING, WAKING = range(3)
NOBODY_BEGAN = (0, 0, 0)
NAN = float("nan")


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
        self._settings = settings
        if len(scene.robots) > MOST_ROBOTS:
            raise ServiceError(
                f"the scene has {len(scene.robots)} robots; a message can name "
                f"{MOST_ROBOTS}"
            )
        self._socket = listening(settings.bind, settings.port)
        self.port: int = self._socket.getsockname()[1]
        self.session = secrets.randbits(63) | 1
        path = settings.ring or new_ring(self.port)
        try:
            self.ring = RingWriter(path, settings.ring_size)
            try:
                self.counters = Counters(counters_path(path))
                self._judge = Judge(scene, file, settings, self.ring)
            except BaseException:
                self.ring.close()
                counters_path(path).unlink(missing_ok=True)
                raise
        except BaseException:
            self._socket.close()
            raise
        self._file = file
        period = settings.period
        self._period = int(period * NANO)
        self._limit = int((period + settings.late) * NANO)
        # A state is waited for beyond the period, but never longer than the guard
        # bears a cycle to be late.
        self._grace = int(min(settings.late, period) * NANO) // 2
        self._buffer = bytearray(MOST + 8)
        self._message = memoryview(self._buffer)
        self._words = np.frombuffer(self._buffer, np.float64)
        seal = Seal(settings.key)
        self._peers = Peers(int(settings.forget * NANO))
        self._door = Door(seal, self.session, 0, self._peers)
        self._outbox = Outbox(seal, 0, self.session)
        self._command = Command()
        self._complaints = Complaints()
        self._companions = Companions()
        tables = self._judge.guard.guard.tables
        self._states = States(tables, int(settings.controller_watchdog * NANO))
        self._wishes = Wishes(
            len(tables.q_names), tools_of(tables), int(settings.wish_watchdog * NANO)
        )
        self._adopt_scene()
        self._calls = Calls(self._doors_of_calls())
        self._kinds: dict[int, Callable[[Peer, memoryview, int], str]] = {
            Kind.STATE: self._take_state,
            Kind.WISH: self._take_wish,
            Kind.HEARTBEAT: self._take_nothing,
            Kind.CLAIM: self._take_claim,
            Kind.GIVE_BACK: self._take_give_back,
            Kind.CALL: self._take_call,
            Kind.STOP: self._take_stop,
            Kind.BYE: self._take_bye,
        }
        self._began = NOBODY_BEGAN
        self._fresh = False
        self._earliest = self._latest = self._last_start = 0
        self._ordered = False
        self._force = Cause.NONE
        self._checkpoint = 0
        self._sockets = [self._socket]
        self._heartbeat = int(settings.heartbeat * NANO)
        self._beat_at = 0
        # When to stop sleeping, since the next state is to come soon.
        self._spin = int(settings.spin * NANO)
        self._expected = NEVER

    @property
    def notes(self) -> tuple[str, ...]:
        """What the user should know of the scene."""
        return self._judge.guard.guard.tables.notes

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
        while not until():
            try:
                self._turn()
            except Exception as error:  # doubt is a stop
                self._fail("loop", error, time.monotonic_ns())

    def _turn(self) -> None:
        """Wait for what comes first: a message, a cycle, a heartbeat; do it."""
        due = self._beat_at
        if self._states.complete:
            due = min(due, self._earliest if self._fresh else self._latest)
        # Who is about to be spoken to stays awake: sleeping costs him his caches.
        wait = min(due, self._expected) - time.monotonic_ns()
        if wait > 0:
            select.select(self._sockets, (), (), wait * 1e-9)
        for _ in range(BATCH):
            if not self._read() or self._due(time.monotonic_ns()):
                break
        now = time.monotonic_ns()
        if self._due(now):
            self._cycle()
        if now >= self._beat_at:
            self._beat_at = max(self._beat_at + self._heartbeat, now)
            self._beat(now)

    def _fail(self, where: str, error: Exception, now: int) -> None:
        """Something went wrong that must not: the next cycle is a stop."""
        self._force = Cause.FAULT
        self.counters.count(CYCLE_FAULTS)
        self._complaints.name(where, f"{type(error).__name__}: {error}", now)

    def _due(self, now: int) -> bool:
        """Whether a cycle is to begin now."""
        if not self._states.complete:
            return False
        return now >= (self._earliest if self._fresh else self._latest)

    def _read(self) -> bool:
        """Take one message over; False if there was none."""
        try:
            size, address = self._socket.recvfrom_into(self._buffer)
        except BlockingIOError:
            return False
        except OSError as error:
            # An error of an earlier send, told late.
            self._complaints.name("network", str(error), time.monotonic_ns())
            return True
        now = time.monotonic_ns()
        count = self.counters.count
        count(RECEIVED)
        message = self._message[:size]
        try:
            peer = self._door.admit(message, address, now)
            drop = self._door.drop
            if not drop and self._door.kind == Kind.HELLO:
                drop = self._take_hello(peer, message, address, now)
            elif not drop and peer is not None:
                drop = self._kinds[self._door.kind](peer, message, now)
        except Exception as error:  # nothing of what others send may end the loop
            drop = "payload"
            self._complaints.name("message", f"{type(error).__name__}: {error}", now)
        if drop:
            count(PLACE[f"dropped_{drop}"])
            self._complaints.name(drop, f"{DROPS[drop]}, from {address}", now)
        else:
            count(ACCEPTED)
        return True

    def _cycle(self) -> None:
        """One cycle, and its answer."""
        start = time.monotonic_ns()
        fresh, began = self._fresh, self._began
        count = self.counters.count
        due = max(self._earliest, began[2]) if fresh else self._latest
        self._fresh, self._began = False, NOBODY_BEGAN
        last, self._last_start = self._last_start, start
        if not fresh:
            # No state came when it should have: sleep again.
            self._expected = NEVER
        # A state is not made to wait for a grid: after every hiccup it would be off it.
        self._earliest = start + self._period // 2
        self._latest = start + self._period + (self._grace if fresh else 0)
        cause = self._cause(start)
        self._force = Cause.NONE
        number = self._judge.guard.cycle
        commander = self._command.sender
        try:
            command, form = self._judge.ask(
                self._states, self._wishes, cause, start * 1e-9
            )
            ended = time.monotonic_ns()
            flags = HELD if cause else 0
            if last and ended - last > self._limit:
                flags |= MISSED
                cause = self._force = Cause.DEADLINE_MISSED
                count(DEADLINE_MISSED)
                sentence = f"a cycle ended {(ended - last) / 1e6:.2f} ms after the last"
                self._complaints.name("deadline", sentence, ended)
            before = self._answers.level
            message = self._answers.write(
                command,
                self._states,
                number,
                began,
                (start, ended),
                cause,
                flags,
                form,
                commander,
            )
        except Exception as error:  # doubt is a stop
            ended = time.monotonic_ns()
            self._fail("cycle", error, ended)
            cause = Cause.FAULT
            before = self._answers.level
            message = self._answers.write_stop(
                self._states, number, cause, ended, commander
            )
        if fresh:
            # Who asked is answered first.
            asker = self._peers.find(began[0])
            if asker is not None:
                self._send(message, asker.address)
            self.counters.time(INSIDE, time.monotonic_ns() - began[2])
        for peer in self._peers.here:
            if peer.sender == began[0]:
                continue
            if peer.every and number % peer.every == 0:
                self._send(message, peer.address)
            elif peer.sender in self._states.sender:
                self._send(message, peer.address)
        if cause != Cause.FAULT:
            self._write_down(began[2] * 1e-9 if fresh else NAN, ended)
        self.counters.time(WAKING, start - due)
        self._count_cycle(fresh, cause, before, ended - start)

    def _write_down(self, received: float, ended: int) -> None:
        """Write the cycle into the ring, now that it has been answered."""
        try:
            self._judge.write_down(self._states, self._wishes, received, ended * 1e-9)
        except Exception as error:  # a cycle nobody can look at again: stop
            self._fail("ring", error, ended)

    def _count_cycle(self, fresh: bool, cause: Cause, before: int, took: int) -> None:
        """Count a cycle that is over."""
        count = self.counters.count
        self.counters.time(JUDGING, took)
        count(CYCLES)
        if not fresh:
            count(CYCLES_WITHOUT_STATE)
        if cause and not cause.stops:
            count(CYCLES_WITHOUT_WISH)
        level = self._answers.level
        self.counters.put(LEVEL, level)
        if level >= STOP_LEVEL > before:
            reason = self._answers.reason
            self.counters.stop(FIRST_CAUSE + cause if cause.stops else reason)

    def _cause(self, now: int) -> Cause:
        """Why the newest wish does not count, if it does not."""
        if self._force:
            return self._force
        if self._ordered:
            return Cause.STOP_ORDERED
        return self._wishes.cause(self._command.sender, now)

    def _beat(self, now: int) -> None:
        """What is done some twenty times a second."""
        if now >= self._checkpoint:
            self._judge.checkpoint()
            self._checkpoint = now + CHECKPOINT
        self._peers.forget_silent(now)
        holder = self._peers.find(self._command.sender)
        if holder is not None:
            if now - holder.heard > self._settings.commander_watchdog * NANO:
                self._lose_command("silent")
                self.counters.count(COMMANDER_LOST)
        for _ in range(self._companions.newly_ended()):
            self.counters.count(COMPANIONS_ENDED)
        self.counters.put(SENDERS, len(self._peers.here))
        payload = self._outbox.payload
        HEARTBEAT.pack_into(payload, 0, self._judge.guard.cycle, self._command.sender)
        message = self._outbox.seal(Kind.HEARTBEAT, HEARTBEAT.size)
        for peer in self._peers.here:
            self._send(message, peer.address)

    def _lose_command(self, why: str) -> None:
        """Nobody commands any more."""
        sender = self._command.sender
        self._command.give_back()
        self._wishes.drop()
        self._judge.note("commander", sender=0, before=sender, why=why)

    def _send(self, message: memoryview, address: Address) -> None:
        """Send without waiting; who does not read loses messages."""
        try:
            self._socket.sendto(message, address)
            self.counters.count(SENT)
        except BlockingIOError:
            self.counters.count(SEND_WOULD_BLOCK)
        except OSError:
            self.counters.count(SEND_FAILED)

    def _take_hello(
        self, peer: Peer | None, message: memoryview, address: Address, now: int
    ) -> str:
        """Somebody says who he is, for the first time or again."""
        payload = message[HEADER.size : -SEAL]
        if len(payload) < HELLO.size:
            return "payload"
        flags, every = HELLO.unpack_from(payload)
        door = self._door
        if peer is None:
            if self._peers.full:
                return "too_many_senders"
            if not door.sender:
                return "unknown_sender"
            name = bytes(payload[HELLO.size : HELLO.size + 64]).decode(errors="replace")
            peer = Peer(door.sender, name, address, door.sequence, now)
            self._peers.greet(peer)
            who = repr(name) if name else "somebody"
            sentence = f"{who} at {address[0]}:{address[1]} is here"
            self._complaints.name("hello", sentence, now, logging.INFO)
        peer.every, peer.sensor = every, bool(flags & SENSOR)
        self.counters.count(HELLOS)
        self._welcome(peer, door.stamp, now)
        return ""

    def _welcome(self, peer: Peer, asked: int, received: int) -> None:
        """Tell somebody what is guarded."""
        tables = self._judge.guard.guard.tables
        for k in range(len(self._parts)):
            message = welcome_part(
                self._outbox, tables, self._parts, k, asked, received
            )
            self._send(message, peer.address)

    def _take_state(self, peer: Peer, message: memoryview, now: int) -> str:
        """Somebody measured joints."""
        sequence = self._door.sequence
        drop, wish = self._states.take(message, self._words, peer.sender, sequence, now)
        if drop:
            return drop
        self.counters.count(STATES)
        self._began, self._fresh = (peer.sender, sequence, now), True
        if self._spin:
            self._expected = now + self._period - self._spin
        if not self._states.complete:
            self._send(
                self._answers.write_stop(
                    self._states, 0, Cause.WAITING, now, self._command.sender
                ),
                peer.address,
            )
        if wish:
            return self._hear_wish(peer, message, wish, now)
        return ""

    def _take_wish(self, peer: Peer, message: memoryview, now: int) -> str:
        """Somebody wants something."""
        return self._hear_wish(peer, message, HEADER.size, now)

    def _hear_wish(self, peer: Peer, message: memoryview, start: int, now: int) -> str:
        """Take a wish over if its sender commands."""
        token = self._command.token if peer.sender == self._command.sender else 0
        drop = self._wishes.take(message, self._words, start, token, now)
        if not drop:
            self.counters.count(WISHES)
        return drop

    def _take_nothing(self, peer: Peer, message: memoryview, now: int) -> str:
        """Somebody is alive."""
        return "" if len(message) == HEADER.size + SEAL else "payload"

    def _take_claim(self, peer: Peer, message: memoryview, now: int) -> str:
        """Somebody wants to command."""
        if len(message) != HEADER.size + CLAIM.size + SEAL:
            return "payload"
        force, _ = CLAIM.unpack_from(message, HEADER.size)
        command, before = self._command, self._command.sender
        granted = command.claim(peer.sender, bool(force))
        self.counters.count(CLAIMS if granted else CLAIMS_REFUSED)
        if granted and before != peer.sender:
            self._wishes.drop()
            self._judge.note(
                "commander", sender=peer.sender, name=peer.name, before=before
            )
        GRANT.pack_into(
            self._outbox.payload,
            0,
            granted,
            0,
            command.token if granted else 0,
            command.sender,
            self._settings.commander_watchdog,
            self._door.sequence,
        )
        self._send(self._outbox.seal(Kind.GRANT, GRANT.size), peer.address)
        return ""

    def _take_give_back(self, peer: Peer, message: memoryview, now: int) -> str:
        """Somebody does not want to command any more."""
        if len(message) != HEADER.size + GIVE_BACK.size + SEAL:
            return "payload"
        (token,) = GIVE_BACK.unpack_from(message, HEADER.size)
        if peer.sender != self._command.sender or token != self._command.token:
            return "not_commander"
        self._lose_command("given back")
        return ""

    def _take_call(self, peer: Peer, message: memoryview, now: int) -> str:
        """Somebody calls for something."""
        sequence = self._door.sequence
        request = read_call(bytes(message[HEADER.size : -SEAL]))
        if request is None:
            return "call_unreadable"
        self.counters.count(CALLS)
        if peer.last_call is not None and peer.last_call[0] == request.number:
            reply = peer.last_call[1]
        else:
            done, reply = self._calls.do(
                request, peer, peer.sender == self._command.sender
            )
            if not done:
                self.counters.count(CALLS_REFUSED)
            peer.last_call = request.number, reply
        payload = self._outbox.payload
        reply = reply[: len(payload) - REPLY.size]
        REPLY.pack_into(payload, 0, sequence)
        payload[REPLY.size : REPLY.size + len(reply)] = reply
        message = self._outbox.seal(Kind.REPLY, REPLY.size + len(reply))
        self._send(message, peer.address)
        return ""

    def _take_stop(self, peer: Peer, message: memoryview, now: int) -> str:
        """Somebody orders a stop, which everybody may."""
        self._order_stop(peer.name)
        return ""

    def _take_bye(self, peer: Peer, message: memoryview, now: int) -> str:
        """Somebody leaves."""
        self._peers.leave(peer)
        self._states.release(peer.sender)
        if peer.sender == self._command.sender:
            self._lose_command("said good-bye")
        return ""

    def _order_stop(self, who: str) -> None:
        """Stop all robots until the commander engages them."""
        self.counters.count(STOP_ORDERS)
        if not self._ordered:
            self._ordered = True
            self._judge.note("stop ordered", by=who)
            log.warning("a stop was ordered by %r", who)

    def _doors_of_calls(self) -> dict[str, Callable[..., Any]]:
        """What each call stands for."""

        def engage(name: str | None = None) -> None:
            self._judge.guard.engage(name)
            self._ordered = False

        def grasp(robot: str, name: str) -> None:
            self._judge.guard.grasp(robot, name)

        def release(robot: str, name: str) -> None:
            self._judge.guard.release(robot, name)

        def allow(a: str, b: str, region: Any = None, **more: float) -> None:
            self._judge.guard.allow(a, b, region=region_of(region), **more)

        def swap_model(robot: str, model: str) -> None:
            self._judge.guard.swap_model(robot, model)

        def retreat(name: str | None = None, to: Any = "path") -> None:
            self._judge.guard.retreat(name, to)

        def field_goal(name: str, q: Any = None, pose: Any = None) -> None:
            self._judge.guard.field_goal(name, q=q, pose=pose)

        def reset() -> None:
            if not self._judge.at_rest(self._states):
                raise ServiceError("a reset is for when every robot rests")
            self._judge.guard.reset()
            self._ordered = False

        def configure(response: Any = None, mode: Any = None) -> dict[str, Any]:
            told = self._judge.configure(self._states, response, mode)
            self._adopt_scene()
            now = time.monotonic_ns()
            # The guard is a new one: no cycle of it was before this.
            self._last_start = 0
            self._latest = now + self._period
            for peer in self._peers.here:
                self._welcome(peer, 0, now)
            return told

        def stop() -> None:
            self._order_stop("a call")

        return {
            "engage": engage,
            "grasp": grasp,
            "release": release,
            "allow": allow,
            "swap_model": swap_model,
            "retreat": retreat,
            "field_goal": field_goal,
            "reset": reset,
            "configure": configure,
            "place": self._judge.place,
            "remove": self._judge.remove,
            "why": self._judge.why,
            "stop": stop,
            "ping": lambda: {"cycle": self._judge.guard.cycle},
        }

    def _adopt_scene(self) -> None:
        """Take over what follows from the scene as it is now."""
        from armguard import __version__

        judge, settings = self._judge, self._settings
        tables = judge.guard.guard.tables
        word = scene_word(judge.hash)
        self._door.scene = self._outbox.scene = word
        self._answers = Answers(tables, self._outbox)
        text = welcome_text(
            tables,
            settings,
            self._answers.bodies,
            scene_file=self._file,
            scene_hash=judge.hash,
            ring=str(self.ring.path),
            counters=str(self.counters.path),
            session=self.session,
            version=__version__,
            rate=settings.rate,
        )
        self._parts = parts_of(text)

    def _end(self) -> None:
        """A last stop for every robot, good-bye, and everything closed."""
        try:
            if self._states.complete:
                self._force = Cause.SHUTDOWN
                self._cycle()
            else:
                now = time.monotonic_ns()
                message = self._answers.write_stop(
                    self._states, self._judge.guard.cycle, Cause.SHUTDOWN, now, 0
                )
                for peer in self._peers.here:
                    self._send(message, peer.address)
            self._judge.note("end")
            message = self._outbox.message(Kind.BYE)
            for peer in self._peers.here:
                self._send(message, peer.address)
        finally:
            self._socket.close()
            self.ring.close()
            self._companions.end()
            self.counters.close()


def listening(address: str, port: int) -> socket.socket:
    """A socket that listens there and never waits.

    Raises:
        ServiceError: The port is taken, or the address is not this machine's.
    """
    found = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        found.bind((address, port))
    except OSError as error:
        found.close()
        raise ServiceError(
            f"cannot listen on {address}:{port}: {error.strerror}; if another service "
            "has that port, end it or choose another with --port"
        ) from error
    found.setblocking(False)
    return found


RECEIVED = PLACE["received"]
ACCEPTED = PLACE["accepted"]
STATES = PLACE["states"]
WISHES = PLACE["wishes"]
CALLS = PLACE["calls"]
CALLS_REFUSED = PLACE["calls_refused"]
HELLOS = PLACE["hellos"]
CLAIMS = PLACE["claims"]
CLAIMS_REFUSED = PLACE["claims_refused"]
STOP_ORDERS = PLACE["stop_orders"]
CYCLES = PLACE["cycles"]
CYCLES_WITHOUT_STATE = PLACE["cycles_without_state"]
CYCLES_WITHOUT_WISH = PLACE["cycles_without_wish"]
DEADLINE_MISSED = PLACE["deadline_missed"]
CYCLE_FAULTS = PLACE["cycle_faults"]
SENT = PLACE["sent"]
SEND_WOULD_BLOCK = PLACE["send_would_block"]
SEND_FAILED = PLACE["send_failed"]
SENDERS = PLACE["senders"]
COMMANDER_LOST = PLACE["commander_lost"]
COMPANIONS_ENDED = PLACE["companions_ended"]
LEVEL = PLACE["level"]
