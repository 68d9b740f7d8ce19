"""`armguard run`: judge a motion in a scene, report every event."""

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from math import isfinite
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
import typer
from numpy.typing import NDArray
from rich.markup import escape
from typer import Option

from armguard.cli.console import (
    STYLES,
    TOO_CLOSE,
    Json,
    RobotOption,
    SceneFile,
    exit_code,
    json_of,
    loading_bar,
    out,
    plain_table,
    print_json,
    progress_bar,
    say,
    with_options,
)
from armguard.guard import EventLog, Level
from armguard.guard.answer import Counts
from armguard.guard.verdict import Verdict
from armguard.recording.motions import load_motion, motion_notes
from armguard.respond import Guard
from armguard.robot.model import JointKind
from armguard.scene import Scene, Trajectory, load_scene
from armguard.scene.trajectory import densify
from armguard.scene.trajectory_times import check_change, check_unit
from armguard.simulation.tally import cycle_time_sentence, cycle_times

Floats = NDArray[np.float64]

# Verdicts, each with the count of configurations of the file that it completes.
Verdicts = Iterator[tuple[int, Verdict]]

# Least time between two configurations [s]; a division by less is none.
TIME_GRAIN = 1e-9

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
            help="Motion: CSV with joint names, NPZ, YAML, a ROS 1 or ROS 2 bag, or "
            "a recording of armguard."
        ),
    ]
    topic: Annotated[
        list[str] | None,
        Option(
            help="Topic of a bag; repeat it for each arm, as ROBOT=TOPIC if the joint "
            "names do not contain the robot."
        ),
    ] = None
    step: Annotated[
        float,
        Option(
            help="Largest joint step between cycles [rad or m] for a motion without "
            "times; straight lines are divided into such steps."
        ),
    ] = 0.01
    hold_home: Annotated[
        bool, Option(help="Hold joints that the motion lacks at their home position.")
    ] = False
    robot: RobotOption = None
    report: Annotated[
        Path | None, Option(help="JSON file to write, with every event.")
    ] = None
    json: Json = False


@with_options(Options)
def run(options: Options) -> None:
    """Judge a motion, cycle by cycle. Exit code 0 clear, 1 too close, 2 bad input.

    A motion with times is judged with its recorded speeds, as in the loop. A motion
    without times is judged at rest: only distances count, no stopping distances.
    """
    with loading_bar() as progress:
        loaded = load_scene(options.scene, robot=options.robot, progress=progress)
    motion = load_motion(options.trajectory, options.topic or ())
    fill = dict(zip(loaded.q_names, loaded.home.tolist(), strict=True))
    q = motion.for_scene(loaded, fill if options.hold_home else None)
    pace = None if motion.stamps is None else Pace.of(loaded, q, motion)
    between = None
    if pace is None and not motion.ends_only:
        q = densify(q, options.step)
    guard = Guard(loaded, progress=say)
    notes = [*motion_notes(motion, loaded), *guard.tables.notes]
    log, figures = judged(guard, q, motion.stamps)
    if pace is not None:
        figures |= pace.to_dict()
    if not motion.ends_only and np.isfinite(q).all():
        say("checking the lines between the samples")
        between = guard.check_path(q, sensed=False)
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
        out.print(f"judged {answer['judged']}" + ("" if pace is None else f"; {pace}"))
        if between is not None:
            out.print(between.sentence)
        if options.report is not None:
            out.print(f"report written to {options.report}")
    raise typer.Exit(code)


