"""`armguard run`: judge a motion in a scene, report every event."""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray

from armguard.cli.console import (
    TOO_CLOSE,
    Json,
    RobotOption,
    SceneFile,
    json_of,
    out,
    print_json,
    progress_bar,
    say,
    say_progress,
)
from armguard.cli.summary import print_summary, summary
from armguard.guard import EventLog
from armguard.guard.verdict import Counts
from armguard.respond import Guard
from armguard.scene import load_scene
from armguard.scene.trajectory import densify
from armguard.station.motions import load_motion, motion_notes

Floats = NDArray[np.float64]


def run(
    scene: SceneFile,
    trajectory: Annotated[
        Path,
        typer.Option(
            help="CSV with joint names, NPZ, YAML, a bag of ROS 1 or ROS 2, or a "
            "recording of ours."
        ),
    ],
    topic: Annotated[
        list[str] | None,
        typer.Option(
            help="Topic of a bag; give it once for each arm, as ROBOT=TOPIC where the "
            "joints' names do not tell the robot."
        ),
    ] = None,
    step: Annotated[
        float,
        typer.Option(
            help="Largest joint step between cycles [rad or m] for a motion without "
            "time: straight lines are walked in such steps."
        ),
    ] = 0.01,
    hold_home: Annotated[
        bool, typer.Option(help="Hold joints the motion does not have at home.")
    ] = False,
    robot: RobotOption = None,
    report: Annotated[
        Path | None, typer.Option(help="Write the report with every event here.")
    ] = None,
    json: Json = False,
) -> None:
    """Judge a motion, cycle by cycle. Exit code 0 clear, 1 too close, 2 bad input."""
    loaded = load_scene(scene, robot=robot, progress=say_progress)
    motion = load_motion(trajectory, topic or ())
    fill = dict(zip(loaded.q_names, loaded.home.tolist(), strict=True))
    q = motion.for_scene(loaded, fill if hold_home else None)
    if motion.stamps is None and not motion.ends_only:
        q = densify(q, step)
    notes = motion_notes(motion, loaded)
    guard = Guard(loaded, progress=say)
    notes += guard.tables.notes
    log, figures = judged(guard, q, motion.stamps)
    between = None
    if not motion.ends_only and np.isfinite(q).all():
        say("checking the lines between the samples")
        between = guard.check_path(q)
    code = figures["exit_code"]
    if between is not None and not between.clear:
        code = max(code, TOO_CLOSE)
    answer = {
        "scene": scene.name,
        "trajectory": trajectory.name,
        "notes": notes,
        **figures,
        "exit_code": code,
        "between": None if between is None else between.to_dict(guard.q_names),
    }
    if report is not None:
        report.write_text(json_of(answer), encoding="utf-8")
    if json:
        print_json(answer)
    else:
        if motion.ends_only:
            notes.append("a request has no way between start and goal; both are judged")
        for note in notes:
            say(f"note: {note}")
        print_summary(answer, log)
        if between is not None:
            out.print(between.sentence)
        if report is not None:
            out.print(f"report written to {report}")
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
