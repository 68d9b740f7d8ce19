"""Episodes in several processes, one line of JSON each; what is done stays done."""

import json
import multiprocessing
from collections.abc import Iterator
from pathlib import Path
from time import monotonic
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from closed_loop.plan import Plan, work

# Longest an episode may take before the campaign counts as hung: the first of a process
# builds its scene, and may compile [s].
PATIENCE = 900.0


def finished(path: Path) -> dict[int, dict[str, Any]]:
    """Episodes of a file by seed; a line that was cut off is left out."""
    found = {}
    if path.exists():
        for line in path.read_text("utf-8").splitlines():
            try:
                episode = json.loads(line)
            except json.JSONDecodeError:
                continue
            found[episode["seed"]] = episode
    return found


def run_plan(
    plan: Plan,
    episodes: int,
    folder: Path,
    *,
    first: int = 0,
    processes: int = 2,
    seconds: float | None = None,
) -> list[dict[str, Any]]:
    """Run the episodes of a plan that are not done yet; figures of all, by seed.

    Args:
        plan: What to run.
        episodes: How many, from the first seed on.
        folder: Where lines of finished episodes are kept, a file for each plan.
        first: First seed.
        processes: How many work at a time; 1 works in this one.
        seconds: Time after which no new figures are waited for [s]; None for no end.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{plan.name}.jsonl"
    done = finished(path)
    if path.exists() and not path.read_bytes().endswith(b"\n"):
        # A line that was cut off must not spoil the next one.
        with path.open("a", encoding="utf-8") as file:
            file.write("\n")
    seeds = range(first, first + episodes)
    tasks = [(plan, seed) for seed in seeds if seed not in done]
    end = None if seconds is None else monotonic() + seconds
    with path.open("a", encoding="utf-8") as file, bar() as progress:
        shown = progress.add_task(
            plan.name, total=episodes, completed=episodes - len(tasks), contacts=0
        )
        contacts = sum(done[s]["contact"] is not None for s in seeds if s in done)
        progress.update(shown, contacts=contacts)
        for episode in figures(tasks, processes):
            done[episode["seed"]] = episode
            file.write(json.dumps(episode) + "\n")
            file.flush()
            contacts += episode["contact"] is not None
            progress.update(shown, advance=1, contacts=contacts)
            if end is not None and monotonic() > end:
                break
    return [done[seed] for seed in seeds if seed in done]


def figures(tasks: list[tuple[Plan, int]], processes: int) -> Iterator[dict[str, Any]]:
    """Figures of episodes as they become ready."""
    if processes == 1 or len(tasks) < 2:
        yield from map(work, tasks)
        return
    context = multiprocessing.get_context("spawn")
    with context.Pool(processes) as pool:
        answers = pool.imap_unordered(work, tasks)
        for _ in tasks:
            yield answers.next(timeout=PATIENCE)


def bar() -> Progress:
    """The progress bar, on standard error."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[contacts]} contacts"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=Console(stderr=True),
    )
