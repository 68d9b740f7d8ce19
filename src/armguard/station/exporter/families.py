"""What the service counts, as families of Prometheus metrics."""

from collections.abc import Iterator

import numpy as np
from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    Metric,
)

from armguard.guard.levels import Reason
from armguard.station.service.counters import (
    FINE,
    FIRST_CAUSE,
    HISTOGRAMS,
    CountersReader,
    Histogram,
    bucket_of,
    upper_end,
)
from armguard.station.wire.words import Cause

PREFIX = "armguard"

# Counters that go up and down, and what else the plain ones mean.
GAUGES = {
    "senders": "Clients that get messages",
    "level": "Highest level of the last answer, see docs/verdicts.md",
}
COUNTS = {
    "received": "Datagrams that came in",
    "accepted": "Messages that were taken over",
    "states": "States of robots",
    "wishes": "Wishes of the commander",
    "calls": "Calls",
    "calls_refused": "Calls that were refused",
    "hellos": "Hellos",
    "claims": "Claims of the command that were granted",
    "claims_refused": "Claims of the command that were refused",
    "stop_orders": "Stops that somebody ordered",
    "cycles": "Cycles",
    "cycles_without_state": "Cycles that no new state began",
    "cycles_without_wish": "Cycles in which nobody wished for anything",
    "deadline_missed": "Cycles that ended later than their period allows",
    "cycle_faults": "Cycles that ended with an error, which is a stop",
    "sent": "Messages that were sent",
    "send_would_block": "Messages lost because their reader is too slow",
    "send_failed": "Messages that could not be sent",
    "commander_lost": "Commanders that lost the command because they were silent",
    "controllers_silent": "Controllers that fell silent",
    "companions_ended": "Companions that have ended while the service ran",
    "companions_restarted": "Recorders that were started again",
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
            # One that was added to the service is told, if only by its name.
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
