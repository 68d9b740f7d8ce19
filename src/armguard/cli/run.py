"""`armguard run`: judge a motion in a scene, report every event."""

from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray
from typer import Option

from armguard.cli.console import (
    STYLES,
    TOO_CLOSE,
    Json,
    RobotOption,
    SceneFile,
    exit_code,
    json_of,
    out,
    plain_table,
    print_json,
    progress_bar,
    say,
    say_progress,
    with_options,
)
from armguard.guard import EventLog, Level
from armguard.guard.answer import Counts
from armguard.recording.motions import load_motion, motion_notes
from armguard.respond import Guard
from armguard.scene import load_scene
from armguard.scene.trajectory import densify
from armguard.simulation.tally import cycle_time_sentence, cycle_times

Floats = NDArray[np.float64]

# Changes of the index that are added up.
CHANGES = ("leaves_entered", "leaves_left", "splits", "merges")

# Levels whose count is printed where it is 0 too.
ALWAYS = (Level.CLEAR, Level.CAUTION, Level.STOP)

# Events a table shows; the JSON has them all.
SHOWN = 40


@dataclass(frozen=True, kw_only=True)
class Options:
    """The command line."""

    scene: SceneFile
    trajectory: Annotated[
        Path,
        Option(
            help="CSV with joint names, NPZ, YAML, a bag of ROS 1 or ROS 2, or a "
            "recording of ours."
        ),
    ]
    topic: Annotated[
        list[str] | None,
        Option(
            help="Topic of a bag; give it once for each arm, as ROBOT=TOPIC where the "
            "joints' names do not name the robot."
        ),
    ] = None
    step: Annotated[
        float,
        Option(
            help="Largest joint step between cycles [rad or m] for a motion without "
            "time: straight lines are walked in such steps."
        ),
    ] = 0.01
    hold_home: Annotated[
        bool, Option(help="Hold joints the motion does not have at home.")
    ] = False
    robot: RobotOption = None
    report: Annotated[
        Path | None, Option(help="Write the report with every event here.")
    ] = None
    json: Json = False


@with_options(Options)
def run(options: Options) -> None:
    """Judge a motion, cycle by cycle. Exit code 0 clear, 1 too close, 2 bad input."""
    loaded = load_scene(options.scene, robot=options.robot, progress=say_progress)
    motion = load_motion(options.trajectory, options.topic or ())
    fill = dict(zip(loaded.q_names, loaded.home.tolist(), strict=True))
    q = motion.for_scene(loaded, fill if options.hold_home else None)
    if motion.stamps is None and not motion.ends_only:
        q = densify(q, options.step)
    guard = Guard(loaded, progress=say)
    notes = [*motion_notes(motion, loaded), *guard.tables.notes]
    log, figures = judged(guard, q, motion.stamps)
    between = None
    if not motion.ends_only and np.isfinite(q).all():
        say("checking the lines between the samples")
        between = guard.check_path(q)
    code = figures["exit_code"]
    if between is not None and not between.clear:
        code = max(code, TOO_CLOSE)
    answer = {
        "scene": options.scene.name,
        "trajectory": options.trajectory.name,
        "notes": notes,
        **figures,
        "exit_code": code,
        "between": None if between is None else between.to_dict(guard.q_names),
    }
    if options.report is not None:
        options.report.write_text(json_of(answer), encoding="utf-8")
    if options.json:
        print_json(answer)
    else:
        if motion.ends_only:
            notes.append("a request has no way between start and goal; both are judged")
        for note in notes:
            say(f"note: {note}")
        print_summary(answer, log)
        if between is not None:
            out.print(between.sentence)
        if options.report is not None:
            out.print(f"report written to {options.report}")
    raise typer.Exit(code)


def judged(
    guard: Guard, q: Floats, stamps: Floats | None
) -> tuple[EventLog, dict[str, Any]]:
    """The events of a motion, and its summary.

    Args:
        guard: The guard.
        q: Configurations, shape (k, n) [rad or m].
        stamps: Time of each [s]; None of a motion without time.
    """
    fixed = all(part.mode == "fixed" for part in guard.tables.robots)
    log, times, counts = EventLog(), list[float](), list[Counts]()
    with progress_bar("judging", len(q)) as advance:
        for k, row in enumerate(q):
            # A recorded motion does not obey, so it is judged place by place.
            verdict = (
                guard.step(row, None if stamps is None else float(stamps[k]))
                if fixed
                else guard.judge_at_rest(row)
            )
            log.add(verdict)
            times.append(verdict.cycle_time)
            counts.append(verdict.counts)
            if k % 100 == 99:
                advance(100)
    return log, summary(log, times, counts)


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
