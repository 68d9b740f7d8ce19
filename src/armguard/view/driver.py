"""Makes one desired motion of all inputs of the page, and sends it at a steady rate.

Nothing here is judged or held back: that is the loop's business. Inputs are dropped
that have no owner any more: a handle that was released, a page that is gone.
"""

import threading
import time
from collections.abc import Callable, Mapping
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from viser.transforms import SO3

from armguard.guard.levels import Level
from armguard.recording.frames import Frame
from armguard.respond.command import Blocked
from armguard.scene.tables import SceneTables
from armguard.view.commander import Commander, DesiredMotion
from armguard.view.jog import HELD, Jog
from armguard.view.world import World, levels_of, tool_pose

Floats = NDArray[np.float64]

# Time between two desired motions [s]; well within a commander's watchdog.
PERIOD = 0.02

# Where no page lives for so long, inputs that one has begun are ended [s].
LEFT = 2.0


# Desired positions are at most so many steps ahead of where the joints are.
AHEAD = 8.0

# A tool that is near its target is led there in proportion [1/s].
APPROACH = 4.0

# A joint has reached its target within this [rad or m].
REACHED = 2e-3

# Fastest motion of a tool by keys and handles [m/s], [rad/s].
LINEAR, ANGULAR = 0.30, 1.0

# Heartbeat of a page that never lived.
NEVER = -float("inf"), False


class TeleOperator(Protocol):
    """A program that drives in the operator's place, see `simulated.Operator`."""

    def drive(
        self, t: float, q: Floats, blocked: Mapping[str, Blocked]
    ) -> tuple[Floats, list[str]]:
        """Desired velocities, shape (n,), and robots to be engaged."""


class Heartbeats:
    """When each page last lived, and when a pointer was last held down in it.

    Args:
        clock: The present [s].
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._newest: dict[str, tuple[float, bool]] = {}

    def beat(self, page: str, held: bool) -> None:
        """Take a heartbeat of a page; `held` says that a pointer is down in it."""
        self._newest[page] = self._clock(), held

    def end(self, page: str) -> None:
        """Forget a page that was closed."""
        self._newest.pop(page, None)

    def holds(self, page: str) -> bool:
        """Whether a pointer is held down in a page."""
        held = self._newest.get(page, NEVER)[1]
        return held and self.silence(page) <= HELD

    def silence(self, page: str | None = None) -> float:
        """Time since a page lived, or any; infinite if none did [s]."""
        # Copied at once: another thread may add a page.
        newest = self._newest.copy()
        pages = newest if page is None else (page,)
        beats = (newest.get(each, NEVER)[0] for each in pages)
        return self._clock() - max(beats, default=NEVER[0])


class Driver:
    """The operator's inputs: handles before keys before sliders before the tele-driver.

    A handle leads while its page says that it is held; sliders and the tele-driver lead
    while a page lives, and end when none has for some seconds.

    Attributes:
        chosen: Place of the robot that keys lead.
        share: Share of the greatest speeds that is desired at most [-].
        tele: The tele-driver, which drives where no other input does; None if off.
        heartbeats: Heartbeats of pages.

    Args:
        world: The scene.
        newest: Gives the newest cycle, None before there is one.
        commander: Takes desired motion and stops.
    """

    def __init__(
        self, world: World, newest: Callable[[], Frame | None], commander: Commander
    ) -> None:
        self.world, self._newest, self._commander = world, newest, commander
        self.tables = world.tables
        self.chosen, self.share = 0, 0.5
        self.tele: TeleOperator | None = None
        self.jog = Jog(commander.stop, self._choose)
        self.heartbeats = Heartbeats()
        self._targets = np.full(len(self.tables.q_names), np.nan)
        self._ramp: Floats | None = None
        self._slider_page = ""
        self._handles: dict[str, tuple[Floats, str]] = {}
        self._fastest = top_speeds(self.tables)
        self._began = time.monotonic()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="drive", daemon=True)

    def start(self) -> None:
        """Send from now on, while the page has the command."""
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
            T: The frame; None to release the tool.
            page: The page; that it says so counts as its heartbeat.
        """
        if T is None:
            self._handles.pop(robot, None)
        else:
            self.heartbeats.beat(page, held=True)
            self._handles[robot] = T, page

    def leads_tool(self, robot: str) -> bool:
        """Whether a robot's tool is being led."""
        return robot in self._handles

    def page_closed(self, page: str) -> None:
        """End the inputs of a page; with the last page all inputs end."""
        self.heartbeats.end(page)
        self.jog.release()
        if self.heartbeats.silence() > LEFT:
            self.release()
            self.tele = None

    def release(self) -> None:
        """Desire no motion any more."""
        self._targets[:] = np.nan
        self._handles.clear()
        self.jog.release()

    def desired(self, frame: Frame) -> DesiredMotion:
        """The desired motion, where the arms are as a cycle had them."""
        still, beats = np.zeros(len(self._targets)), self.heartbeats
        self._drop_targets(frame)
        self._drop_unattended()
        if self._handles:
            parts = {part.name: part for part in self.tables.robots}
            twists = {}
            for name, (target, _) in tuple(self._handles.items()):
                T = tool_pose(self.tables, parts[name], frame.poses)
                twists[name] = twist_towards(T, target, self.share)
            return DesiredMotion(still, twists=twists)
        direction = self.jog.direction
        if direction.any():
            twist = direction * self.share * np.repeat([LINEAR, ANGULAR], 3)
            name = self.tables.robots[self.chosen].name
            return DesiredMotion(still, twists={name: twist})
        led = np.isfinite(self._targets).any()
        if led and beats.silence(self._slider_page) <= HELD:
            step = self.share * self._fastest * PERIOD
            last = frame.q if self._ramp is None else self._ramp
            self._ramp = ramped(last, self._targets, frame.q, step)
            return DesiredMotion(still, positions=self._ramp)
        self._ramp = None
        if self.tele is None or beats.silence() > HELD:
            return DesiredMotion(still)
        command = self.world.cycle(frame).command
        blocked = {} if command is None else command.blocked
        now = frame.monotonic - self._began
        velocities, engaged = self.tele.drive(now, frame.q, blocked)
        return DesiredMotion(velocities, engaged=tuple(engaged))

    def _drop_targets(self, frame: Frame) -> None:
        """Forget joints that have reached their targets, or whose robot was stopped.

        A stop is to be answered by a person, not by a slider that was left behind.
        """
        done = np.abs(self._targets - frame.q) < REACHED
        _, *levels = levels_of(frame, len(self.tables.robots))
        for part, level in zip(self.tables.robots, levels, strict=True):
            if level >= Level.STOP:
                done[part.first_joint : part.first_joint + part.joint_count] = True
        self._targets[done] = np.nan

    def _drop_unattended(self) -> None:
        """Forget the inputs of pages that have no heartbeat any more."""
        for robot, (_, page) in tuple(self._handles.items()):
            if not self.heartbeats.holds(page):
                self._handles.pop(robot, None)
        if self.heartbeats.silence(self._slider_page) > LEFT:
            self._targets[:] = np.nan
        if self.heartbeats.silence() > LEFT:
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
            desired = self.desired(frame)
            for robot in desired.engaged:
                # What a person ordered to stop waits for a person.
                self._commander.call("engage", name=robot, ordered=False)
            self._commander.send(desired)


