"""A closed loop: desired motion, the guard's command, simulated arms, measurements."""

from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.errors import SceneError
from armguard.guard.levels import Reason
from armguard.respond import Guard
from armguard.respond.command import Action, Command
from armguard.respond.goals import check_modes
from armguard.scene.scene import Scene
from armguard.scene.tables import SceneTables
from armguard.simulation.judge import Judge
from armguard.simulation.operator import Hands, MotionOperator
from armguard.simulation.plant import Imperfection, Plant

Floats = NDArray[np.float64]

# A stop is needless if the motion keeps its buffers so long without the guard [s].
LOOK = 1.0


@dataclass(frozen=True, slots=True)
class Stop:
    """A stop of one robot.

    Attributes:
        robot: Its name.
        time: When it was ordered [s].
        reason: Why.
        why: The same in words.
        needless: Whether the desired motion keeps every buffer without the guard.
    """

    robot: str
    time: float
    reason: Reason
    why: str
    needless: bool


def check_scene(name: str, scene: Scene, tables: SceneTables) -> None:
    """Refuse a scene whose closed loop cannot be simulated.

    Raises:
        SceneError: It has sensed space or moving objects, or a robot of it predicts no
            stops or has no stopping figures.
    """
    if tables.sensing is not None:
        raise SceneError(
            f"{name}: a closed loop has no sensors; leave out `sensing` and `sensors`"
        )
    if tables.top_speeds.any():
        raise SceneError(
            f"{name}: a closed loop moves no objects; leave out their `top_speed`"
        )
    check_modes(tables)
    Plant(scene)


