"""The result of a run: events, levels, times; for people and for programs."""

from math import isfinite
from typing import Any

import numpy as np

from armguard.cli.console import STYLES, exit_code, out, plain_table
from armguard.guard import Event, EventLog, Level
from armguard.guard.verdict import Counts
from armguard.station.simulated.tally import cycle_time_sentence, cycle_times

# Changes of the index that are added up.
CHANGES = ("leaves_entered", "leaves_left", "splits", "merges")

# Levels whose count is printed where it is 0 too.
ALWAYS = (Level.CLEAR, Level.CAUTION, Level.STOP)

# Events a table shows; the JSON has them all.
SHOWN = 40


def summary(
    log: EventLog, durations: list[float], counts: list[Counts]
) -> dict[str, Any]:
    """A run as one JSON object.

    Args:
        log: Its events.
        durations: Duration of each cycle [s].
        counts: What each cycle had to do.
    """
    tested = [c.pairs_tested for c in counts]
    return {
        "cycles": len(durations),
        "levels": {level.name: n for level, n in log.levels.items()},
        "faults": log.faults,
        "least_clearance": log.least_clearance,
        "exit_code": exit_code(log.levels, log.faults),
        "cycle_time_us": cycle_times(durations),
        "pairs_tested": {"mean": float(np.mean(tested)), "max": max(tested)},
        "pairs_checkable": counts[0].pairs_tested + counts[0].pairs_skipped,
        **{name: sum(getattr(c, name) for c in counts) for name in CHANGES},
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
        table = plain_table("level", "cycles", "worst at", "what")
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
        if n or level in ALWAYS
    )
    out.print(f"{answer['cycles']} cycles: {levels}; {log.faults} faults")
    if log.levels[Level.CLEAR] == answer["cycles"]:
        out.print("nothing came within the margin")
    elif isfinite(answer["least_clearance"]):
        out.print(f"least clearance {answer['least_clearance'] * 1e3:.1f} mm")
    times, tested = answer["cycle_time_us"], answer["pairs_tested"]["mean"]
    out.print(
        f"{cycle_time_sentence(times)}; {tested:.1f} of {answer['pairs_checkable']} "
        "pairs measured a cycle"
    )
