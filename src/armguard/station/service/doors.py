"""What each call stands for."""

import time
from collections.abc import Callable
from typing import Any

from armguard.station.errors import RefusedError
from armguard.station.service.calls import region_of
from armguard.station.service.hub import Hub


def doors_of(
    hub: Hub, order_stop: Callable[[str], None], adopt_scene: Callable[[int], None]
) -> dict[str, Callable[..., Any]]:
    """What is done for each call, by its name.

    Args:
        hub: What all parts of the loop share.
        order_stop: Stops all robots, for whom is told.
        adopt_scene: Takes over what follows from the scene as it is now; told the time,
            monotonic [ns].
    """
    judge = hub.judge

    def engage(name: str | None = None) -> None:
        judge.guard.engage(name)
        hub.ordered = False

    def grasp(robot: str, name: str) -> None:
        judge.guard.grasp(robot, name)

    def allow(a: str, b: str, region: Any = None, **more: float) -> None:
        judge.guard.allow(a, b, region=region_of(region), **more)

    def swap_model(robot: str, model: str) -> None:
        judge.guard.swap_model(robot, model)

    def retreat(name: str | None = None, to: Any = "path") -> None:
        judge.guard.retreat(name, to)

    def field_goal(name: str, q: Any = None, pose: Any = None) -> None:
        judge.guard.field_goal(name, q=q, pose=pose)

    def reset() -> None:
        if not judge.at_rest(hub.states):
            raise RefusedError("a reset is for when every robot rests")
        judge.guard.reset()
        hub.ordered = False

    def configure(response: Any = None, mode: Any = None) -> dict[str, Any]:
        told = judge.configure(hub.states, response, mode)
        adopt_scene(time.monotonic_ns())
        return told

    def stop() -> None:
        order_stop("a call")

    return {
        "engage": engage,
        "grasp": grasp,
        "release": judge.release,
        "allow": allow,
        "swap_model": swap_model,
        "retreat": retreat,
        "field_goal": field_goal,
        "reset": reset,
        "configure": configure,
        "place": judge.place,
        "remove": judge.remove,
        "objects": judge.objects,
        "why": judge.why,
        "stop": stop,
        "ping": lambda: {"cycle": judge.guard.cycle},
    }
