"""Drives a guard: arms that obey, operators that change their aim, noise, faults.

Everything is drawn by a generator with a seed and made by additions and products alone,
so that a play is the same on every machine as long as the guard's commands are.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from armguard.guard.checkpoint import unpack
from armguard.guard.levels import Level
from armguard.guard.verdict import Verdict
from armguard.respond import Command, Guard
from armguard.scene import Scene
from golden.fields import parts_of

Floats = NDArray[np.float64]
Form = Literal["step", "velocities", "positions", "twists"]

# Cycles between two aims of an operator, and between two hashes of a checkpoint.
OF_ONE_AIM, OF_ONE_CHECKPOINT = 200, 25

# Time from the measurement to the cycle [s].
AGE = 1e-3

# How an operator goes to an aim: speed by what is left of the way [1/s], how far ahead
# of the robot it desires positions [s], and its twists [m/s and rad/s].
GAIN, AHEAD, TWIST = 2.0, 0.1, 0.3

# Acceleration of arms without a command [rad/s² or m/s²], and how much harder they
# stop than they are declared to.
SOFTEST, HARDER = 3.0, 1.2


@dataclass
class Input:
    """What a cycle is given; a fault alters it.

    Attributes:
        q: Measured positions, shape (n,) [rad or m].
        velocity: Measured velocities, shape (n,) [rad/s or m/s]; None if not given.
        stamp: When they were measured [s].
        now: Time of the cycle [s]; None if not given.
        desired: Velocities or positions, shape (n,), or twists by tool.
    """

    q: Any
    velocity: Any
    stamp: Any
    now: Any
    desired: Any


@dataclass(frozen=True)
class Play:
    """A guard, and what happens to it.

    Attributes:
        name: Its name.
        scene: Makes the scene.
        cycles: How many cycles.
        form: What the guard is asked.
        period: Time from one cycle to the next [s].
        seed: Of all that is drawn.
        speed: Greatest velocity an operator desires, of all joints or of each [rad/s
            or m/s].
        reach: How far from home an operator aims [rad or m].
        velocities: Whether velocities are measured, or left to be estimated.
        clocked: Whether the guard is given the time of the cycle.
        aims: Whether operators' aims are drawn; if not, an event sets them.
        events: Called before every cycle: what happens between two cycles.
        faults: Called with the input of every cycle, to alter it.
    """

    name: str
    scene: Callable[[], Scene]
    cycles: int = 600
    form: Form = "velocities"
    period: float = 0.004
    seed: int = 0
    speed: float | tuple[float, ...] = 1.0
    reach: float = 1.2
    velocities: bool = True
    clocked: bool = True
    aims: bool = True
    events: Callable[["Drive"], None] | None = None
    faults: Callable[["Drive", Input], None] | None = None

    def run(self) -> Iterator[dict[str, bytes]]:
        """Every cycle's bytes by field."""
        return Drive(self).run()


class Drive:
    """A play under way.

    Attributes:
        guard: The guard.
        k: Number of the cycle.
        q: True positions.
        v: True velocities.
        rng: Generator of all that is drawn.
    """

    def __init__(self, play: Play) -> None:
        self.play = play
        scene = play.scene()
        scene.period = play.period
        self.guard = Guard(scene, self_test=False)
        self.rng = np.random.default_rng([play.seed, 22])
        self.k = 0
        self.q = self.guard.home
        self.v = np.zeros_like(self.q)
        self.aim = self.q.copy()
        self.twists: dict[str, Floats] = {}
        robots = self.guard.tables.robots
        self.hardest = HARDER * np.concatenate(
            [part.stopping.deceleration for part in robots]
        )
        self.tools = [part.name for part in robots]

    @property
    def time(self) -> float:
        """Time of the cycle [s]."""
        return self.k * self.play.period

    def run(self) -> Iterator[dict[str, bytes]]:
        """Every cycle's bytes by field."""
        play = self.play
        for self.k in range(1, play.cycles + 1):
            if play.events is not None:
                play.events(self)
            given = self.given()
            if play.faults is not None:
                play.faults(self, given)
            verdict, command = self.cycle(given)
            found = parts_of(verdict, command)
            if self.k % OF_ONE_CHECKPOINT == 0:
                found["checkpoint"] = unpack(self.guard.checkpoint())[2]
            self.move(verdict, command)
            yield found

    def given(self) -> Input:
        """What is measured and desired."""
        lower, upper = self.guard.tables.lower, self.guard.tables.upper
        if self.k % OF_ONE_AIM == 1:
            self.begin_again()
        noise = self.rng.uniform(-2e-5, 2e-5, len(self.q))
        swing = self.rng.uniform(-1e-3, 1e-3, len(self.q))
        desired: Any = self.wanted
        if self.play.form == "positions":
            desired = self.q + desired * AHEAD
        if self.play.form == "twists":
            desired = self.twists
        return Input(
            q=np.clip(self.q + noise, lower, upper),
            velocity=self.v + swing if self.play.velocities else None,
            stamp=self.time - AGE,
            now=self.time if self.play.clocked else None,
            desired=desired,
        )

    def begin_again(self) -> None:
        """Draw another aim; robots that were stopped go on."""
        play, home = self.play, self.guard.home
        if play.aims:
            aim = home + self.rng.uniform(-play.reach, play.reach, len(home))
            self.aim = np.clip(aim, self.guard.tables.lower, self.guard.tables.upper)
        if play.form != "step":
            self.guard.engage()
        self.twists = {
            tool: TWIST * self.rng.uniform(-1.0, 1.0, 6) for tool in self.tools
        }

    @property
    def wanted(self) -> Floats:
        """Velocities that lead to the aim, shape (n,)."""
        speed = np.asarray(self.play.speed)
        return np.clip(GAIN * (self.aim - self.q), -speed, speed)

    def cycle(self, given: Input) -> tuple[Verdict, Command | None]:
        """One cycle of the guard."""
        guard, form = self.guard, self.play.form
        times = {"velocity": given.velocity, "now": given.now}
        if form == "step":
            # Where no stop is predicted, nothing but positions is desired.
            if not guard.tables.robots[0].mode == "fixed":
                return guard.step(given.q, given.stamp, **times), None
            return guard.step(given.q), None
        ask = {
            "velocities": guard.filter,
            "positions": guard.filter_positions,
            "twists": guard.filter_twists,
        }[form]
        command = ask(given.q, given.desired, given.stamp, **times)
        return command.verdict, command

    def move(self, verdict: Verdict, command: Command | None) -> None:
        """Go on to the next cycle as commanded, or as an operator does who obeys."""
        if command is not None:
            self.v = np.array(command.velocity)
        else:
            stop = verdict.level >= Level.STOP
            wanted = np.zeros_like(self.v) if stop else self.wanted
            most = (self.hardest if stop else SOFTEST) * self.play.period
            self.v = self.v + np.clip(wanted - self.v, -most, most)
            if verdict.disproved and not self.v.any():
                self.guard.reset()
        self.q = self.q + self.v * self.play.period
