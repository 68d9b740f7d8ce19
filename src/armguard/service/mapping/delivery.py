"""Changes of the map, sent again until the service has taken them, and what moves."""

import json
import secrets
import time
from collections import deque
from collections.abc import Callable
from math import inf
from typing import Any

import numpy as np

from armguard.cells.deltas import Delta
from armguard.record import records
from armguard.recording.calls import UpdateClusters
from armguard.sense import Sense
from armguard.service.wire import Kind
from armguard.service.wire.sensing import (
    CELLS,
    MOST_CHANGES,
    MOST_IN_A_CYCLE,
    CellsTaken,
)

# Periods from changes to further ones: a cycle may be half a period late [-].
PACE = 1.5

# While nothing changes, so many words with occupied cells are sent again, and how often
# [s]: readers of the recording that began later get them all in time.
REPEATED, REPEATS = 64, 0.2

# What was not taken for so long is sent again [s].
AGAIN = 0.03

# Least time between two messages of the bodies that move [s].
FOLLOWS = 0.02


class Delivery:
    """Sends changes in numbered messages, no more than the guard takes in a cycle.

    The stamp of a message is that of the changes in all messages up to it. Bodies that
    move are sent after a frame, once: those of the next frame take their place.

    Args:
        sense: Fills the map.
        send: Sends a message of a kind with a payload.
        period: Time between two cycles of the service [s].
        clock: Monotonic clock [s].
    """

    def __init__(
        self, sense: Sense, send: Callable[[Kind, bytes], object], period: float,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:  # fmt: skip
        self._sense, self._send, self._clock = sense, send, clock
        self._pause = PACE * period
        self._stream = secrets.randbits(63) | 1
        self._number = self._taken = 0
        # Messages that are not taken yet, oldest first, and when they were sent.
        self._open: deque[bytes] = deque()
        self._at = self._repeated_at = 0.0
        self._next_word = 0
        self._stamp = sense.sent
        # The frame whose bodies were sent last, when, in how many messages so far, and
        # whether there were any.
        self._frame, self._followed_at, self._calls, self._moves = -inf, 0.0, 0, False

    def take(self, taken: CellsTaken) -> bool:
        """Take the service's answer; False if it does not know this map any more."""
        if taken.stream != self._stream:
            return True
        while self._open and self._taken < taken.number:
            self._open.popleft()
            self._taken += 1
        return taken.number >= self._taken

    def run(self) -> None:
        """Send what is due."""
        now = self._clock()
        self._follow(now)
        if self._open:
            if now - self._at > AGAIN:
                self._at = now
                self._send_open()
            return
        if self._sense.stamp == -inf or now - self._at < self._pause:
            return
        before = self._sense.sent
        changes: Any = self._sense.changes(MOST_IN_A_CYCLE)
        stamp = self._sense.sent
        if not len(changes) and now - self._repeated_at >= REPEATS:
            self._repeated_at, changes = now, self._again()
        if not len(changes) and stamp == self._stamp:
            return
        self._at, self._stamp = now, stamp
        for first in range(0, max(len(changes), 1), MOST_CHANGES):
            some = changes[first : first + MOST_CHANGES]
            last = first + MOST_CHANGES >= len(changes)
            self._number += 1
            head = CELLS.pack(self._stream, self._number, stamp if last else before)
            self._open.append(head + some.tobytes())
        self._send_open()

    def _send_open(self) -> None:
        """Send the messages that are not taken yet."""
        for one in self._open:
            self._send(Kind.CELLS, one)

    def _follow(self, now: float) -> None:
        """Send the bodies that move after a frame, and once that none does any more."""
        if self._sense.stamp == self._frame or now - self._followed_at < FOLLOWS:
            return
        self._frame, found = self._sense.stamp, self._sense.clusters
        if len(found) or self._moves:
            self._followed_at, self._moves = now, len(found) > 0
            self._calls += 1
            call = UpdateClusters(clusters=found)
            words = {"call": call.call, "arguments": call.model_dump()}
            payload = json.dumps({"id": self._calls, **words})
            self._send(Kind.CALL, payload.encode())

    def _again(self) -> Any:
        """Some of the words with occupied cells, as they were sent before."""
        claims = self._sense.cells.claims
        words = np.flatnonzero(claims.occupied.words)
        some = words[words >= self._next_word][:REPEATED]
        self._next_word = int(some[-1]) + 1 if len(some) == REPEATED else 0
        found: Any = records(len(some), Delta)
        found["bits"][:, 0] = claims.occupied.words[some]
        found["bits"][:, 1] = claims.unknown.words[some]
        for name in ("stamp", "error", "motion", "source"):
            found[name] = getattr(claims, name)[some]
        found["word"] = some
        return found
