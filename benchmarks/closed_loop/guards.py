"""Guards to be attacked: the real one, and others to compare it with."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard import Guard
from armguard.scene import Scene
from closed_loop.answers import STOP, Answer, Graded, Guarding, Said, Why
from closed_loop.scenes import build_scene, declared, movers_of
from closed_loop.settings import Setting

Floats = NDArray[np.float64]


class Blind:
    """Never stops anything."""

    def __init__(self, scene: Scene) -> None:
        self._clear = Said(dict.fromkeys(scene.robots, Graded.CLEAR), Why.OK)
        self._stop = Said(dict.fromkeys(scene.robots, Graded.STOP), Why.TOO_CLOSE)

    def place(self, name: str, T: Floats, stamp: float) -> None:
        """See `Guarding`."""

    def step(self, q: Floats, stamp: Any, *, velocity: Floats, now: float) -> Answer:
        """See `Guarding`."""
        return self._clear

    def reset(self) -> None:
        """See `Guarding`."""


class Keeper(Blind):
    """Never lets go of anything."""

    def step(self, q: Floats, stamp: Any, *, velocity: Floats, now: float) -> Answer:
        """See `Guarding`."""
        return self._stop


class Stopper(Blind):
    """Lets everything go once, to stop it in the next cycle for good."""

    def step(self, q: Floats, stamp: Any, *, velocity: Floats, now: float) -> Answer:
        """See `Guarding`."""
        return self._clear if now == 0.0 else self._stop


class Threshold:
    """Stops every arm as soon as any pair is nearer than a fixed distance.

    Args:
        setting: The setting; its floor is the distance.
    """

    def __init__(self, setting: Setting) -> None:
        scene = build_scene(replace(setting, mode="fixed", top_speed=0.0))
        self._guard = Guard(scene)
        self._robots = tuple(scene.robots)

    def place(self, name: str, T: Floats, stamp: float) -> None:
        """See `Guarding`."""
        self._guard.place(name, T)

    def step(self, q: Floats, stamp: Any, *, velocity: Floats, now: float) -> Answer:
        """See `Guarding`."""
        verdict = self._guard.step(q)
        stop = int(verdict.level) >= STOP
        level = Graded.STOP if stop else Graded.CLEAR
        why = Why.TOO_CLOSE if stop else Why.OK
        return Said(dict.fromkeys(self._robots, level), why, verdict.cycle_time)

    def reset(self) -> None:
        """See `Guarding`."""
        self._guard.reset()


def reference(scene: Scene, setting: Setting) -> Guarding:
    """The slow guard that samples futures; see `reference.py`."""
    from closed_loop.reference import Reference

    figures = declared(setting, scene)
    ordered = [figures[name] for name in scene.robots]
    return Reference(scene, ordered, setting, tuple(movers_of(scene)))


GUARDS: Mapping[str, Callable[[Scene, Setting], Guarding]] = {
    "armguard": lambda scene, setting: Guard(scene, self_test=False),
    "filter": lambda scene, setting: Guard(scene, self_test=False),
    "threshold": lambda scene, setting: Threshold(setting),
    "keeper": lambda scene, setting: Keeper(scene),
    "stopper": lambda scene, setting: Stopper(scene),
    "blind": lambda scene, setting: Blind(scene),
    "reference": reference,
}
