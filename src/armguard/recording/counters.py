"""Counters another process can read while the loop counts: a file in memory.

A row of int64: a head, the counters in the order of `COUNTERS`, the stops by the number
of their reason, then the histograms. Each number is written by the loop alone, in one
piece; a reader needs no lock, and may see one number of a cycle and not yet another.
"""

import mmap
import os
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from armguard.errors import StationError

Longs = NDArray[np.int64]

# What was dropped, by cause: a message is counted under the first one that applies.
DROPS = {
    "too_short": "shorter than a header and a seal",
    "oversized": "longer than any message",
    "magic": "no message of ours",
    "version": "another version of the messages: update armguard where the client runs",
    "length": "states another length than it has",
    "seal": "sealed with another key, or changed on its way",
    "kind": "a kind that clients do not send",
    "session": "of another session of the service: connect again",
    "scene": "made for another scene: connect again",
    "unknown_sender": "from a client that never said hello, or long ago: connect again",
    "address": "from another address than the sender's",
    "replayed": "with a sequence number that was there already",
    "out_of_order": "with a lower sequence number than the last one",
    "payload": "a payload its kind cannot have",
    "robots": "a state of robots that do not exist: "
    "set a bit for each robot of the scene",
    "joints": "another number of joints or tools than the scene has: "
    "send a number for each of `names`",
    "second_controller": "a state of a robot that another controller has: "
    "stop that one first",
    "not_commander": "a desired motion of a client that does not command: "
    "claim the command",
    "wish_not_finite": "a desired motion that holds NaN or infinity: "
    "send finite numbers",
    "too_many_senders": "a hello when there was no room for another client: close one",
    "call_unreadable": "a call that is no JSON of ours: "
    "send an id, a call and its arguments",
    "role": "a kind of message that the sender's key does not allow: use another key",
    "challenge": "a hello whose cookie this service did not give out, or took already",
    "wish_late": "a desired motion that was sent longer ago than its watchdog allows: "
    "check clock and network",
    "call_late": "a call or claim that was sent longer ago than the commander may be "
    "silent: check clock and network",
    "ahead": "a desired motion, call or claim whose stamp is in the future: "
    "check the clock",
    "busy": "one hello or call more than are answered between two heartbeats, or more "
    "changes of the map than are taken in a cycle: send fewer",
    "cells": "changes that no map of this scene makes: check region and clock",
    "cells_order": "changes of a map that do not follow the last ones: "
    "they are sent again",
    "second_map": "of a second process that fills the map: end one of the processes",
}

COUNTERS: tuple[str, ...] = (
    *("received", "accepted", "states", "wishes", "calls", "calls_refused"),
    *("hellos", "claims", "claims_refused", "stop_orders"),
    *("cycles", "cycles_without_state", "cycles_without_wish"),
    *("deadline_missed", "cycle_faults"),
    *("sent", "send_would_block", "send_failed", "senders"),
    *(
        "cells",
        "maps",
        "commander_lost",
        "companions_ended",
        "companions_restarted",
        "level",
    ),
    *(f"dropped_{cause}" for cause in DROPS),
)

# From a message's arrival until the system has its answer's message, and has delivered
# it or woken its reader; judging; how late a cycle began; from a message's
# arrival until its answer is handed to the system.
HISTOGRAMS = ("inside", "judging", "waking", "handed")

# Buckets on a logarithmic scale: 16 for each doubling of nanoseconds, 6 % wide.
FINE = 4
BUCKETS = 48 << FINE
LAST = BUCKETS - 1

# The head: magic, version, counters, histograms, process, start on the wall clock [ns].
HEAD, PROCESS = 8, 4
VERSION = 4
FIRST_WORDS = (0x41524D434E54, VERSION, len(COUNTERS), len(HISTOGRAMS))
# Stops by reason; those that the service has to say itself are `Cause` + FIRST_CAUSE.
REASONS, FIRST_CAUSE = 256, 200

# A histogram: values in each bucket, their number, their sum and the largest one [ns].
SPAN = BUCKETS + 3
COUNT, SUM, MOST = BUCKETS, BUCKETS + 1, BUCKETS + 2

# Where each part begins in the row, and its length.
STOPS_AT = HEAD + len(COUNTERS)
HISTOGRAMS_AT = STOPS_AT + REASONS
WORDS = HISTOGRAMS_AT + len(HISTOGRAMS) * SPAN
PLACE = {name: HEAD + k for k, name in enumerate(COUNTERS)}
FIRST = {name: HISTOGRAMS_AT + k * SPAN for k, name in enumerate(HISTOGRAMS)}


class CountersError(StationError):
    """There are no counters, or of another version."""


def counters_path(ring: Path) -> Path:
    """Where the counters of the service with that ring are."""
    return ring.with_name(ring.name + ".counters")


