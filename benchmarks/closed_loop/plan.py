"""The work of one process: episodes of plans, in arenas that are built once."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from closed_loop.arena import Arena
from closed_loop.episode import Episode
from closed_loop.filtered import FilteredEpisode
from closed_loop.settings import Plan

# Arenas a process keeps; each holds a guard and a judge.
KEPT = 24


_arena = lru_cache(KEPT)(Arena)


def arena_of(plan: Plan, seed: int) -> Arena:
    """The arena of an episode; built once in a process."""
    return _arena(*plan.truth_and_declared(seed), plan.guard)


def work(task: tuple[Plan, int]) -> Mapping[str, Any]:
    """Figures of one episode."""
    plan, seed = task
    kind = FilteredEpisode if plan.guard == "filter" else Episode
    return kind(arena_of(plan, seed), seed, plan=plan).run().to_dict()
