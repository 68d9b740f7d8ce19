"""Everything that is told about a service, gathered when somebody asks."""

from collections.abc import Iterator

from prometheus_client import CollectorRegistry, ProcessCollector
from prometheus_client.core import CounterMetricFamily, Metric

from armguard.station.exporter.families import PREFIX, counted, timed
from armguard.station.exporter.newest import Newest
from armguard.station.ring import RingReader
from armguard.station.service.counters import CountersReader


class ServiceCollector:
    """Reads counters and ring of a service; the loop does not notice.

    Args:
        counters: What it counts.
        ring: What it writes down.
    """

    def __init__(self, counters: CountersReader, ring: RingReader) -> None:
        self._counters = counters
        self._ring = ring
        self._newest = Newest(ring)

    def describe(self) -> Iterator[Metric]:
        """Nothing: names are not known before there is a cycle."""
        return iter(())

    def collect(self) -> Iterator[Metric]:
        """All metrics as they are now."""
        yield from counted(self._counters)
        yield from timed(self._counters)
        yield from self._newest.collect()
        yield CounterMetricFamily(
            f"{PREFIX}_ring_records", "Records in the ring so far", self._ring.written
        )


def registry_of(
    counters: CountersReader, ring: RingReader, process: int
) -> CollectorRegistry:
    """A registry of a service: what it tells, and what its process costs.

    Args:
        counters: What it counts.
        ring: What it writes down.
        process: Its process.
    """
    registry = CollectorRegistry(auto_describe=False)
    registry.register(ServiceCollector(counters, ring))
    ProcessCollector(namespace=PREFIX, pid=lambda: process, registry=registry)
    return registry
