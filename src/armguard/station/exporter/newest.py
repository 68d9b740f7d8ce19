"""What the newest cycle in the ring says, as families of Prometheus metrics."""

import time
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from prometheus_client.core import GaugeMetricFamily, InfoMetricFamily, Metric

from armguard.guard import layout
from armguard.station.exporter.families import PREFIX
from armguard.station.frames import Frame, Kind, frame_of
from armguard.station.ring import RingReader

Floats = NDArray[np.float64]

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


class Newest:
    """The newest cycle, as long as there is one.

    Attributes:
        ring: The ring.
    """

    def __init__(self, ring: RingReader) -> None:
        self.ring = ring
        self._robots: tuple[str, ...] = ()
        self._about: dict[str, str] = {}
        self._cycle: Frame | None = None
        for row in ring.unread():
            self._take(row)
            if self._about:
                break

    def collect(self) -> Iterator[Metric]:
        """All of it."""
        row = self.ring.latest()
        if row is not None:
            self._take(row)
        if self._about:
            yield InfoMetricFamily(f"{PREFIX}_scene", "What is guarded", self._about)
        frame = self._cycle
        if frame is None:
            return
        numbers, robots = frame.verdict, len(frame.stamps)
        for name, meaning, place in OF_ROBOTS:
            family = GaugeMetricFamily(f"{PREFIX}_{name}", meaning, labels=["robot"])
            for r, robot in enumerate(self._names(robots)):
                at = layout.HEADER + r * layout.ROBOT_WIDTH + place
                family.add_metric([robot], float(numbers[at]))
            yield family
        clearance, distance = nearest(frame)
        for name, meaning, value in (
            ("last_cycle", "Number of the newest cycle", float(frame.cycle)),
            (
                "last_cycle_age_seconds",
                "Time since the newest cycle was written; it grows while the loop is "
                "silent",
                time.monotonic() - frame.monotonic,
            ),
            (
                "slack_seconds",
                "Least time until a stop must be ordered",
                float(numbers[layout.SLACK_TIME]),
            ),
            (
                "nearest_clearance_metres",
                "What the nearest pair has left beyond what it needs; infinite if "
                "nothing is near",
                clearance,
            ),
            (
                "nearest_distance_metres",
                "Signed distance of the nearest pair; infinite if nothing is near",
                distance,
            ),
            ("near_pairs", "Near pairs", float(numbers[layout.NEAR_COUNT])),
        ):
            yield GaugeMetricFamily(f"{PREFIX}_{name}", meaning, value)

    def _take(self, row: Floats) -> None:
        """Remember what a record says of cycles and of the scene."""
        frame = frame_of(row)
        if frame.kind == Kind.CYCLE:
            self._cycle = frame
        elif frame.kind == Kind.NOTE and frame.text.get("note") == "scene":
            self._robots = tuple(frame.text["robots"])
            self._about = {
                "file": str(frame.text["scene_file"]),
                "hash": str(frame.text["scene_hash"]),
                "version": str(frame.text["version"]),
            }

    def _names(self, robots: int) -> Sequence[str]:
        """Names of robots; their numbers if the ring does not tell them any more."""
        if len(self._robots) == robots:
            return self._robots
        return [str(r) for r in range(robots)]


def nearest(frame: Frame) -> tuple[float, float]:
    """Clearance and distance of the nearest pair of a cycle [m]."""
    row = int(frame.verdict[layout.NEAREST])
    if row < 0:
        return float("inf"), float("inf")
    first = layout.HEADER + len(frame.stamps) * layout.ROBOT_WIDTH + len(frame.q)
    pair = frame.verdict[first + row * layout.NEAR_WIDTH :]
    return float(pair[layout.CLEARANCE]), float(pair[layout.WITNESS])