class ClosedLoop:
    """One episode: every desired motion passes the guard, and the arms obey.

    Measurements are as old, cycles and commands as late as `imperfection` has it.

    Attributes:
        plant: The simulated arms.
        times: Times of true states [s].
        rows: Positions of all joints then, each shape (n,) [rad or m].
        cycles: Cycles so far.
        stops: Stops that were ordered.
        longest_hold: Longest time for which an arm was stopped or held [s].
        way: Way of all joints [rad and m].
        desired_way: That of the desired motion [rad and m].

    Args:
        guard: The guard, as before its first cycle.
        scene: Its scene.
        hands: Source of the desired motion.
        judge: Decides whether a stop is needless.
        start: Where the arms rest at first, shape (n,) [rad or m].
        imperfection: Share of the declared errors and delays that is used up.
        cycle: Runs a cycle in place of `guard.filter`, such as that of its recorder.
    """

    def __init__(
        self,
        guard: Guard,
        scene: Scene,
        hands: Hands,
        judge: Judge,
        *,
        start: Floats,
        imperfection: Imperfection,
        cycle: Callable[..., Command] | None = None,
    ) -> None:
        tables = guard.tables
        self._guard, self._hands, self._judge = guard, hands, judge
        self._filter = cycle or guard.filter
        self._lower, self._upper = tables.lower, tables.upper
        # Older measurements than declared are refused, and would show nothing.
        self._period, share = tables.period, min(imperfection.lateness, 1.0)
        self._late = share * tables.late
        self.plant = Plant(scene, q=start, imperfection=imperfection)
        self._robots = {arm.name: arm.own for arm in self.plant.arms}
        self._ages = [share * arm.figures.sensing for arm in self.plant.arms]
        # The cycle that each arm's next measurement is for.
        self._next = [0] * len(self._ages)
        self._first = max(self._ages)
        n = len(start)
        self._arrived: dict[int, tuple[Floats, Floats, dict[str, float]]] = {}
        self._velocity, self._n = np.zeros(n), n
        self._stopped = dict.fromkeys(self._robots, True)
        self._held: dict[str, float] = {}
        self._command: Command | None = None
        self.times, self.rows = [0.0], [self.plant.q]
        self.cycles, self.stops = 0, list[Stop]()
        self.longest_hold = self.way = self.desired_way = 0.0

    @property
    def states(self) -> tuple[Floats, Floats]:
        """Times, shape (k,) [s], and true positions, shape (k, n) [rad or m]."""
        return np.array(self.times), np.array(self.rows)

    @property
    def done(self) -> float:
        """Share of the motion that is done; of desired velocities, that of their way.

        What a joint is beyond the desired way counts as well, up to the whole [-].
        """
        if isinstance(self._hands, MotionOperator):
            return self._hands.done
        return min(self.way / self.desired_way, 1.0) if self.desired_way > 0.0 else 1.0

    def run(self, duration: float) -> Iterator[Command]:
        """Run cycles one by one, until the end or until the motion is done.

        Args:
            duration: Longest time [s].
        """
        while (now := self._due(self.cycles)) <= duration:
            self._advance(now)
            yield self._cycle(now)
            self.cycles += 1
            if isinstance(self._hands, MotionOperator) and self.done >= 1.0:
                break

    def _due(self, cycle: int) -> float:
        """When a cycle begins: every other one as late as it may be [s]."""
        late = self._late if cycle % 2 else 0.0
        return self._first + cycle * self._period + late

    def _advance(self, now: float) -> None:
        """Move the arms until a cycle, and measure them on the way."""
        plant, instants = self.plant, []
        for r, age in enumerate(self._ages):
            while (at := self._due(self._next[r]) - age) <= now:
                instants.append((at, self._next[r], r))
                self._next[r] += 1
        for at, cycle, r in sorted(instants):
            self._move(at)
            q, v, stamps = self._arrived.setdefault(
                cycle, (np.zeros(self._n), np.zeros(self._n), {})
            )
            own, (q_now, v_now) = plant.arms[r].own, plant.measure()
            q[own], v[own] = q_now[own], v_now[own]
            stamps[plant.arms[r].name] = plant.time
        self._move(now)

    def _move(self, until: float) -> None:
        """Move the arms, and keep the state."""
        if until > self.plant.time:
            self.plant.advance(until - self.plant.time)
            # A sum of steps would be off by its rounding.
            self.plant.time = until
            self.way += float(np.abs(self.plant.q - self.rows[-1]).sum())
            self.times.append(until)
            self.rows.append(self.plant.q)

    def _cycle(self, now: float) -> Command:
        """One cycle of the guard, and its command to the arms."""
        q, v, stamps = self._arrived.pop(self.cycles)
        blocked: Any = {} if self._command is None else self._command.blocked
        desired, engages = self._hands.drive(now, q, blocked)
        for robot in engages:
            self._guard.engage(robot)
        self.desired_way += float(np.abs(desired).sum()) * self._period
        command = self._filter(q, desired, stamps, velocity=v, now=now)
        self._note(now, desired, command)
        self.plant.send(command.velocity, command.actions)
        self._command = command
        return command

    def _note(self, now: float, desired: Floats, command: Command) -> None:
        """Note robots that are stopped in this cycle, and those that are held."""
        begins = []
        for robot, action in command.actions.items():
            stops = action >= Action.STOP
            if stops and not self._stopped[robot]:
                begins.append(robot)
            self._stopped[robot] = stops
            if action >= Action.HOLD:
                since = self._held.setdefault(robot, now)
                self.longest_hold = max(self.longest_hold, now - since)
            else:
                self._held.pop(robot, None)
        if begins:
            needless, verdict = self._keeps_buffers(now, desired), command.verdict
            causes = verdict.last_causes
            self.stops += [
                Stop(robot, now, causes[robot], verdict.why, needless)
                for robot in begins
            ]

    def _keeps_buffers(self, now: float, desired: Floats) -> bool:
        """Whether the desired motion without the guard comes too near to nothing."""
        plant, hands = deepcopy((self.plant, self._hands))
        times, rows = [now], [plant.q]
        for k in range(1, round(LOOK / self._period) + 1):
            plant.send(desired, {})
            plant.advance(self._period)
            times.append(now + k * self._period)
            rows.append(plant.q)
            desired, _ = hands.drive(times[-1], rows[-1], {})
        q = np.array(rows)
        if (q <= self._lower).any() or (q >= self._upper).any():
            return False
        return self._judge.judge(np.array(times), q).clear
