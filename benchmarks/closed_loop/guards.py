"""Guards to be attacked: the real one, and others to compare it with."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from typing import Any

from armguard import Guard
from armguard.scene import Scene
from arrays import Floats
from closed_loop.answers import STOP, Guarding
from closed_loop.scenes import build_scene, declared, movers_of
from closed_loop.search import Reference
from closed_loop.settings import Setting


class Keeper(Guarding):
    """Never lets go of anything."""

    def stopped(
        self, q: Floats, stamp: Any, velocity: Floats, now: float
    ) -> Collection[str]:
        """See `Guarding`."""
        return self.robots


class Stopper(Guarding):
    """Lets everything go once, to stop it in the next cycle for good."""

    def stopped(
        self, q: Floats, stamp: Any, velocity: Floats, now: float
    ) -> Collection[str]:
        """See `Guarding`."""
        return self.robots if now > 0.0 else ()


class Threshold(Guarding):
    """Stops every arm as soon as any pair is nearer than a fixed distance.

    Args:
        setting: The setting; its floor is the distance.
    """

    def __init__(self, setting: Setting) -> None:
        scene = build_scene(replace(setting, mode="fixed", top_speed=0.0))
        super().__init__(scene.robots)
        self._guard = Guard(scene)
        self.reset = self._guard.reset

    def place(self, name: str, T: Floats, stamp: float) -> None:
        """See `Guarding`."""
        self._guard.place(name, T)

    def stopped(
        self, q: Floats, stamp: Any, velocity: Floats, now: float
    ) -> Collection[str]:
        """See `Guarding`."""
        return self.robots if self._guard.step(q).level >= STOP else ()


def reference(scene: Scene, setting: Setting) -> Reference:
    """The slow guard that samples futures."""
    figures = declared(setting, scene)
    return Reference(scene, list(figures.values()), setting, tuple(movers_of(scene)))


GUARDS: Mapping[str, Callable[[Scene, Setting], Any]] = {
    "armguard": lambda scene, _: Guard(scene, self_test=False),
    "filter": lambda scene, _: Guard(scene, self_test=False),
    "threshold": lambda _, setting: Threshold(setting),
    "keeper": lambda scene, _: Keeper(scene.robots),
    "stopper": lambda scene, _: Stopper(scene.robots),
    "blind": lambda scene, _: Guarding(scene.robots),
    "reference": reference,
}