def bucket_of(nanoseconds: int) -> int:
    """Bucket of a time."""
    if nanoseconds < 1 << FINE:
        return max(nanoseconds, 0)
    shift = nanoseconds.bit_length() - 1 - FINE
    return min(((shift + 1) << FINE) + (nanoseconds >> shift) - (1 << FINE), LAST)


def upper_end(bucket: int) -> int:
    """Where a bucket ends [ns]."""
    if bucket < 1 << FINE:
        return bucket + 1
    shift = (bucket >> FINE) - 1
    return ((bucket & ((1 << FINE) - 1)) + (1 << FINE) + 1) << shift


class Counters:
    """The writing end.

    Args:
        path: The file, made anew.

    Raises:
        CountersError: It cannot be made.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            path.unlink(missing_ok=True)
            handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
            try:
                os.posix_fallocate(handle, 0, WORDS * 8)
                self._map = mmap.mmap(handle, WORDS * 8)
            finally:
                os.close(handle)
        except OSError as error:
            raise CountersError(
                f"{path}: no counters can be made: {error.strerror}"
            ) from error
        self._words = memoryview(self._map).cast("q")
        # The magic number last: a file without it is not read.
        head = (*FIRST_WORDS, os.getpid(), time.time_ns())
        for k in reversed(range(len(head))):
            self._words[k] = head[k]

    def count(self, name: str) -> None:
        """Count one more."""
        self._words[PLACE[name]] += 1

    def put(self, name: str, value: int) -> None:
        """Set a counter that goes up and down."""
        self._words[PLACE[name]] = value

    def value(self, name: str) -> int:
        """A counter."""
        return self._words[PLACE[name]]

    def stop(self, reason: int) -> None:
        """Count an order to stop."""
        self._words[STOPS_AT + min(max(reason, 0), REASONS - 1)] += 1

    def time(self, histogram: str, nanoseconds: int) -> None:
        """Count a time in a histogram."""
        words, first = self._words, FIRST[histogram]
        words[first + bucket_of(nanoseconds)] += 1
        words[first + COUNT] += 1
        words[first + SUM] += nanoseconds
        if nanoseconds > words[first + MOST]:
            words[first + MOST] = nanoseconds

    def close(self) -> None:
        """Remove the file's name; its readers may go on."""
        self.path.unlink(missing_ok=True)
        self._words.release()
        self._map.close()


@dataclass(frozen=True, slots=True)
class Histogram:
    """Times that were counted."""

    counts: Longs  # how many fell into each bucket, shape (BUCKETS,)
    count: int
    total: float  # their sum [s]
    most: float  # the largest one [s]

    def percentile(self, share: float) -> float:
        """Time that a share in [0, 1] of them does not exceed, 6 % too long at most.

        NaN if there are none [s].
        """
        if not self.counts.any():
            return float("nan")
        sums = np.cumsum(self.counts)
        bucket = int(np.searchsorted(sums, share * sums[-1]))
        return min(upper_end(min(bucket, LAST)) * 1e-9, self.most)


class CountersReader:
    """The reading end.

    Args:
        path: See `counters_path`.

    Raises:
        CountersError: There is no such file, or another version wrote it.
    """

    def __init__(self, path: Path) -> None:
        try:
            with path.open("rb") as file:
                self._map = mmap.mmap(file.fileno(), 0, prot=mmap.PROT_READ)
        except (OSError, ValueError) as error:
            raise CountersError(f"{path}: no counters are there: {error}") from error
        self._words = np.frombuffer(self._map, np.int64, len(self._map) // 8)
        if len(self._words) != WORDS or (*self._words[:4].tolist(),) != FIRST_WORDS:
            raise CountersError(f"{path}: these counters are another version's")

    @property
    def process(self) -> int:
        """The process that counts."""
        return int(self._words[PROCESS])

    def value(self, name: str) -> int:
        """A counter."""
        return int(self._words[PLACE[name]])

    def values(self) -> dict[str, int]:
        """All counters by name."""
        found = self._words[HEAD:STOPS_AT].tolist()
        return dict(zip(COUNTERS, found, strict=True))

    def stops(self) -> dict[int, int]:
        """Orders to stop by the number of their reason, those that came at all."""
        found = self._words[STOPS_AT:HISTOGRAMS_AT]
        return {int(k): int(found[k]) for k in np.flatnonzero(found)}

    def histogram(self, name: str) -> Histogram:
        """A histogram, a copy."""
        first = FIRST[name]
        words = self._words[first : first + SPAN].copy()
        return Histogram(
            counts=words[:BUCKETS],
            count=int(words[COUNT]),
            total=float(words[SUM]) * 1e-9,
            most=float(words[MOST]) * 1e-9,
        )
