"""`armguard demo`: two arms in the paper's bay, cycle by cycle."""

from itertools import cycle as repeat
from itertools import islice
from time import perf_counter, sleep
from typing import Annotated

import typer
from rich.live import Live
from rich.text import Text

from armguard.cli.console import STYLES, JsonOption, out, print_json, say
from armguard.cli.summary import event_line, print_summary, summary
from armguard.guard import EventLog, Verdict
from armguard.guard.verdict import Counts
from armguard.respond import Guard
from armguard.scene.bay import TASKS, bay_scene, bay_task

# Redraws of the status line a second; the guard runs at its own rate.
REDRAWS = 20


def demo(
    task: Annotated[
        int, typer.Option(help=f"Bundled task, by its length: {TASKS}.")
    ] = 700,
    cycles: Annotated[
        int | None,
        typer.Option(min=1, help="Cycles to run; a longer run repeats the task."),
    ] = None,
    headless: Annotated[
        bool, typer.Option(help="As fast as it goes, without a live display.")
    ] = False,
    json: bool = JsonOption,
) -> None:
    """Guard two seven-joint arms in the paper's space-station bay."""
    motion = bay_task(task)
    guard = Guard(bay_scene(), progress=say)
    q = motion.q[:, [motion.names.index(name) for name in guard.q_names]]
    total = len(q) if cycles is None else cycles
    period = 0.0
    if motion.stamps is not None and not (headless or json):
        period = float(motion.stamps[1] - motion.stamps[0])
    log, times, counts = EventLog(), list[float](), list[Counts]()
    if not json:
        out.print(
            f"bay: {len(guard.tables.kinds)} primitives, "
            f"{guard.tables.moving_count} of them moving, "
            f"{guard.tables.checkable_pairs} pairs to check; buffer "
            f"{guard.tables.buffers.max() * 1e3:.1f} mm; task of {task} cycles"
        )
    start = perf_counter()
    with Live(console=out, refresh_per_second=REDRAWS, transient=True) as live:
        for k, configuration in enumerate(islice(repeat(q), total)):
            verdict = guard.step(configuration, stamp=k * period if period else None)
            times.append(verdict.cycle_time)
            counts.append(verdict.counts)
            event = log.add(verdict)
            if event is not None and not json:
                live.console.print(event_line(event))
            if period:
                live.update(status(k, total, verdict))
                sleep(max(start + (k + 1) * period - perf_counter(), 0.0))
    answer = {"scene": "bay", "task": task, **summary(log, times, counts)}
    if json:
        print_json(answer)
    else:
        print_summary(answer, log)


def status(k: int, total: int, verdict: Verdict) -> Text:
    """The line that follows the motion."""
    level = verdict.level
    return Text(
        f"cycle {k + 1:5d}/{total}  {level.name:13} {verdict.why}", style=STYLES[level]
    )
