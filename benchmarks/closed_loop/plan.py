"""Which episodes a campaign consists of, and the work of one process."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

from closed_loop.arena import Arena
from closed_loop.episode import Episode
from closed_loop.filtered import FilteredEpisode
from closed_loop.settings import (
    PROFILES,
    SERVO_PROFILES,
    Setting,
    enlarged,
    setting_of,
    understated,
)

# Arenas a process keeps; each holds a guard and a judge.
KEPT = 24


@dataclass(frozen=True, slots=True)
class Plan:
    """A series of episodes.

    Attributes:
        scene: Name of the scene.
        mode: Mode of all robots.
        guard: Name of the guard.
        zero: Term of the budget that is declared as nothing, or None.
        large: Term that is as large, but declared as it is, or None: it shows that the
            term, and not its size, is the cause.
        weak_brake: Factor on the plant's decelerations [-].
        floor: Distance to be kept, in place of the settings' [m], or None.
        duration: Longest time of an episode [s].
        needless: Whether every stop is searched for a future that asked for it.
        plant: "exact" for double integrators, "torque" for arms in MuJoCo that follow
            them with motors of limited torque.
        swing: "onwards" if joints swing beyond their rest only, "both" if back as well.
    """

    scene: str = "bay"
    mode: str = "path"
    guard: str = "armguard"
    zero: str | None = None
    large: str | None = None
    weak_brake: float = 1.0
    floor: float | None = None
    duration: float = 1.0
    needless: bool = False
    plant: str = "exact"
    swing: str = "onwards"

    @property
    def name(self) -> str:
        """One word that tells plans apart; the name of a file."""
        parts = [self.scene, self.mode, self.guard]
        parts += [f"zero-{self.zero}"] if self.zero else []
        parts += [f"large-{self.large}"] if self.large else []
        parts += [f"weak-{self.weak_brake:g}"] if self.weak_brake != 1.0 else []
        parts += [f"floor-{1e3 * self.floor:g}"] if self.floor is not None else []
        parts += [self.plant] if self.plant != "exact" else []
        parts += [f"swing-{self.swing}"] if self.swing != "onwards" else []
        parts += ["needless"] if self.needless else []
        parts += [f"for-{self.duration:g}"] if self.duration != 1.0 else []
        return "_".join(parts)

    def truth_and_declared(self, seed: int) -> tuple[Setting, Setting]:
        """What is true in an episode, and what is declared to the guard."""
        profiles = SERVO_PROFILES if self.plant == "torque" else PROFILES
        truth = setting_of(self.scene, self.mode, seed, profiles)
        if self.floor is not None:
            truth = replace(truth, floor=self.floor)
        term = self.zero or self.large
        if term:
            truth = enlarged(truth, term)
        return truth, understated(truth, self.zero) if self.zero else truth


_arena = lru_cache(KEPT)(Arena)


def arena_of(plan: Plan, seed: int) -> Arena:
    """The arena of an episode; built once in a process."""
    return _arena(*plan.truth_and_declared(seed), plan.guard)


def work(task: tuple[Plan, int]) -> Mapping[str, Any]:
    """Figures of one episode."""
    plan, seed = task
    term = plan.zero or plan.large
    # Who breaks his word does so in every way at once.
    attack = term is not None or plan.weak_brake != 1.0
    kind = FilteredEpisode if plan.guard == "filter" else Episode
    episode = kind(
        arena_of(plan, seed),
        seed,
        duration=plan.duration,
        attack=attack,
        weak=plan.weak_brake,
        zeroed=plan.zero,
        large=plan.large,
        needless=plan.needless,
        limited=plan.plant == "torque",
        swings_back=plan.swing == "both",
    )
    return episode.run().to_dict()
