"""What a run came to, counted from the frames of its guard."""

from collections import Counter
from collections.abc import Sequence
from math import inf
from typing import Any

import numpy as np

from armguard.guard import EventLog, Level
from armguard.guard.answer import Names, names_of
from armguard.guard.events import Event
from armguard.guard.layout import HEADER, IN_ROBOT, ROBOT_WIDTH
from armguard.guard.levels import Reason
from armguard.guard.verdict import Verdict
from armguard.recording.frames import Form, Frame
from armguard.respond.command import Action, Command
from armguard.scene.tables import SceneTables

# An arm moves if one of its joints is faster than this [rad/s or m/s].
MOVES = 0.02

# A command differs from the desired velocities if a joint differs by more [rad/s or
# m/s].
DEFLECTED = 0.05

# Reasons of stops that come from a computer with other work to do.
LATE_REASONS = (Reason.CYCLE_LATE, Reason.DEADLINE_MISSED, Reason.STATE_STALE)


class Tally:
    """Counts frames of cycles.

    Attributes:
        log: Events from `Level.SLOW` on.
        stops: Stops that were ordered, by robot and reason.
        deflected: Cycles whose commands differ from the desired velocities.
        delay: Greatest delay of a cycle beyond its period [s].
        late: The delay that the scene permits [s].
        too_busy: Whether a cycle came later than that.
        least: Least distance of a checked pair that was near [m].
        touched: The two sides that touched first; None if nothing did.
        verdict: The newest verdict; None before there is one.
        why: The newest cycle in words: robots that are held first.

    Args:
        tables: The scene.
    """

    def __init__(self, tables: SceneTables) -> None:
        self.log = EventLog(Level.SLOW)
        self.stops: Counter[tuple[str, str]] = Counter()
        self.deflected = 0
        self.delay = 0.0
        self.least = inf
        self.touched: tuple[str, str] | None = None
        self.verdict: Verdict | None = None
        self.why = ""
        self._robots = tables.robots
        self.late = tables.late
        self._period = tables.period
        # Times of the last cycle, and of the last one that came too late [s].
        self._now = inf
        self.too_busy = False
        self._names: Names = names_of(tables)
        self._times: list[float] = []
        self._moving = np.zeros(len(self._robots), dtype=np.int64)
        self._stopped = dict.fromkeys((part.name for part in self._robots), True)

    @property
    def cycles(self) -> int:
        """Cycles so far."""
        return len(self._times)

    def add(self, frame: Frame) -> Event | None:
        """Count a cycle.

        Returns:
            The event that has ended; None if none has.
        """
        fault = str(frame.text.get("fault", ""))
        verdict = Verdict(
            frame.verdict, self._names, frame.now, frame.cycle_time, fault
        )
        self.verdict, self.why = verdict, verdict.why
        self._times.append(frame.cycle_time)
        now = frame.monotonic
        delay = now - self._now - self._period
        self.delay, self._now = max(self.delay, delay), now
        if delay > self.late or verdict.reason in LATE_REASONS:
            self.too_busy = True
        if frame.velocity is not None:
            for r, part in enumerate(self._robots):
                first = part.first_joint
                own = frame.velocity[first : first + part.joint_count]
                self._moving[r] += bool((np.abs(own) > MOVES).any())
        if len(frame.told):
            command = Command(frame.told, self._robots, verdict)
            self.why = command.why
            self._count_stops(command)
            if frame.form is Form.VELOCITIES:
                off = np.abs(command.velocity - frame.asked)
                self.deflected += bool((off > DEFLECTED).any())
        if verdict.level > Level.CLEAR:
            self._look_at_pairs(verdict)
        return self.log.add(verdict)

    def summary(self) -> dict[str, Any]:
        """The same as one JSON object."""
        total = max(self.cycles, 1)
        return {
            "cycles": self.cycles,
            "levels": {level.name: n for level, n in self.log.levels.items()},
            "stops": [
                {"robot": robot, "reason": reason, "count": count}
                for (robot, reason), count in sorted(self.stops.items())
            ],
            "deflected": self.deflected / total,
            "greatest_delay": self.delay,
            "moving": {
                part.name: float(n / total)
                for part, n in zip(self._robots, self._moving, strict=True)
            },
            "least_distance": self.least,
            "touched": self.touched,
            "cycle_time_us": cycle_times(self._times or [0.0]),
            "events": [event.to_dict() for event in self.log.events],
        }

    def _count_stops(self, command: Command) -> None:
        """Count robots that begin to stop in this cycle, each with its reason."""
        numbers = command.verdict.numbers
        for r, (name, action) in enumerate(command.actions.items()):
            stops = action >= Action.STOP
            if stops and not self._stopped[name]:
                cause = int(numbers[HEADER + r * ROBOT_WIDTH + IN_ROBOT.cause])
                self.stops[name, Reason(cause).name] += 1
            self._stopped[name] = stops

    def _look_at_pairs(self, verdict: Verdict) -> None:
        """Keep how near anything came that has no contract to touch."""
        for pair in verdict.near:
            if pair.contract:
                continue
            self.least = min(self.least, pair.distance)
            if not pair.distance > 0.0 and self.touched is None:
                self.touched = pair.a, pair.b


def cycle_times(seconds: Sequence[float]) -> dict[str, float]:
    """Median, 99th percentile and maximum of durations [us]."""
    figures = np.percentile(seconds, [50, 99, 100]) * 1e6
    return dict(zip(("median", "p99", "max"), figures.tolist(), strict=True))


def cycle_time_sentence(times: dict[str, float]) -> str:
    """Durations of cycles in words."""
    return (
        f"cycle time median {times['median']:.1f} µs, p99 {times['p99']:.1f} µs, "
        f"max {times['max']:.1f} µs"
    )


def in_words(summary: dict[str, Any]) -> Sequence[str]:
    """A summary as lines for people."""
    total = max(summary["cycles"], 1)
    levels = ", ".join(
        f"{level.lower().replace('_', ' ')} {100.0 * n / total:.1f} %"
        for level, n in summary["levels"].items()
        if n
    )
    moving = ", ".join(f"{k} {100.0 * v:.0f} %" for k, v in summary["moving"].items())
    names = {reason.name for reason in LATE_REASONS}
    late = sum(e["count"] for e in summary["stops"] if e["reason"] in names)
    others = [e for e in summary["stops"] if e["reason"] not in names]
    count = sum(entry["count"] for entry in others)
    why = ", ".join(f"{e['robot']} {e['count']} × {e['reason']}" for e in others)
    stops = f"{count} stops" + (f" ({why})" if count else "")
    if late:
        stops += f", and {late} because this computer was late"
    near = "nothing came near"
    if np.isfinite(summary["least_distance"]):
        near = f"nearest approach {summary['least_distance'] * 1e3:.1f} mm"
    return [
        f"{summary['cycles']} cycles: {levels}",
        f"{stops}; commands changed in {100.0 * summary['deflected']:.1f} % of cycles",
        f"in motion: {moving}; {near}",
        cycle_time_sentence(summary["cycle_time_us"]),
        "nothing touched"
        if summary["touched"] is None
        else "TOUCHED: {} and {}".format(*summary["touched"]),
    ]
