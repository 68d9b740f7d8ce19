"""`armguard run`: judge a motion in a scene, report every event."""

import json as json_format
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from armguard.cli.console import (
    JsonOption,
    jsonable,
    out,
    print_json,
    progress_bar,
    say,
    say_progress,
)
from armguard.cli.summary import print_summary, summary
from armguard.guard import EventLog
from armguard.guard.answer import Counts
from armguard.respond import Guard
from armguard.scene import load_scene
from armguard.scene.trajectory import densify
from armguard.station.motions import load_motion, motion_notes


def run(
    scene: Annotated[Path, typer.Argument(help="Scene file: ours, or MoveIt's.")],
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
    robot: Annotated[
        str | None, typer.Option(help="URDF for a MoveIt scene, or a robot's name.")
    ] = None,
    report: Annotated[
        Path | None, typer.Option(help="Write the report with every event here.")
    ] = None,
    json: bool = JsonOption,
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
    fixed = all(part.mode == "fixed" for part in guard.tables.robots)
    log, times, counts = EventLog(), list[float](), list[Counts]()
    with progress_bar("judging", len(q)) as advance:
        for k, configuration in enumerate(q):
            stamp = None if motion.stamps is None else float(motion.stamps[k])
            # A recorded motion does not obey, so it is judged place by place.
            verdict = (
                guard.step(configuration, stamp)
                if fixed
                else (guard.judge_at_rest(configuration))
            )
            log.add(verdict)
            times.append(verdict.cycle_time)
            counts.append(verdict.counts)
            if k % 100 == 99:
                advance(100)
    between = None
    if not motion.ends_only and np.isfinite(q).all():
        say("checking the lines between the samples")
        between = guard.check_path(q)
    answer = {
        "scene": scene.name,
        "trajectory": trajectory.name,
        "notes": notes,
        **summary(log, times, counts),
        "between": None if between is None else between.to_dict(guard.q_names),
    }
    if between is not None and not between.clear:
        answer["exit_code"] = max(int(str(answer["exit_code"])), 1)
    if report is not None:
        text = json_format.dumps(jsonable(answer), indent=1)
        report.write_text(text + "\n", encoding="utf-8")
    if json:
        print_json(answer)
    else:
        for note in notes:
            say(f"note: {note}")
        if motion.ends_only:
            say("note: a request has no way between start and goal; both are judged")
        print_summary(answer, log)
        if between is not None:
            out.print(between.sentence)
        if report is not None:
            out.print(f"report written to {report}")
    raise typer.Exit(int(str(answer["exit_code"])))
