"""Cycles: when one is due, what it does, and which clients get its answer."""

import logging
import time

from armguard.guard.events import EventLog
from armguard.guard.levels import Level
from armguard.recording.counters import FIRST_CAUSE
from armguard.respond.units import SUSTAINED
from armguard.service.server.context import Context
from armguard.service.server.mapped import MappedCells
from armguard.service.server.peers import Peer
from armguard.service.wire import Cause
from armguard.service.wire.layout import HELD, MISSED, OBJECTS_CHANGED, STOP_LEVEL

NANO = 1_000_000_000

NEVER = 1 << 62

# Time from one look at an event in progress to the next [ns].
LOOK = 50_000_000

log = logging.getLogger("armguard.service")


class Cycles:
    """Runs cycles: after each state, and where none is received in time.

    Attributes:
        expected: When to stop sleeping, since the next state is expected soon [ns].

    Args:
        context: State that all parts of the loop share.
        mapped: Takes the changes of the map.
    """

    def __init__(self, context: Context, mapped: MappedCells) -> None:
        self._context, self._mapped = context, mapped
        settings = context.settings
        period = settings.period
        self._period = int(period * NANO)
        self._limit = int((period + settings.late) * NANO)
        # A state is waited for beyond the period, but never longer than the guard
        # permits a cycle to be late.
        self._grace = int(min(settings.late, period) * NANO) // 2
        self._spin = int(settings.spin * NANO)
        self.expected = NEVER
        # The client whose state began the next cycle, and when that was received [ns].
        self._asker: Peer | None = None
        self._fresh = False
        self._received = 0
        self._earliest = self._latest = self._last_start = 0
        self._force = Cause.NONE
        self._cycle = context.judge.cycle
        # The commander whose desired motion looks like another unit, 0 if it does not;
        # since when it does [ns], and whether it was named.
        self._strange_by, self._strange_since, self._named = 0, 0, False
        self._events = EventLog(Level.SLOW)
        # Level of the last cycle that the log of events has, and when it was [ns].
        self._seen, self._looked = Level.CLEAR, 0

    def begin_with(self, peer: Peer, sequence: int, now: int) -> None:
        """A state was received: the next cycle is its."""
        self._asker, self._fresh, self._received = peer, True, now
        cycle = self._cycle
        cycle.began_by, cycle.began_with, cycle.began_at = peer.sender, sequence, now
        if self._spin:
            self.expected = now + self._period - self._spin

    def begin_anew(self, now: int) -> None:
        """The guard is a new one: no cycle of it was before this."""
        self._last_start = 0
        self._latest = now + self._period

    def force(self, cause: Cause) -> None:
        """The next cycle is a stop."""
        self._force = cause

    def fail(self, where: str, error: Exception, now: int) -> None:
        """An error that must not be: the next cycle is a stop."""
        self._force = Cause.FAULT
        self._context.counters.count("cycle_faults")
        self._context.log.report(where, f"{type(error).__name__}: {error}", now)

    @property
    def next(self) -> int:
        """When the next cycle is due; NEVER before every robot has had a state [ns]."""
        if not self._context.judge.complete:
            return NEVER
        return self._earliest if self._fresh else self._latest

    def run(self) -> None:
        """One cycle, and its answer; raises nothing."""
        context = self._context
        judge, answers, counters = context.judge, context.answers, context.counters
        start = time.monotonic_ns()
        fresh, asker, received = self._fresh, self._asker, self._received
        due = max(self._earliest, received) if fresh else self._latest
        self._fresh, self._asker = False, None
        last, self._last_start = self._last_start, start
        if not fresh:
            # No state was received when it should have been: sleep again.
            self.expected = NEVER
            cycle = self._cycle
            cycle.began_by = cycle.began_with = cycle.began_at = 0
        # A state is not made to wait for a grid: after every hiccup it would be off it.
        self._earliest = start + self._period // 2
        self._latest = start + self._period + (self._grace if fresh else 0)
        # Why the desired motion does not count, if it does not.
        ordered = context.reflex or context.ordered
        cause = self._force or ordered or context.command.cause(start)
        self._force = Cause.NONE
        number = judge.guard.cycle
        before = answers.level
        try:
            cause, ended, message = self._judge(cause, number, start, last)
        except Exception as error:  # doubt is a stop
            ended = time.monotonic_ns()
            self.fail("cycle", error, ended)
            cause = Cause.FAULT
            message = answers.write_stop(number, cause, ended, context.command.sender)
        if asker is not None:
            # The client that asked is answered first.
            handed = time.monotonic_ns()
            context.send(message, asker)
            counters.time("inside", time.monotonic_ns() - received)
            counters.time("handed", handed - received)
        for peer in context.peers.here:
            if peer is asker:
                continue
            due_now = peer.every and number % peer.every == 0
            if due_now or peer.sender in judge.senders:
                context.send(message, peer)
        if cause != Cause.FAULT:
            try:
                judge.write_down()
            except Exception as error:  # a cycle that is not recorded: stop
                self.fail("ring", error, ended)
        try:
            self._mapped.renew()
        except Exception as error:  # cells that cannot be forgotten: stop
            self.fail("cells", error, ended)
        counters.time("waking", start - due)
        self._count(fresh, cause, before, ended - start)
        events = self._events
        if answers.level > self._seen or (
            events.open is not None and ended - self._looked > LOOK
        ):
            self._looked = ended
            self._log_event()

    def look_at_unit(self, now: int) -> None:
        """Name a desired motion that looks like another unit, once while it lasts.

        Args:
            now: Monotonic clock [ns].
        """
        context = self._context
        says = context.judge.unit_remark()
        commander = context.command.sender if says else 0
        if commander != self._strange_by:
            self._strange_by, self._strange_since, self._named = commander, now, False
        if says and not self._named and now - self._strange_since >= SUSTAINED * NANO:
            self._named = True
            context.log.report("unit", says, now)
            peer = context.peers.find(commander)
            if peer is not None:
                context.refuse(peer, "unit", says, now)

    def _log_event(self) -> None:
        """Log an event that ends, and a stop that begins."""
        last, events = self._context.judge.last, self._events
        if last is None:
            return
        verdict, before = last.verdict, events.open
        stopped = before is not None and before.level >= Level.STOP
        self._seen = max(verdict.level, Level.CAUTION)
        over = events.add(verdict)
        if over is not None:
            log.info("%s for %.2f s: %s", over.level.name, over.seconds, over.why)
        now = events.open
        if (
            now is not None
            and now.level >= Level.STOP
            and not (stopped and now is before)
        ):
            log.warning("%s: %s", now.level.name, last.why)

    def _judge(
        self, cause: Cause, number: int, start: int, last: int
    ) -> tuple[Cause, int, memoryview]:
        """Ask the guard.

        Args:
            cause: Why the desired motion does not count, if it does not.
            number: Number of the cycle.
            start: When it began [ns].
            last: When the last one began; 0 if there was none [ns].

        Returns:
            The cause in the end, when it had been judged [ns], and the answer.
        """
        context, cycle = self._context, self._cycle
        judge = context.judge
        cycle.number, cycle.start, cycle.cause = number, start, cause
        cycle.marks = HELD if cause else 0
        if start < context.changed:
            cycle.marks |= OBJECTS_CHANGED
        cycle.commander = context.command.sender
        judge.ask(cause)
        ended = time.monotonic_ns()
        cycle.ended = ended
        if last and ended - last > self._limit:
            cause = self._force = Cause.DEADLINE_MISSED
            cycle.cause = cause
            cycle.marks |= MISSED
            context.counters.count("deadline_missed")
            settings = context.settings
            sentence = (
                f"a cycle ended {(ended - last) / 1e6:.2f} ms after the last; "
                f"--rate {settings.rate:g} allows {settings.period * 1e3:.2f} ms, and "
                f"--late {settings.late * 1e3:.2f} ms more"
            )
            context.log.report("deadline", sentence, ended)
            judge.rewrite_answer()
        return cause, ended, context.answers.seal(ended)

    def _count(self, fresh: bool, cause: Cause, before: int, took: int) -> None:
        """Count a cycle that is over."""
        counters, answers = self._context.counters, self._context.answers
        counters.time("judging", took)
        counters.count("cycles")
        if not fresh:
            counters.count("cycles_without_state")
        if cause and not cause.stops:
            counters.count("cycles_without_wish")
        counters.put("level", answers.level)
        if answers.level >= STOP_LEVEL > before:
            counters.stop(FIRST_CAUSE + cause if cause.stops else answers.reason)
