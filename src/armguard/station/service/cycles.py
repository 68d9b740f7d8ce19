"""When a cycle is due, what it does, and who is told."""

import time

from armguard.station.desk.desk import (
    BEGAN_AT,
    BEGAN_BY,
    BEGAN_WITH,
    CAUSE,
    COMMANDER,
    CYCLE,
    ENDED,
    FLAGS,
    START,
)
from armguard.station.desk.telling import ENDED_AT
from armguard.station.service.answers import STOP_LEVEL
from armguard.station.service.counters import FIRST_CAUSE, PLACE
from armguard.station.service.hub import Hub
from armguard.station.service.peers import Peer
from armguard.station.wire.layout import HELD, MISSED, OBJECTS_CHANGED
from armguard.station.wire.words import Cause

NANO = 1_000_000_000

# Histograms, by their places in `HISTOGRAMS`.
INSIDE, JUDGING, WAKING, HANDED = range(4)

NEVER = 1 << 62

CYCLES = PLACE["cycles"]
CYCLES_WITHOUT_STATE = PLACE["cycles_without_state"]
CYCLES_WITHOUT_WISH = PLACE["cycles_without_wish"]
DEADLINE_MISSED = PLACE["deadline_missed"]
CYCLE_FAULTS = PLACE["cycle_faults"]
LEVEL = PLACE["level"]


class Cycles:
    """Runs cycles: after each state that came in, and where none comes in time.

    Attributes:
        expected: When to stop sleeping, since the next state is to come soon [ns].

    Args:
        hub: What all parts of the loop share.
    """

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        settings = hub.settings
        period = settings.period
        self._period = int(period * NANO)
        self._limit = int((period + settings.late) * NANO)
        # A state is waited for beyond the period, but never longer than the guard
        # bears a cycle to be late.
        self._grace = int(min(settings.late, period) * NANO) // 2
        self._spin = int(settings.spin * NANO)
        self.expected = NEVER
        # Who began the next cycle, if a state did, and when that came in [ns].
        self._asker: Peer | None = None
        self._fresh = False
        self._received = 0
        self._earliest = self._latest = self._last_start = 0
        self._force = Cause.NONE
        given = hub.judge.desk.given.data
        self._given, self._given_u = given, given.cast("B").cast("Q")
        self._ended_at = hub.judge.desk.answer.data.cast("B").cast("q")

    def begin_with(self, peer: Peer, sequence: int, now: int) -> None:
        """A state has come in: the next cycle is its."""
        self._asker, self._fresh, self._received = peer, True, now
        given = self._given_u
        given[BEGAN_BY], given[BEGAN_WITH], given[BEGAN_AT] = peer.sender, sequence, now
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
        """Something went wrong that must not: the next cycle is a stop."""
        self._force = Cause.FAULT
        self._hub.counters.count(CYCLE_FAULTS)
        self._hub.complaints.name(where, f"{type(error).__name__}: {error}", now)

    @property
    def next(self) -> int:
        """When the next cycle is due; NEVER before every robot has had a state [ns]."""
        if not self._hub.states.complete:
            return NEVER
        return self._earliest if self._fresh else self._latest

    def run(self) -> None:
        """One cycle, and its answer; raises nothing."""
        hub = self._hub
        start = time.monotonic_ns()
        fresh, asker, received = self._fresh, self._asker, self._received
        due = max(self._earliest, received) if fresh else self._latest
        self._fresh, self._asker = False, None
        last, self._last_start = self._last_start, start
        if not fresh:
            # No state came when it should have: sleep again.
            self.expected = NEVER
            given = self._given
            given[BEGAN_BY] = given[BEGAN_WITH] = given[BEGAN_AT] = 0
        # A state is not made to wait for a grid: after every hiccup it would be off it.
        self._earliest = start + self._period // 2
        self._latest = start + self._period + (self._grace if fresh else 0)
        cause = self._cause(start)
        self._force = Cause.NONE
        number = hub.judge.guard.cycle
        before = hub.answers.level
        try:
            cause, ended, message = self._judge(cause, number, start, last)
        except Exception as error:  # doubt is a stop
            ended = time.monotonic_ns()
            self.fail("cycle", error, ended)
            cause = Cause.FAULT
            message = hub.answers.write_stop(
                hub.states, number, cause, ended, hub.command.sender
            )
        if asker is not None:
            # Who asked is answered first.
            handed = time.monotonic_ns()
            hub.send(message, asker)
            hub.counters.time(INSIDE, time.monotonic_ns() - received)
            hub.counters.time(HANDED, handed - received)
        for peer in hub.peers.here:
            if peer is asker:
                continue
            if peer.every and number % peer.every == 0:
                hub.send(message, peer)
            elif peer.sender in hub.states.sender:
                hub.send(message, peer)
        if cause != Cause.FAULT:
            self._write_down(ended)
        hub.counters.time(WAKING, start - due)
        self._count(fresh, cause, before, ended - start)

    def _judge(
        self, cause: Cause, number: int, start: int, last: int
    ) -> tuple[Cause, int, memoryview]:
        """Ask the guard.

        Args:
            cause: Why the newest wish does not count, if it does not.
            number: Number of the cycle.
            start: When it began [ns].
            last: When the last one began; 0 if there was none [ns].

        Returns:
            The cause in the end, when it had been judged [ns], and the answer.
        """
        hub, given = self._hub, self._given
        given[CYCLE], given[START], given[CAUSE] = number, start, cause
        given[FLAGS] = HELD if cause else 0
        if start < hub.changed:
            given[FLAGS] |= OBJECTS_CHANGED
        self._given_u[COMMANDER] = hub.command.sender
        hub.judge.ask(cause)
        ended = time.monotonic_ns()
        given[ENDED] = ended
        if last and ended - last > self._limit:
            cause = self._force = Cause.DEADLINE_MISSED
            given[CAUSE] = cause
            given[FLAGS] |= MISSED
            hub.counters.count(DEADLINE_MISSED)
            settings = hub.settings
            sentence = (
                f"a cycle ended {(ended - last) / 1e6:.2f} ms after the last; "
                f"--rate {settings.rate:g} allows {settings.period * 1e3:.2f} ms, and "
                f"--late {settings.late * 1e3:.2f} ms more"
            )
            hub.complaints.name("deadline", sentence, ended)
            hub.judge.tell_again()
        else:
            self._ended_at[ENDED_AT] = ended
        return cause, ended, hub.answers.seal()

    def _cause(self, now: int) -> Cause:
        """Why the newest wish does not count, if it does not."""
        if self._force:
            return self._force
        if self._hub.ordered:
            return self._hub.ordered
        return self._hub.wishes.cause(self._hub.command.sender, now)

    def _write_down(self, ended: int) -> None:
        """Write the cycle into the ring, now that it has been answered."""
        try:
            self._hub.judge.write_down()
        except Exception as error:  # a cycle nobody can look at again: stop
            self.fail("ring", error, ended)

    def _count(self, fresh: bool, cause: Cause, before: int, took: int) -> None:
        """Count a cycle that is over."""
        hub = self._hub
        count = hub.counters.count
        hub.counters.time(JUDGING, took)
        count(CYCLES)
        if not fresh:
            count(CYCLES_WITHOUT_STATE)
        if cause and not cause.stops:
            count(CYCLES_WITHOUT_WISH)
        level = hub.answers.level
        hub.counters.put(LEVEL, level)
        if level >= STOP_LEVEL > before:
            reason = hub.answers.reason
            hub.counters.stop(FIRST_CAUSE + cause if cause.stops else reason)
