"""Trials in several processes, one line of JSON each; what is done stays done."""

import json
import multiprocessing
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from closed_loop.runs import finished
from reach.answers import answering
from reach.arena import arena_of
from reach.goals import Goal, draw_goal
from reach.slides import SLIDES, slid, start_of
from reach.trial import Trial

# A scene, who answers, what is done ("goals" or "slides"), and a seed.
Task = tuple[str, str, str, int]

# Longest a trial may take; the first of a process may compile [s].
PATIENCE = 1800.0


@lru_cache(maxsize=64)
def goal_of(scene: str, seed: int) -> Goal:
    """The goal of a trial; the same for all who answer."""
    return draw_goal(arena_of(scene), seed)


@lru_cache(maxsize=64)
def slide_start(scene: str, seed: int) -> np.ndarray | None:
    """Where a slide begins; the same for all who answer."""
    return start_of(arena_of(scene), SLIDES[scene], seed)


_answering: dict[tuple[str, str], Any] = {}


def work(task: Task) -> dict[str, Any]:
    """Figures of one trial."""
    scene, answer, what, seed = task
    arena = arena_of(scene)
    if (scene, answer) not in _answering:
        _answering[scene, answer] = answering(arena, answer)
    answers = _answering[scene, answer]
    found: dict[str, Any] = {"scene": scene, "answer": answer, "seed": seed}
    if what == "slides":
        start = slide_start(scene, seed)
        if start is None:
            return {**found, "slide": None}
        return {**found, "slide": slid(arena, SLIDES[scene], start, answers, seed)}
    goal = goal_of(scene, seed)
    found |= {"kind": goal.kind, "road": goal.road, "share": goal.share, "runs": {}}
    if goal.road not in ("straight", "bends"):
        return found
    # A field knows the goal only, not the way to it.
    both = goal.road == "bends" and answer != "field"
    for led in (False, True) if both else (False,):
        operator = goal.operator(arena, led)
        outcome = Trial(arena, seed, goal.start, operator, answers).run()
        found["runs"]["led" if led else goal.road] = outcome.to_dict()
    return found


def run_trials(
    scene: str,
    answer: str,
    what: str,
    count: int,
    folder: Path,
    *,
    processes: int = 1,
    end: float | None = None,
) -> list[dict[str, Any]]:
    """Run the trials that are not done yet; figures of all that are, by seed.

    Args:
        scene: Name of the scene.
        answer: Who answers.
        what: "goals" or "slides".
        count: How many, from seed 0 on.
        folder: Where lines of finished trials are kept.
        processes: How many work at a time.
        end: When no more trials are begun, on the monotonic clock [s].
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{scene}_{answer}_{what}.jsonl"
    done = finished(path)
    if path.exists() and not path.read_bytes().endswith(b"\n"):
        # A line that was cut off must not spoil the next one.
        with path.open("a", encoding="utf-8") as file:
            file.write("\n")
    tasks = [(scene, answer, what, s) for s in range(count) if s not in done]
    with path.open("a", encoding="utf-8") as file:
        for figures in answers_to(tasks, processes, end):
            done[figures["seed"]] = figures
            file.write(json.dumps(figures) + "\n")
            file.flush()
    return [done[seed] for seed in range(count) if seed in done]


def answers_to(
    tasks: list[Task], processes: int, end: float | None
) -> Iterator[dict[str, Any]]:
    """Figures of trials as they become ready."""
    if processes == 1 or len(tasks) < 2:
        for task in tasks:
            if end is not None and monotonic() > end:
                return
            yield work(task)
        return
    context = multiprocessing.get_context("spawn")
    with context.Pool(processes) as pool:
        answers = pool.imap_unordered(work, tasks)
        for _ in tasks:
            yield answers.next(timeout=PATIENCE)
            if end is not None and monotonic() > end:
                return
