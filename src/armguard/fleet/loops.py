"""Episodes of closed loops: a motion, the guard, simulated arms, and their judge."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.fleet.audit import add_contacts
from armguard.fleet.episodes import frames_of
from armguard.fleet.inputs import PLAN, RANDOM, Input
from armguard.fleet.job import RANDOM_DURATION, TIMES_AS_LONG, FleetError
from armguard.fleet.manifest import Manifest
from armguard.fleet.result import empty_row, finding
from armguard.plans.plan import Plan
from armguard.prove.tube import Tube
from armguard.respond import Guard
from armguard.respond.command import Command
from armguard.simulation.closed_loop import ClosedLoop
from armguard.simulation.judge import JudgeName, judge_of, rising
from armguard.simulation.operator import MotionOperator, Operator
from armguard.simulation.plant import Imperfection
from armguard.simulation.tele import TeleDriver

Floats = NDArray[np.float64]

# Configurations that are tried for the start of a random motion; then it is home. There
# all pairs are farther apart than the largest buffer by so much [m].
TRIES, ROOM = 200, 0.02

# Time of the closed loop that loads the kernels [s].
WARM = 0.2


class Loops:
    """Closed loops of one scene with one setting.

    Attributes:
        scene: The scene.
        guard: Its guard.

    Args:
        manifest: The manifest.
        group: Number of the scene and setting, see `Manifest.groups`.
    """

    def __init__(self, manifest: Manifest, group: int) -> None:
        self._job, self._folder = manifest.job, manifest.folder
        self.scene, budget = manifest.scene(group)
        own = manifest.own_settings(group)
        self._share = Imperfection(
            errors=own.get("plant.errors", 1.0),
            lateness=own.get("plant.lateness", 1.0),
        )
        self.guard = Guard(self.scene, budget=budget, self_test=False)
        self._fresh = self.guard.checkpoint()
        tables = self.guard.tables
        self._driver = TeleDriver(tables)
        self._room = ROOM + float(tables.buffers.max(initial=0.0))
        name: JudgeName = self._job.judge or "checker"
        self._name, self._judge = name, judge_of(name, self.scene, tables)

    def warm_up(self) -> None:
        """Load the kernels, by a short random motion."""
        loop, _ = self.loop(Input("random", RANDOM, 0, 0, 0, 0))
        for _ in loop.run(WARM):
            pass
        self._judge.judge(*loop.states)

    def loop(
        self, one: Input, cycle: Callable[..., Command] | None = None
    ) -> tuple[ClosedLoop, float]:
        """The closed loop of an input before its first cycle, and its longest time [s].

        Args:
            one: The input.
            cycle: See `ClosedLoop`.

        Raises:
            ArmguardError: The input is damaged, or has no times.
        """
        hands: Operator | MotionOperator
        if one.kind == RANDOM:
            rng = np.random.default_rng(one.episode)
            start, lasts = self._start(rng), RANDOM_DURATION
            hands = Operator(self._driver.with_seed(one.episode))
        else:
            tube = self._motion(one)
            start, lasts = tube.control[0, 0], TIMES_AS_LONG * float(tube.times[-1])
            hands = MotionOperator(tube, self.guard.tables)
        self.guard.restore(self._fresh)
        loop = ClosedLoop(
            self.guard,
            self.scene,
            hands,
            self._judge,
            start=start,
            imperfection=replace(self._share, seed=max(one.episode, 0)),
            cycle=cycle,
        )
        return loop, self._job.duration or lasts

    def row(self, one: Input) -> dict[str, Any]:
        """The result of an episode, see `COLUMNS`.

        Raises:
            ArmguardError: See `loop`.
        """
        loop, longest = self.loop(one)
        for _ in loop.run(longest):
            pass
        times, q = loop.states
        if not np.isfinite(q).all():
            raise FleetError(f"{one.name}: a simulated joint is at no finite position")
        judged = self._judge.judge(times, q)
        row = empty_row(one, loop.cycles)
        row |= {"duration": loop.times[-1], "clear": judged.clear, "judge": self._name}
        if judged.least is not None:
            least = judged.least
            row |= {"least": least.distance, "a": least.a, "b": least.b}
            row["time"] = least.time
        add_contacts(row, judged.intervals)
        add_stops(row, loop)
        done = row["done"] = loop.done
        if one.kind != RANDOM and done < 1.0:
            text = f"{100.0 * done:.0f} % of the motion was done"
            row["findings"].append(finding("not done", value=done, text=text))
        return row

    def _motion(self, one: Input) -> Tube:
        """The motion of a dataset's episode, a recording or a plan, from 0 s on."""
        if one.kind == PLAN:
            job, path = self._job, self._folder / one.source
            form, home = job.interpolation, job.hold_home
            plan = Plan.read(path, self.scene, interpolation=form, hold_home=home)
            timed, tube = plan.timed, plan.tube
            tube = replace(tube, times=tube.times - tube.times[0])
        else:
            [frames] = frames_of([one], self._job, self._folder, self.scene)
            if isinstance(frames, tuple):
                raise FleetError(frames[1])
            if len(frames.q) < 2 or not frames.finite.all():
                raise FleetError(f"{one.name}: a motion needs two frames, all finite")
            timed, tube = frames.timed, Tube.straight(rising(frames.times), frames.q)
        if not timed:
            raise FleetError(f"{one.name}: it has no times; `run` needs them")
        return tube

    def _start(self, rng: np.random.Generator) -> Floats:
        """Where a random motion begins: every pair keeps its buffer and more there."""
        for _ in range(TRIES):
            q = self._driver.known(rng)
            found = self._judge.judge(np.array([0.0, 1.0]), np.array([q, q]))
            least = found.least
            if found.clear and (least is None or least.distance >= self._room):
                return q
        return np.array(self.scene.home)


def add_stops(row: dict[str, Any], loop: ClosedLoop) -> None:
    """Add the stops of a closed loop to its result."""
    stops = loop.stops
    row["stops"], row["longest_hold"] = len(stops), loop.longest_hold
    row["needless_stops"] = sum(one.needless for one in stops)
    if stops:
        row["stop"], row["stop_reason"] = stops[0].time, stops[0].reason.name
        row["needless"] = row["needless_stops"] > 0
    for one in stops:
        kind = "needless stop" if one.needless else "stop"
        text = f"{one.robot} at {one.time:.4f} s: {one.why}"
        row["findings"].append(finding(kind, one.robot, start=one.time, text=text))
