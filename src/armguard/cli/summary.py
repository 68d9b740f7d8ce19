"""What a run came to: events, levels, times; for people and for programs."""

from math import isfinite
from typing import Any

import numpy as np
from rich.table import Table

from armguard.cli.console import STYLES, exit_code, out
from armguard.guard import Event, EventLog, Level
from armguard.guard.answer import Counts

# Levels whose count is told where it is 0 too.
ALWAYS_TOLD = (Level.CLEAR, Level.CAUTION, Level.STOP)

# Events a table shows; the JSON has them all.
SHOWN = 40


def summary(
    log: EventLog, cycle_times: list[float], counts: list[Counts]
) -> dict[str, Any]:
    """A run as one JSON object.

    Args:
        log: Its events.
        cycle_times: Duration of each cycle [s].
        counts: What each cycle had to do.
    """
    times = np.array(cycle_times) * 1e6
    tested = [c.pairs_tested for c in counts]
    return {
        "cycles": len(cycle_times),
        "levels": {level.name: n for level, n in log.levels.items()},
        "faults": log.faults,
        "least_clearance": log.least_clearance,
        "exit_code": exit_code(log.levels, log.faults),
        "cycle_time_us": {
            "median": float(np.median(times)),
            "p99": float(np.percentile(times, 99)),
            "max": float(times.max()),
        },
        "pairs_tested": {"mean": float(np.mean(tested)), "max": max(tested)},
        "pairs_checkable": counts[0].pairs_tested + counts[0].pairs_skipped,
        "leaves_entered": sum(c.leaves_entered for c in counts),
        "leaves_left": sum(c.leaves_left for c in counts),
        "splits": sum(c.splits for c in counts),
        "merges": sum(c.merges for c in counts),
        "events": [event.to_dict() for event in log.events],
    }


def event_line(event: Event) -> str:
    """An event as one line."""
    time = "" if event.stamp is None else f" {event.stamp:8.3f} s"
    style = STYLES[event.level]
    level = f"[{style}]{event.level.name:13}[/]"
    return f"{level} cycle {event.at:6d}{time}  {event.why}"


def print_summary(answer: dict[str, Any], log: EventLog) -> None:
    """Print a run for people."""
    if log.events:
        table = Table(box=None, pad_edge=False)
        for title in ("level", "cycles", "worst at", "what"):
            table.add_column(title, overflow="fold")
        for event in log.events[:SHOWN]:
            table.add_row(
                f"[{STYLES[event.level]}]{event.level.name}[/]",
                f"{event.first}-{event.last}",
                str(event.at),
                event.why,
            )
        out.print(table)
        if len(log.events) > SHOWN:
            out.print(f"… and {len(log.events) - SHOWN} more events; --json has all")
    levels = ", ".join(
        f"{n} {level.name.lower().replace('_', ' ')}"
        for level, n in log.levels.items()
        if n or level in ALWAYS_TOLD
    )
    out.print(f"{answer['cycles']} cycles: {levels}; {log.faults} faults")
    if log.levels[Level.CLEAR] == answer["cycles"]:
        out.print("nothing came within the margin")
    elif isfinite(answer["least_clearance"]):
        out.print(f"least clearance {answer['least_clearance'] * 1e3:.1f} mm")
    times = answer["cycle_time_us"]
    out.print(
        f"cycle time median {times['median']:.1f} µs, p99 {times['p99']:.1f} µs, "
        f"max {times['max']:.1f} µs; {answer['pairs_tested']['mean']:.1f} of "
        f"{answer['pairs_checkable']} pairs measured a cycle"
    )
