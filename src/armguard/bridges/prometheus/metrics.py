"""Metrics of a service for Prometheus, from its counters and its ring."""

import time
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from prometheus_client import CollectorRegistry, ProcessCollector
from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    InfoMetricFamily,
    Metric,
)

from armguard.guard import layout
from armguard.guard.layout import IN_HEADER, IN_NEAR, IN_ROBOT
from armguard.guard.levels import Reason
from armguard.recording.counters import (
    FINE,
    FIRST_CAUSE,
    HISTOGRAMS,
    CountersReader,
    Histogram,
    bucket_of,
    upper_end,
)
from armguard.recording.frames import Frame, Kind, frame_of
from armguard.recording.ring import RingReader, recorder_age
from armguard.service.wire import Cause

PREFIX = "armguard"

# Meanings of counters; those that go up and down come first.
GAUGES = {
    "senders": "Clients that get messages",
    "level": "Highest level of the last answer, see docs/verdicts.md",
}
COUNTS = {
    "received": "Datagrams that came in",
    "accepted": "Messages that were taken over",
    "states": "States of robots",
    "wishes": "Desired motions of the commander, the messages WISH",
    "calls": "Calls",
    "calls_refused": "Calls that were refused",
    "hellos": "Hellos",
    "claims": "Claims of the command that were granted",
    "claims_refused": "Claims of the command that were refused",
    "stop_orders": "Stops that a client ordered",
    "cycles": "Cycles",
    "cycles_without_state": "Cycles that no new state began",
    "cycles_without_wish": "Cycles without a desired motion",
    "deadline_missed": "Cycles that ended later than their period allows",
    "cycle_faults": "Cycles that ended with an error, which is a stop",
    "sent": "Messages that were sent",
    "send_would_block": "Messages lost because their reader is too slow",
    "send_failed": "Messages that could not be sent",
    "commander_lost": "Commanders that lost the command because they were silent",
    "controllers_silent": "Controllers that fell silent",
    "companions_ended": "Companions that have ended while the service ran",
    "companions_restarted": "Recorders and maps that were started again",
    "cells": "Messages with changes of the map that were taken over",
    "maps": "Maps that began",
}
DROPPED = "dropped_"

TIMES = {
    "inside": "From a message's arrival until the system has sent its answer",
    "handed": "From a message's arrival until its answer is handed to the system",
    "judging": "Judging a cycle",
    "waking": "How late a cycle began",
}

# Edges of Prometheus' buckets: two to each doubling from 4 us to 100 ms. Each is an
# edge of the service's own, finer buckets, so that no count is split.
FIRST, LAST, EACH = 12, 27, 2
EDGES = [
    upper_end(bucket_of((1 << k) + ((1 << k) >> 1) * half) - 1)
    for k in range(FIRST, LAST)
    for half in range(EACH)
]

# The scale starts to be logarithmic below the first edge.
assert FIRST > FINE


def gauge(name: str, meaning: str, value: float) -> Metric:
    """A number that goes up and down."""
    return GaugeMetricFamily(f"{PREFIX}_{name}", meaning, value)


def count(name: str, meaning: str, value: float) -> Metric:
    """A number that only grows."""
    return CounterMetricFamily(f"{PREFIX}_{name}", meaning, value)


def counted(reader: CountersReader) -> Iterator[Metric]:
    """Counters and stops."""
    dropped = CounterMetricFamily(
        f"{PREFIX}_messages_dropped", "Messages that were dropped", labels=["cause"]
    )
    for name, value in reader.values().items():
        if name.startswith(DROPPED):
            dropped.add_metric([name.removeprefix(DROPPED)], value)
        elif name in GAUGES:
            yield gauge(name, GAUGES[name], value)
        else:
            # A counter without a meaning here is published by its name.
            yield count(name, COUNTS.get(name, name.replace("_", " ")), value)
    yield dropped
    stops = CounterMetricFamily(
        f"{PREFIX}_stops", "Stops by their reason", labels=["reason"]
    )
    for number, found in reader.stops().items():
        stops.add_metric([reason_name(number)], found)
    yield stops


def reason_name(number: int) -> str:
    """Name of the reason of a stop, as the service numbers them."""
    try:
        reason: Reason | Cause = (
            Reason(number) if number < FIRST_CAUSE else Cause(number - FIRST_CAUSE)
        )
    except ValueError:
        return str(number)
    return reason.name


def timed(reader: CountersReader) -> Iterator[Metric]:
    """Histograms of times, and the largest value there ever was."""
    most = GaugeMetricFamily(
        f"{PREFIX}_most_seconds",
        "The longest time since the service was started",
        labels=["time"],
    )
    for name in HISTOGRAMS:
        found = reader.histogram(name)
        family = HistogramMetricFamily(
            f"{PREFIX}_{name}_seconds", TIMES.get(name, name)
        )
        family.add_metric([], buckets_of(found), found.total)
        most.add_metric([name], found.most)
        yield family
    yield most