def top_speeds(tables: SceneTables) -> Floats:
    """Declared top speed of each joint, 1 where none is declared, shape (n,)."""
    parts = [
        np.ones(part.joint_count) if part.stopping is None else part.stopping.velocity
        for part in tables.robots
    ]
    return np.concatenate(parts)


def ramped(position: Floats, target: Floats, q: Floats, step: Floats) -> Floats:
    """Next desired positions on the way to a target, shape (n,).

    When the next ones are late, the arm then rests where it was sent last.

    Args:
        position: Positions desired last, shape (n,).
        target: Targets of joints, shape (n,); NaN for one that is to stay.
        q: Measured positions, shape (n,).
        step: How far each may go until the next, shape (n,).
    """
    left = np.where(np.isfinite(target), target - position, 0.0)
    wanted = position + np.clip(left, -step, step)
    # They do not run away from a joint that does not follow.
    return np.asarray(np.clip(wanted, q - AHEAD * step, q + AHEAD * step))


def twist_towards(T: Floats, T_target: Floats, share: float) -> Floats:
    """Twist that leads a frame to another one, shape (6,).

    Args:
        T: The frame in the world, shape (4, 4).
        T_target: Its target, likewise.
        share: Share of the fastest motion [-].
    """
    linear = T_target[:3, 3] - T[:3, 3]
    angular = SO3.from_matrix(T_target[:3, :3] @ T[:3, :3].T).log()
    return np.concatenate(
        [
            limited(APPROACH * linear, share * LINEAR),
            limited(APPROACH * angular, share * ANGULAR),
        ]
    )


def limited(vector: Floats, longest: float) -> Floats:
    """A vector that is no longer than that."""
    length = float(np.linalg.norm(vector))
    return vector if length <= longest else vector * (longest / length)
