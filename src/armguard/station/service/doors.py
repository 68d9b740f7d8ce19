"""What each call stands for."""

import time
from collections.abc import Callable
from typing import Any

from armguard.station.errors import RefusedError
from armguard.station.service.calls import region_of
from armguard.station.service.hub import Hub
from armguard.station.service.objects import Objects
from armguard.station.service.peers import Peer
from armguard.station.wire.words import Cause


def doors_of(
    hub: Hub, order_stop: Callable[[str], None], adopt_scene: Callable[[int], None]
) -> dict[str, Callable[..., Any]]:
    """What is done for each call, by its name; given the client that calls first.

    Args:
        hub: What all parts of the loop share.
        order_stop: Stops all robots; given the name of the client that asked for it.
        adopt_scene: Takes over what follows from the scene as it is now; given the
            time, monotonic [ns].
    """
    judge, objects = hub.judge, Objects(hub)

    def engage(peer: Peer, name: str | None = None, ordered: bool = True) -> None:
        judge.guard.engage(name, ordered=ordered is True)
        if ordered is True:
            hub.ordered = Cause.NONE

    def grasp(peer: Peer, robot: str, name: str) -> None:
        judge.guard.grasp(robot, name)

    def release(peer: Peer, robot: str, name: str) -> None:
        judge.release(robot, name)

    def allow(peer: Peer, a: str, b: str, region: Any = None, **more: float) -> None:
        judge.guard.allow(a, b, region=region_of(region), **more)

    def swap_model(peer: Peer, robot: str, model: str) -> None:
        judge.guard.swap_model(robot, model)

    def retreat(peer: Peer, name: str | None = None, to: Any = "path") -> None:
        judge.guard.retreat(name, to)

    def field_goal(peer: Peer, name: str, q: Any = None, pose: Any = None) -> None:
        judge.guard.field_goal(name, q=q, pose=pose)

    def reset(peer: Peer) -> None:
        if not judge.at_rest(hub.states):
            raise RefusedError("a reset is for when every robot rests")
        judge.guard.reset()

    def configure(peer: Peer, response: Any = None, mode: Any = None) -> dict[str, Any]:
        changed = judge.configure(hub.states, response, mode)
        adopt_scene(time.monotonic_ns())
        return changed

    def place(
        peer: Peer,
        name: str,
        pose: Any,
        stamp: float | None = None,
        velocity: Any = None,
        shape: Any = None,
    ) -> None:
        more = {"pose": pose, "stamp": stamp, "velocity": velocity, "shape": shape}
        objects.place(peer, name, more)

    return {
        "engage": engage,
        "grasp": grasp,
        "release": release,
        "allow": allow,
        "swap_model": swap_model,
        "retreat": retreat,
        "field_goal": field_goal,
        "reset": reset,
        "configure": configure,
        "place": place,
        "remove": objects.remove,
        "objects": lambda peer, first=0: judge.objects(first),
        "why": lambda peer: judge.why(),
        "stop": lambda peer: order_stop(peer.name),
        "ping": lambda peer: {"cycle": judge.guard.cycle},
    }
