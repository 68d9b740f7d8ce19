"""Simulated robot of the self-test: consecutive samples of one joint's approach."""

from collections.abc import Iterator

import numpy as np

from armguard.guard.approach import RISE, Approach
from armguard.guard.levels import Level
from armguard.guard.loop import Loop
from armguard.guard.stops import REST_CYCLES
from armguard.guard.verdict import Verdict
from armguard.robot.stopping.distance import brake_way, stop_travel
from armguard.scene.tables import SceneTables

# Additional time beyond the declared figures [s], and a factor of the whole [-].
GRACE = 0.1
PATIENCE = 3.0

# Duration of a late cycle in periods [-].
LATE_CYCLES = 3.0

# Cycles in addition to those that a robot must be at rest.
MORE_CYCLES = 10


def late_cycle(tables: SceneTables) -> float:
    """Time after the last cycle at which a cycle is surely late [s]."""
    figures = [part.stopping for part in tables.robots if part.stopping is not None]
    unannounced = max((f.sensing for f in figures), default=0.0)
    return LATE_CYCLES * (tables.period + unannounced) + 2.0 * tables.late


class Walk:
    """Simulated motion of one joint, and the levels that the guard answers.

    Args:
        guard: The guard; it is reset here.
        approach: The motion.

    Attributes:
        levels: Levels of the joint's robot so far, one per change.
        level: The last level.
        speed: Speed of the last sample [rad/s or m/s].
    """

    def __init__(self, guard: Loop, approach: Approach) -> None:
        guard.reset()
        self.levels: list[Level] = []
        self.level = Level.CLEAR
        self.speed = 0.0
        self._guard = guard
        self._approach = approach
        self._q = guard.home
        self._q[approach.joint] = approach.start
        self._v = np.zeros_like(self._q)
        self._time = 0.0
        self._period = guard.tables.period
        hardest = float(approach.figures.acceleration[approach.place])
        self._gain = min(approach.speed / RISE, hardest) * self._period

    @property
    def words(self) -> str:
        """Joint and speed in words."""
        a = self._approach
        name = self._guard.q_names[a.joint]
        return f"joint '{name}' at {a.direction * a.speed:.2f} a second"

    @property
    def is_up_to_speed(self) -> bool:
        """Whether the joint has reached its test speed."""
        return self.speed == self._approach.speed

    def forward(self) -> Iterator[Verdict]:
        """Accelerate and move on, for longer than the approach takes."""
        a = self._approach
        place = a.place
        tables = self._guard.tables
        stop = stop_travel(a.figures, place, a.speed, tables.period, tables.late)
        time = PATIENCE * (stop.travel / a.speed + GRACE + RISE)
        yield self._look()
        for _ in range(int(time / self._period) + MORE_CYCLES):
            yield self._move(min(self.speed + self._gain, a.speed))

    def stop(self) -> Iterator[Verdict]:
        """Stop as declared, from the order in the last cycle on; then rest."""
        a, begin, top = self._approach, self._time, self.speed
        rest = self._rest_time(top)
        time = a.figures.command + rest
        cycles = int(PATIENCE * (time + a.figures.sensing + GRACE) / self._period)
        for _ in range(cycles + REST_CYCLES + MORE_CYCLES):
            since = self._time + self._period - begin - a.figures.command
            yield self._move(self._left(top, since, rest))

    def run_away(self) -> Iterator[Verdict]:
        """Accelerate, make one late cycle, and move on in spite of orders to stop."""
        a = self._approach
        figures, tables = a.figures, self._guard.tables
        self._q[a.joint] = a.far
        yield self._look()
        while not self.is_up_to_speed:
            yield self._move(min(self.speed + self._gain, a.speed))
        late = late_cycle(tables)
        yield self._move(a.speed, late)
        stop = stop_travel(figures, a.place, a.speed, tables.period, tables.late)
        brake = a.speed / float(figures.brake_deceleration[a.place])
        time = stop.time + figures.brake_delay + brake + GRACE
        waited = False
        for _ in range(int(PATIENCE * time / self._period) + MORE_CYCLES):
            if self.level is Level.BRAKE and not waited:
                # Cycles before a brake takes effect do not test it.
                waited = True
                yield self._move(a.speed, max(figures.brake_delay, self._period))
            else:
                yield self._move(a.speed)

    def _rest_time(self, speed: float) -> float:
        """Time from the effect of a stop to rest [s]."""
        figures, place = self._approach.figures, self._approach.place
        table = figures.table_of(place)
        if table is not None:
            time, way = table.at(speed)
            return min(time, 2.0 * way / speed)
        _, time = brake_way(speed, float(figures.deceleration[place]), figures.ramp)
        return time

    def _left(self, speed: float, since: float, rest: float) -> float:
        """Speed at a time `since` a stop took effect [rad/s or m/s]."""
        figures, place = self._approach.figures, self._approach.place
        if since <= 0.0:
            return speed
        if figures.table_of(place) is not None:
            return max(speed * (1.0 - since / rest), 0.0)
        full, ramp = float(figures.deceleration[place]), figures.ramp
        rising = min(since, ramp)
        lost = full * (since - rising)
        if rising > 0.0:
            lost += 0.5 * full * rising * rising / ramp
        return max(speed - lost, 0.0)

    def _move(self, speed: float, time: float | None = None) -> Verdict:
        """Move for one cycle, or another time, that ends at a given speed."""
        a = self._approach
        passed = self._period if time is None else time
        self._q[a.joint] += a.direction * 0.5 * (self.speed + speed) * passed
        self.speed = speed
        self._v[a.joint] = a.direction * speed
        self._time += passed
        return self._look()

    def _look(self) -> Verdict:
        """Verdict of the guard on the present sample; its level is recorded."""
        verdict = self._guard.step(self._q, self._time, velocity=self._v)
        self.level = verdict.levels[self._approach.robot.name]
        if not self.levels or self.levels[-1] is not self.level:
            self.levels.append(self.level)
        return verdict
