"""Puts together what is asked for, and sends it at a steady rate."""

import threading
import time
from collections.abc import Callable, Mapping
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from armguard.guard.answer import names_of
from armguard.guard.levels import Level
from armguard.respond.command import Blocked
from armguard.scene.tables import SceneTables
from armguard.station.frames import Frame
from armguard.station.view.driving.commander import Commander
from armguard.station.view.driving.jog import Jog
from armguard.station.view.driving.pulses import HELD, LEFT, Pulses
from armguard.station.view.driving.wishes import (
    ANGULAR,
    LINEAR,
    THERE,
    Wish,
    ramped,
    tool_frame,
    top_speeds,
    twist_towards,
)
from armguard.station.view.judged import judged, level_at_a_glance

Floats = NDArray[np.float64]

# Time between two wishes [s]; well within a commander's watchdog.
PERIOD = 0.02


class Hands(Protocol):
    """Somebody who drives in the operator's place, see `simulated.Operator`."""

    def drive(
        self, t: float, q: Floats, blocked: Mapping[str, Blocked]
    ) -> tuple[Floats, list[str]]:
        """Velocities that are asked for, shape (n,), and robots to be engaged."""


class Driver:
    """What the operator asks for: handles before keys before sliders before the tele.

    A handle leads while its page says that it is held; sliders and the tele-driver lead
    while a page says that it lives, and end when none has for some seconds.

    Attributes:
        chosen: Place of the robot that keys lead.
        share: Share of the greatest speeds that is asked for at most [-].
        tele: Who drives where nobody else does; None for nobody.
        pulses: What pages say of themselves.

    Args:
        tables: The scene.
        newest: Gives the newest cycle, None before there is one.
        commander: Where wishes go.
        stopped: Called when somebody asks for a stop.
    """

    def __init__(
        self,
        tables: SceneTables,
        newest: Callable[[], Frame | None],
        commander: Commander,
        stopped: Callable[[], None],
    ) -> None:
        self.tables, self._newest, self._commander = tables, newest, commander
        self.chosen = 0
        self.share = 0.5
        self.tele: Hands | None = None
        self.jog = Jog(stopped, self._choose)
        self.pulses = Pulses()
        self._targets = np.full(len(tables.q_names), np.nan)
        self._ramp: Floats | None = None
        self._slider_page = ""
        self._handles: dict[str, tuple[Floats, str]] = {}
        self._fastest = top_speeds(tables)
        self._names = names_of(tables)
        self._began = time.monotonic()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="drive", daemon=True)

    def start(self) -> None:
        """Send from now on, while the command is ours."""
        self._thread.start()

    def close(self) -> None:
        """Send no more."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(timeout=1.0)

    def lead_joint(self, joint: int, target: float, page: str) -> None:
        """Lead a joint to a position [rad or m], for a page."""
        self._targets[joint], self._slider_page = target, page

    def leads(self, joint: int) -> bool:
        """Whether a joint is being led to a position."""
        return bool(np.isfinite(self._targets[joint]))

    def lead_tool(self, robot: str, T: Floats | None, page: str = "") -> None:
        """Lead a robot's tool to a frame, shape (4, 4), for the page that holds it.

        Args:
            robot: The robot.
            T: The frame; None to let go of the tool.
            page: The page; that it says so counts as its pulse.
        """
        if T is None:
            self._handles.pop(robot, None)
        else:
            self.pulses.hear(page, held=True)
            self._handles[robot] = T, page

    def leads_tool(self, robot: str) -> bool:
        """Whether a robot's tool is being led."""
        return robot in self._handles

    def gone(self, page: str) -> None:
        """A page was closed; with the last one all ends that was asked for."""
        self.pulses.gone(page)
        self.jog.let_go()
        if self.pulses.silence() > LEFT:
            self.let_go()
            self.tele = None

    def let_go(self) -> None:
        """Ask for nothing any more."""
        self._targets[:] = np.nan
        self._handles.clear()
        self.jog.let_go()

    def wish(self, frame: Frame) -> Wish:
        """What is asked for, where the arms are as a cycle had them."""
        still = np.zeros(len(self._targets))
        self._drop_targets(frame)
        self._drop_unattended()
        parts = {part.name: part for part in self.tables.robots}
        if self._handles:
            return Wish(
                still,
                twists={
                    name: twist_towards(
                        tool_frame(self.tables, parts[name], frame.poses), T, self.share
                    )
                    for name, (T, _) in tuple(self._handles.items())
                },
            )
        direction = self.jog.direction
        if direction.any():
            fastest = self.share * np.repeat([LINEAR, ANGULAR], 3)
            name = self.tables.robots[self.chosen].name
            return Wish(still, twists={name: direction * fastest})
        if self.pulses.silence(self._slider_page) <= HELD and self._led.any():
            step = self.share * self._fastest * PERIOD
            last = frame.q if self._ramp is None else self._ramp
            self._ramp = ramped(last, self._targets, frame.q, step)
            return Wish(still, positions=self._ramp)
        self._ramp = None
        if self.tele is not None and self.pulses.silence() <= HELD:
            return self._asked_by(self.tele, frame)
        return Wish(still)

    def _asked_by(self, hands: Hands, frame: Frame) -> Wish:
        """What somebody else asks for, and whom he engages."""
        why = judged(frame, self.tables, self._names).command
        blocked = {} if why is None else why.blocked
        velocities, engaged = hands.drive(
            frame.monotonic - self._began, frame.q, blocked
        )
        return Wish(velocities, engaged=tuple(engaged))

    def _drop_targets(self, frame: Frame) -> None:
        """Forget joints that are where they were to be, or whose robot was stopped.

        A stop is to be answered by somebody, not by a slider that was left behind.
        """
        there = np.abs(self._targets - frame.q) < THERE
        _, *levels = level_at_a_glance(frame, len(self.tables.robots))
        for part, level in zip(self.tables.robots, levels, strict=True):
            if level >= Level.STOP:
                there[part.first_joint : part.first_joint + part.joint_count] = True
        self._targets[there] = np.nan

    @property
    def _led(self) -> NDArray[np.bool_]:
        """Which joints are led to a position, shape (n,)."""
        led: NDArray[np.bool_] = np.isfinite(self._targets)
        return led

    def _drop_unattended(self) -> None:
        """Forget what belongs to a page that says no more of itself."""
        for robot, (_, page) in tuple(self._handles.items()):
            if not self.pulses.holds(page):
                self._handles.pop(robot, None)
        if self._led.any() and self.pulses.silence(self._slider_page) > LEFT:
            self._targets[:] = np.nan
        if self.tele is not None and self.pulses.silence() > LEFT:
            self.tele = None

    def _choose(self, robot: int | None) -> None:
        count = len(self.tables.robots)
        if robot is None:
            self.chosen = (self.chosen + 1) % count
        elif robot < count:
            self.chosen = robot

    def _run(self) -> None:
        while not self._stop.wait(PERIOD):
            self._commander.listen()
            frame = self._newest()
            if frame is None or not self._commander.commands:
                continue
            wish = self.wish(frame)
            for robot in wish.engaged:
                # What a person ordered to stop waits for a person.
                self._commander.call("engage", name=robot, ordered=False)
            self._commander.send(wish)