def buckets_of(found: Histogram) -> list[tuple[str, float]]:
    """Cumulative counts by upper edge [s], as Prometheus wants them."""
    sums = np.cumsum(found.counts)
    rows = [(repr(edge * 1e-9), float(sums[bucket_of(edge) - 1])) for edge in EDGES]
    return [*rows, ("+Inf", float(sums[-1]))]


# Metrics of each robot: meaning, and place in the robot's row.
OF_ROBOTS = {
    "level": ("What a robot should do, see docs/verdicts.md", IN_ROBOT.level),
    "speed_scale": ("Share of the speed that the operator may use", IN_ROBOT.scale),
    "urgency": ("How much an operator is warned", IN_ROBOT.urgency),
    "state_age_seconds": ("Age of a robot's state", IN_ROBOT.age),
}

# Metrics of the newest cycle.
OF_CYCLE = {
    "last_cycle": "Number of the newest cycle",
    "last_cycle_age_seconds": "Time since the newest cycle was written; it grows while "
    "the loop is silent",
    "time_left_seconds": "Least time until a stop must be ordered",
    "nearest_headroom_metres": "What the nearest pair has left beyond what it needs; "
    "infinite if nothing is near",
    "nearest_distance_metres": "Signed distance of the nearest pair; infinite if "
    "nothing is near",
    "near_pairs": "Near pairs",
}


class ServiceCollector:
    """Reads counters and ring of a service; the loop does not notice."""

    def __init__(self, counters: CountersReader, ring: RingReader) -> None:
        self._counters, self._ring = counters, ring
        self._robots: list[str] = []
        self._about: dict[str, str] = {}
        self._cycle: Frame | None = None
        for row in ring.unread():
            self._take(row)
            if self._about:
                break

    def describe(self) -> Iterator[Metric]:
        """Nothing: names are not known before there is a cycle."""
        return iter(())

    def collect(self) -> Iterator[Metric]:
        """All metrics as they are now."""
        yield from counted(self._counters)
        yield from timed(self._counters)
        if (row := self._ring.latest()) is not None:
            self._take(row)
        if self._about:
            yield InfoMetricFamily(f"{PREFIX}_scene", "The guarded scene", self._about)
        if self._cycle is not None:
            yield from self._newest(self._cycle)
        if (age := recorder_age(self._ring.path)) is not None:
            meaning = "Time since the recorder had recorded all frames"
            yield gauge("recorder_age_seconds", meaning, age)
        yield count("ring_records", "Records in the ring so far", self._ring.written)

    def _take(self, row: NDArray[np.float64]) -> None:
        """Keep a record of a cycle or of the scene."""
        frame = frame_of(row)
        if frame.kind == Kind.CYCLE:
            self._cycle = frame
        elif frame.kind == Kind.NOTE and frame.text.get("note") == "scene":
            self._robots = list(frame.text["robots"])
            named = ("file", "scene_file"), ("hash", "scene_hash"), ("version",) * 2
            self._about = {name: str(frame.text[key]) for name, key in named}

    def _newest(self, frame: Frame) -> Iterator[Metric]:
        """Metrics of the newest cycle."""
        numbers, robots = frame.verdict, self._robots
        if len(robots) != len(frame.stamps):
            # The note with their names is not in the ring any more.
            robots = [str(r) for r in range(len(frame.stamps))]
        for name, (meaning, place) in OF_ROBOTS.items():
            family = GaugeMetricFamily(
                f"{PREFIX}_robot_{name}", meaning, labels=["robot"]
            )
            for r, robot in enumerate(robots):
                at = layout.HEADER + r * layout.ROBOT_WIDTH + place
                family.add_metric([robot], float(numbers[at]))
            yield family
        values = (
            frame.cycle,
            time.monotonic() - frame.monotonic,
            float(numbers[IN_HEADER.least_time_left]),
            *nearest(frame),
            float(numbers[IN_HEADER.near_count]),
        )
        for (name, meaning), value in zip(OF_CYCLE.items(), values, strict=True):
            yield gauge(name, meaning, value)


def nearest(frame: Frame) -> tuple[float, float]:
    """Headroom and distance of the nearest pair of a cycle [m]."""
    row = int(frame.verdict[IN_HEADER.nearest])
    if row < 0:
        return float("inf"), float("inf")
    first = layout.HEADER + len(frame.stamps) * layout.ROBOT_WIDTH + len(frame.q)
    pair = frame.verdict[first + row * layout.NEAR_WIDTH :]
    return float(pair[IN_NEAR.headroom]), float(pair[IN_NEAR.distance])


def registry_of(
    counters: CountersReader, ring: RingReader, process: int
) -> CollectorRegistry:
    """A registry of a service: its counters, its ring and its process."""
    registry = CollectorRegistry(auto_describe=False)
    registry.register(ServiceCollector(counters, ring))
    ProcessCollector(namespace=PREFIX, pid=lambda: process, registry=registry)
    return registry
