"""Everything that is told about a service, gathered when somebody asks."""

import time
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from prometheus_client import CollectorRegistry, ProcessCollector
from prometheus_client.core import GaugeMetricFamily, InfoMetricFamily, Metric

from armguard.guard import layout
from armguard.station.exporter.families import PREFIX, count, counted, gauge, timed
from armguard.station.frames import Frame, Kind, frame_of
from armguard.station.recorder_pulse import recorder_age
from armguard.station.ring import RingReader
from armguard.station.service.counters import CountersReader

# For each robot: metric, its meaning, its place in the robot's row.
OF_ROBOTS = (
    ("robot_level", "What a robot should do, see docs/verdicts.md", layout.ROBOT_LEVEL),
    (
        "robot_speed_scale",
        "Share of his speed an operator may have",
        layout.ROBOT_SCALE,
    ),
    ("robot_urgency", "How much an operator is warned", layout.ROBOT_URGENCY),
    ("robot_state_age_seconds", "Age of a robot's state", layout.ROBOT_AGE),
)


class ServiceCollector:
    """Reads counters and ring of a service; the loop does not notice.

    Args:
        counters: What it counts.
        ring: What it writes down.
    """

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
            yield InfoMetricFamily(f"{PREFIX}_scene", "What is guarded", self._about)
        if self._cycle is not None:
            yield from self._newest(self._cycle)
        if (age := recorder_age(self._ring.path)) is not None:
            meaning = "Time since all there was had been recorded"
            yield gauge("recorder_age_seconds", meaning, age)
        yield count("ring_records", "Records in the ring so far", self._ring.written)

    def _take(self, row: NDArray[np.float64]) -> None:
        """Remember what a record says of cycles and of the scene."""
        frame = frame_of(row)
        if frame.kind == Kind.CYCLE:
            self._cycle = frame
        elif frame.kind == Kind.NOTE and frame.text.get("note") == "scene":
            self._robots = list(frame.text["robots"])
            named = ("file", "scene_file"), ("hash", "scene_hash"), ("version",) * 2
            self._about = {name: str(frame.text[key]) for name, key in named}

    def _newest(self, frame: Frame) -> Iterator[Metric]:
        """What the newest cycle says."""
        numbers, robots = frame.verdict, self._robots
        if len(robots) != len(frame.stamps):
            # The ring does not tell their names any more.
            robots = [str(r) for r in range(len(frame.stamps))]
        for name, meaning, place in OF_ROBOTS:
            family = GaugeMetricFamily(f"{PREFIX}_{name}", meaning, labels=["robot"])
            for r, robot in enumerate(robots):
                at = layout.HEADER + r * layout.ROBOT_WIDTH + place
                family.add_metric([robot], float(numbers[at]))
            yield family
        yield gauge("last_cycle", "Number of the newest cycle", frame.cycle)
        yield gauge(
            "last_cycle_age_seconds",
            "Time since the newest cycle was written; it grows while the loop is "
            "silent",
            time.monotonic() - frame.monotonic,
        )
        slack = float(numbers[layout.SLACK_TIME])
        yield gauge("slack_seconds", "Least time until a stop must be ordered", slack)
        clearance, distance = nearest(frame)
        yield gauge(
            "nearest_clearance_metres",
            "What the nearest pair has left beyond what it needs; infinite if nothing "
            "is near",
            clearance,
        )
        yield gauge(
            "nearest_distance_metres",
            "Signed distance of the nearest pair; infinite if nothing is near",
            distance,
        )
        yield gauge("near_pairs", "Near pairs", float(numbers[layout.NEAR_COUNT]))


def nearest(frame: Frame) -> tuple[float, float]:
    """Clearance and distance of the nearest pair of a cycle [m]."""
    row = int(frame.verdict[layout.NEAREST])
    if row < 0:
        return float("inf"), float("inf")
    first = layout.HEADER + len(frame.stamps) * layout.ROBOT_WIDTH + len(frame.q)
    pair = frame.verdict[first + row * layout.NEAR_WIDTH :]
    return float(pair[layout.CLEARANCE]), float(pair[layout.WITNESS])


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