@dataclass(frozen=True)
class Pace:
    """Duration and speeds of a motion with times.

    Attributes:
        duration: Time from the first configuration to the last [s].
        rate: Configurations a second, by the median of their times [Hz].
        top_speeds: Greatest speed in each robot's joints, by unit [rad/s or m/s].
    """

    duration: float
    rate: float
    top_speeds: dict[str, dict[str, float]]

    @classmethod
    def of(cls, scene: Scene, q: Floats, motion: Trajectory) -> Self:
        """The pace of a motion.

        Args:
            scene: The scene.
            q: Its configurations, shape (k, n) [rad or m].
            motion: The same as it was read, with times.

        Raises:
            TrajectoryError: Its times do not change, or look like another unit than
                seconds.
        """
        assert motion.stamps is not None
        passed = np.diff(motion.stamps)
        if not motion.others:
            check_change(motion.source, q, motion.stamps)
        with np.errstate(divide="ignore", invalid="ignore"):
            every = np.abs(np.diff(q, axis=0)) / passed[:, None]
        moved = np.nan_to_num(every, nan=0.0)
        speeds = moved.max(axis=0, initial=0.0)
        found: dict[str, dict[str, float]] = {}
        used: dict[str, float] = {}
        for name, speed in zip(scene.q_names, speeds.tolist(), strict=True):
            robot, joint = name.split("/", 1)
            model = scene.robots[robot].model.joints[joint]
            unit = "m/s" if model.kind is JointKind.PRISMATIC else "rad/s"
            own = found.setdefault(robot, {})
            own[unit] = max(own.get(unit, 0.0), speed)
            if model.velocity:
                used[name] = speed / model.velocity
        period = float(np.median(passed)) if len(passed) else 0.0
        if not motion.unit_known:
            check_unit(motion.source, used, period)
        duration = float(motion.stamps[-1] - motion.stamps[0])
        return cls(duration, 1.0 / period if period else 0.0, found)

    def to_dict(self) -> dict[str, Any]:
        """The same, ready for JSON."""
        return asdict(self)

    def __str__(self) -> str:
        """The same in words."""
        tops = ", ".join(
            f"{robot} {speed:.2f} {unit}"
            for robot, by_unit in self.top_speeds.items()
            for unit, speed in by_unit.items()
        )
        return f"{self.duration:.4g} s, {self.rate:.4g} Hz; top speeds: {tops}"


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
    verdicts: Callable[[Guard, Floats, Floats | None], Verdicts]
    if fixed:
        how, verdicts = "by distances alone, mode fixed", fixed_verdicts
    elif stamps is None:
        how, verdicts = "at rest: no times", rest_verdicts
    else:
        how, verdicts = "with recorded speeds", moving_verdicts
    with progress_bar("judging", len(q)) as advance:
        for rows, verdict in verdicts(guard, q, stamps):
            log.add(verdict)
            times.append(verdict.cycle_time)
            counts.append(verdict.counts)
            if rows:
                advance(rows)
    return log, {"judged": how, **summary(log, times, counts)}


def fixed_verdicts(guard: Guard, q: Floats, stamps: Floats | None) -> Verdicts:
    """Verdicts where no robot's stop is predicted, each with the rows it is for."""
    for k, row in enumerate(q):
        yield 1, guard.step(row, None if stamps is None else float(stamps[k]))


def rest_verdicts(guard: Guard, q: Floats, _: Floats | None) -> Verdicts:
    """Verdicts on robots at rest."""
    for row in q:
        yield 1, guard.judge_at_rest(row)


def moving_verdicts(guard: Guard, q: Floats, stamps: Floats | None) -> Verdicts:
    """Verdicts of a loop at the scene's period, with the recorded speeds.

    Configurations between those of the file are on the straight line. The motion does
    not obey, so stops of earlier cycles do not count.
    """
    assert stamps is not None
    period = guard.tables.period
    # The first configuration has the speeds of the motion that follows it.
    speeds = np.diff(q, axis=0) / np.maximum(np.diff(stamps), TIME_GRAIN)[:, None]
    speeds = np.concatenate([speeds[:1], speeds]) if len(q) > 1 else np.zeros_like(q)
    guard.forget_stops()
    yield 1, guard.step(q[0], float(stamps[0]), velocity=speeds[0])
    for k in range(1, len(q)):
        passed = stamps[k] - stamps[k - 1]
        if not passed > 0.0 and (q[k] == q[k - 1]).all():
            continue
        cycles = max(1, int(np.ceil(passed / period - 1e-6)))
        for n in range(1, cycles + 1):
            guard.forget_stops()
            share = n / cycles
            row = q[k] if n == cycles else q[k - 1] + share * (q[k] - q[k - 1])
            time = float(stamps[k - 1] + share * passed)
            yield int(n == cycles), guard.step(row, time, velocity=speeds[k])


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
        "least_headroom": log.least_headroom,
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
                f"[{STYLES[event.level.name]}]{event.level.name}[/]",
                f"{event.first}-{event.last}",
                str(event.at) if event.stamp is None else f"{event.stamp:.3f} s",
                escape(event.why),
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
    elif isfinite(answer["least_headroom"]):
        out.print(f"least headroom {answer['least_headroom'] * 1e3:.1f} mm")
    times, tested = answer["cycle_time_us"], answer["pairs_tested"]["mean"]
    out.print(
        f"{cycle_time_sentence(times)}; {tested:.1f} of {answer['pairs_checkable']} "
        "pairs measured a cycle"
    )
