"""Simulated arms: they are late, inexact and stop as their figures declare."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armguard.errors import SceneError
from armguard.respond.command import Action
from armguard.robot.limits import joint_limits
from armguard.robot.model import RobotModel
from armguard.robot.stopping import StoppingFigures
from armguard.scene.scene import Scene
from armguard.simulation.drives import Drives, Phase

Floats = NDArray[np.float64]

# Longest time for which a joint misses its command by the same error [s].
SAME_MISS = 0.3


@dataclass(frozen=True, slots=True, kw_only=True)
class Imperfection:
    """How much of their declared errors and delays simulated arms use up.

    Attributes:
        errors: Share of the errors of positions, velocities and tracking [-].
        lateness: Share of the delay of commands [-].
        seed: Of the errors.
    """

    errors: float = 0.5
    lateness: float = 0.5
    seed: int = 0


PERFECT = Imperfection(errors=0.0, lateness=0.0)


@dataclass(frozen=True, slots=True)
class Order:
    """A command to one arm.

    Attributes:
        at: When its drives obey [s].
        action: What to do.
        velocity: Velocities of its joints, shape (k,) [rad/s or m/s].
    """

    at: float
    action: Action
    velocity: Floats


class Arm:
    """One arm: its drives, and the orders on their way to them.

    Its joints have mechanical end stops at their limits.

    Attributes:
        name: The robot's name.
        own: Its part of q.
        figures: How it is declared.
        drives: Its drives.
    """

    def __init__(
        self,
        name: str,
        own: slice,
        figures: StoppingFigures,
        model: RobotModel,
        q: Floats,
    ) -> None:
        self.name, self.own, self.figures = name, own, figures
        self.drives = Drives(figures, q[own], *joint_limits(model))
        self._orders: deque[Order] = deque()
        self._brake_at = np.inf

    def send(self, order: Order, now: float) -> None:
        """Send an order; none overtakes one that was sent before."""
        if order.action >= Action.BRAKE:
            # The brake is not the drives': it has its own way and its own delay.
            self._brake_at = min(self._brake_at, now + self.figures.brake_delay)
        at = max(order.at, self._orders[-1].at) if self._orders else order.at
        self._orders.append(Order(at, order.action, order.velocity))

    def advance(self, now: float, until: float, miss: Floats) -> None:
        """Let time pass; orders are obeyed at their instant in between."""
        while now < until:
            while self._orders and self._orders[0].at <= now:
                self._obey(self._orders.popleft(), miss)
            if self._brake_at <= now:
                self._brake_at = np.inf
                self.drives.brake()
            next_order = self._orders[0].at if self._orders else np.inf
            end = min(until, next_order, self._brake_at)
            self.drives.advance(end - now)
            now = end

    def _obey(self, order: Order, miss: Floats) -> None:
        if order.action >= Action.STOP:
            self.drives.stop()
        else:
            self.drives.follow(order.velocity, miss)


class Plant:
    """All arms of a scene. The same calls give the same motion to the bit.

    Attributes:
        time: Time [s].
        arms: The arms.

    Args:
        scene: The scene; every robot has stopping figures.
        q: Where they are held at the start, shape (n,); at home if None [rad or m].
        imperfection: How inexact and late they are.
        time: Time at the start [s].

    Raises:
        SceneError: A robot has no stopping figures.

    Example:
        >>> from armguard.scene import bay_scene
        >>> plant = Plant(bay_scene("path"), imperfection=PERFECT)
        >>> for _ in range(100):
        ...     plant.advance(0.01, np.full(14, 0.1), {})
        >>> float(plant.q[0].round(3))
        0.099
    """

    def __init__(
        self,
        scene: Scene,
        *,
        q: Floats | None = None,
        imperfection: Imperfection | None = None,
        time: float = 0.0,
    ) -> None:
        start = scene.home if q is None else np.asarray(q, dtype=np.float64)
        self.time = time
        self.arms: list[Arm] = []
        first = 0
        for name, robot in scene.robots.items():
            if robot.stopping is None:
                raise SceneError(
                    f"robot '{name}' has no stopping figures, so its motion is "
                    "unknown; give it `stopping: {deceleration: ...}` to simulate it"
                )
            own = slice(first, first + len(robot.model.q_names))
            self.arms.append(Arm(name, own, robot.stopping, robot.model, start))
            first = own.stop
        self._how = imperfection or Imperfection()
        self._rng = np.random.default_rng(self._how.seed)
        self._error = {
            key: np.concatenate([getattr(arm.figures, key) for arm in self.arms])
            for key in ("position_error", "velocity_error", "tracking_error")
        }
        self._miss, self._miss_until = np.zeros(first), -np.inf

    @property
    def q(self) -> Floats:
        """True positions, shape (n,) [rad or m]."""
        return np.concatenate([arm.drives.q for arm in self.arms])

    @property
    def v(self) -> Floats:
        """True velocities, shape (n,) [rad/s or m/s]."""
        return np.concatenate([arm.drives.v for arm in self.arms])

    @property
    def held(self) -> Mapping[str, bool]:
        """Whether each arm rests and is held."""
        return {arm.name: arm.drives.phase is Phase.HELD for arm in self.arms}

    def send(
        self, velocity: Floats, actions: Mapping[str, Action], at: float | None = None
    ) -> None:
        """Send orders to all arms; their drives obey after the declared delay, or less.

        Args:
            velocity: Velocities of all joints, shape (n,) [rad/s or m/s].
            actions: What to have each arm do; to follow who is not named.
            at: When it was sent; now if None, and not before now [s].
        """
        sent = self.time if at is None else max(at, self.time)
        for arm in self.arms:
            due = sent + self._how.lateness * arm.figures.command
            action = actions.get(arm.name, Action.FOLLOW)
            arm.send(Order(due, action, np.array(velocity[arm.own])), sent)

    def advance(
        self,
        dt: float,
        command: Floats | None = None,
        actions: Mapping[str, Action] | None = None,
    ) -> None:
        """Let time pass.

        Args:
            dt: How long [s].
            command: Velocities sent now, see `send`; None if none are.
            actions: Actions sent with them.
        """
        if command is not None:
            self.send(command, actions or {})
        self._draw_miss()
        until = self.time + dt
        for arm in self.arms:
            arm.advance(self.time, until, self._miss[arm.own])
        self.time = until

    def measure(self) -> tuple[Floats, Floats]:
        """Positions and velocities as measured now, each shape (n,)."""
        q, v = self.q, self.v
        share = self._how.errors
        if share > 0.0:
            q += share * self._error["position_error"] * self._uniform()
            # A joint at rest is not seen to move.
            wrong = share * self._error["velocity_error"] * self._uniform()
            v += np.clip(wrong, -np.abs(v), np.abs(v))
        return q, v

    def _draw_miss(self) -> None:
        """Draw what velocities are missed by from now on, and for how long."""
        share = self._how.errors
        if share > 0.0 and self.time >= self._miss_until:
            self._miss = share * self._error["tracking_error"] * self._uniform()
            self._miss_until = self.time + float(self._rng.uniform(0.0, SAME_MISS))

    def _uniform(self) -> Floats:
        return self._rng.uniform(-1.0, 1.0, len(self._miss))
