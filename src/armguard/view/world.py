"""A scene, where its objects are at a cycle, and the verdict of that cycle."""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from armguard.geometry.shapes import Shape
from armguard.guard import layout
from armguard.guard.answer import names_of
from armguard.guard.layout import IN_HEADER, IN_ROBOT
from armguard.guard.levels import Level, Reason
from armguard.guard.near_pair import NearPair
from armguard.guard.verdict import Verdict
from armguard.recording.frames import Frame
from armguard.recording.shape_words import shape_of
from armguard.respond import Command
from armguard.scene.compile import compile_scene
from armguard.scene.scene import Scene
from armguard.scene.standing import Standing
from armguard.scene.tables import RobotPart, SceneTables
from armguard.view.sensed_state import SensedState

Floats = NDArray[np.float64]

REVISIONS = itertools.count()


class ObjectPoses:
    """Poses of the objects that can be placed and removed, by the events of frames.

    Attributes:
        poses: Frame of each object, shape (4, 4), by name; None of one that is absent.
        shapes: Shapes of the objects that got another one when they were placed.
        revision: Another number after every change.

    Args:
        scene: The scene, whose objects stand where it says until they are placed.
    """

    def __init__(self, scene: Scene) -> None:
        self.revision = next(REVISIONS)
        self.poses: dict[str, Floats | None] = {
            name: item.pose.matrix() if item.present else None
            for name, item in scene.objects.items()
            if item.attached_to is None
        }
        self.shapes: dict[str, Shape] = {}

    def present(self, name: str, item: Standing) -> Standing:
        """An object of the tables, with the shape that it has now."""
        if name not in self.shapes:
            return item
        return replace(item, shapes=(replace(item.shapes[0], shape=self.shapes[name]),))

    def begin_with(self, objects: Mapping[str, Mapping[str, Any] | None]) -> None:
        """Take over the poses that a service lists."""
        for name, placed in objects.items():
            call = "remove" if placed is None else "place"
            self.apply({"call": call, "name": name, **(placed or {})})

    def apply(self, event: Mapping[str, Any]) -> None:
        """Apply the text of an event's frame; calls of other kinds change nothing."""
        name, call = event.get("name"), event.get("call")
        if name not in self.poses or call not in ("place", "remove"):
            return
        placed = call == "place"
        self.poses[name] = np.array(event["pose"], np.float64) if placed else None
        if placed and event.get("shape") is not None:
            self.shapes[name] = shape_of(event["shape"])
        self.revision = next(REVISIONS)


@dataclass(frozen=True)
class Cycle:
    """A cycle as it was judged.

    Attributes:
        frame: The frame.
        verdict: Its verdict.
        command: What the robots were commanded; None where no motion was requested.
    """

    frame: Frame
    verdict: Verdict
    command: Command | None

    @cached_property
    def pairs(self) -> list[NearPair]:
        """Its near pairs, the one with the least headroom first."""
        return sorted(self.verdict.near, key=lambda pair: pair.headroom)

    @property
    def level(self) -> Level:
        """The highest level; that of a stop at least while a robot is held."""
        held = self.command is not None and bool(self.command.held)
        waits = Level.STOP if held else Level.CLEAR
        return max(self.verdict.level, *self.verdict.levels.values(), waits)


def levels_of(frame: Frame, robots: int) -> tuple[int, ...]:
    """The highest level of a cycle, then that of each robot, without making a verdict.

    Args:
        frame: Frame of a cycle.
        robots: Robots the verdict has a row for.
    """
    own = Reason(int(frame.verdict[IN_HEADER.reason])).level
    step = layout.ROBOT_WIDTH
    first = layout.HEADER + IN_ROBOT.level
    each = frame.verdict[first : first + robots * step : step]
    levels = tuple(int(level) for level in each)
    return (max((int(own), *levels), default=int(Level.CLEAR)), *levels)


def held_in(frame: Frame, robots: int) -> tuple[bool, ...]:
    """Which robots are held in a cycle; none where no motion was requested."""
    if not len(frame.told):
        return ()
    return tuple(np.isfinite(frame.told[-2 * robots : -robots]).tolist())


class World:
    """The scene of the frames, on a page.

    Attributes:
        server: Viser's server.
        scene: The scene as it was loaded.
        tables: The tables that the guard has of it.
        names: Names of its verdicts.
        objects: Poses of objects.
        sensed: Cells and health of sensors.
    """

    def __init__(self, server: viser.ViserServer, scene: Scene) -> None:
        self.server, self.scene = server, scene
        self.tables = compile_scene(scene)
        self.names = names_of(self.tables)
        self.objects, self.sensed = ObjectPoses(scene), SensedState(scene)

    def fits(self, frame: Frame) -> bool:
        """Whether a cycle's frame is about this scene, by its sizes."""
        same = len(frame.q) == len(self.tables.q_names)
        return same and len(frame.poses) == len(self.tables.parent)

    def cycle(self, frame: Frame) -> Cycle:
        """A frame with its verdict and its command."""
        verdict = Verdict(
            frame.verdict,
            self.names,
            float(frame.stamps[0]) if len(frame.stamps) else None,
            frame.cycle_time,
            str(frame.text.get("fault", "")),
        )
        command = Command(frame.told, self.tables.robots, verdict)
        return Cycle(frame, verdict, command if len(frame.told) else None)


def tool_pose(tables: SceneTables, part: RobotPart, poses: Floats) -> Floats:
    """Frame of a robot's tool in the world, shape (4, 4).

    Args:
        tables: The scene.
        part: The robot.
        poses: Poses of all bodies, rows of [R | p], shape (b, 12).
    """
    link = tables.links[part.tool]
    T = np.eye(4)
    T[:3] = poses[link.body].reshape(3, 4)
    return np.asarray(T @ link.T_body_link)
