"""Lines past thin bodies: what a check of whole lines finds, and one of samples."""

from dataclasses import dataclass
from time import perf_counter, process_time
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from armguard.cli.console import say
from armguard.geometry import Box, Capsule, Pose
from armguard.guard.continuous import RESOLUTION
from armguard.respond import Guard
from armguard.scene import Scene, bay_scene, bay_task
from arrays import Bools, Floats
from motions.judge import Judge

# Wires and plates are this thin [m], and as long or wide as their halves are times two.
THIN = 0.002
WIRES = (0.06, 0.15, 0.35)
PLATES = (0.05, 0.12, 0.25)

# Home of the arm, upright and bent.
HOME = {"joint2": -0.35, "joint4": 1.7, "joint6": 1.25}

# Greatest way of a joint on a line [rad].
LONGEST = 0.6

# How far a body is off the surface of the link it is put beside [m].
OFF = (-0.01, 0.08)

# Where a body is that is nowhere near; tries to put one beside a line.
PARKED = Pose(xyz=(9.0, 9.0, 9.0)).matrix()
TRIES = 40

# Most bodies beside a line; more, and hardly a line passes.
MOST = 2

# What a line keeps at both ends beyond the floor [m].
ROOM = 0.001

# Samples of the judge are no denser than this way [m]; what is not deeper may be missed
# by it.
GRAIN = 2e-5

# Where Coal's distance is as good as 0 [m].
TOUCH = 1e-7

# A motion of so many rows is a plan [-], and checks of it are timed so often.
PLAN = 2000
REPEATS = 20

# Floors [m], each with and without a needle of the same thinness as tool.
CASES = ((0.0, False), (0.0, True), (0.005, False), (0.005, True))

# How much more often samples are taken than lines cost, one after the other [-].
COSTS = (1.0, 10.0)

# The step that is tried first [rad], and how often a better one is [-].
FIRST_STEP = 0.01
ROUNDS = 3


@dataclass(frozen=True, slots=True)
class Line:
    """A straight line of joint positions, and where the thin bodies are.

    Attributes:
        start: Joint positions, shape (n,) [rad].
        end: Joint positions, shape (n,) [rad].
        frames: Frame of each body in the world, shape (k, 4, 4).
    """

    start: Floats
    end: Floats
    frames: Floats


class ThinWorld:
    """One arm among thin wires and plates that stand elsewhere for each line.

    Attributes:
        guard: The guard.
        judge: The judge.
        floor: Distance to be kept [m].
        needle: Whether the tool is a needle.
        bodies: Names of the wires and plates.

    Args:
        floor: Distance to be kept [m].
        needle: Whether the tool is a needle.
    """

    def __init__(self, floor: float, needle: bool) -> None:
        self.floor, self.needle = floor, needle
        scene = Scene(mode="fixed", buffer=floor)
        model = bay_scene().robots["left"].model
        scene.add_robot(model, name="arm", home=HOME)
        if needle:
            scene.add(
                Capsule(start=(0, 0, 0.13), end=(0, 0, 0.3), radius=0.5 * THIN),
                name="needle",
                attached_to="arm/link7",
            )
            for link in ("arm/link6", "arm/link7"):
                scene.allow("needle", link, reason="it is held there")
        self.bodies = []
        for k, half in enumerate((*WIRES, *PLATES)):
            name = f"body{k}"
            rod = Capsule(start=(0, 0, -half), end=(0, 0, half), radius=0.5 * THIN)
            plate = Box(size=(2 * half, THIN, 1.4 * half))
            # A frame of no use: MuJoCo takes short cuts for a plain one.
            pose = Pose(xyz=(3.0, 3.0 + k, 0.1), rpy=(0.1, 0.2, 0.3))
            scene.add(rod if k < len(WIRES) else plate, name=name, pose=pose)
            self.bodies.append(name)
        self.guard = Guard(scene)
        tables = self.guard.tables
        self.judge = Judge(scene, tables)
        self._first = len(tables.kinds) - len(self.bodies)
        self._links = tables.moving_count
        self._rows = tables.local_rows

    @property
    def resolution(self) -> float:
        """How far anything moves where a line is not divided further [m]."""
        return RESOLUTION * float(self.judge.reach.sum())

    def stand(self, frames: Floats) -> None:
        """Put the bodies where a line has them."""
        for k, (name, T) in enumerate(zip(self.bodies, frames, strict=True)):
            self.guard.place(name, T)
            self.judge.stand_at(self._first + k, T)

    def draw(self, rng: np.random.Generator) -> Line:
        """A random line whose ends keep more than the floor."""
        tables = self.guard.tables
        for k in range(len(self.bodies)):
            self.judge.stand_at(self._first + k, PARKED)
        while True:
            start = rng.uniform(tables.lower, tables.upper)
            way = rng.uniform(-LONGEST, LONGEST, len(start))
            end = np.clip(start + way, tables.lower, tables.upper)
            if self.keeps_room(start) and self.keeps_room(end):
                break
        frames = np.tile(PARKED, (len(self.bodies), 1, 1))
        for k in rng.permutation(len(self.bodies))[: rng.integers(1, MOST + 1)]:
            for _ in range(TRIES):
                s = rng.uniform(0.1, 0.9)
                T = self.beside(start + s * (end - start), rng)
                self.judge.stand_at(self._first + k, T)
                if self.keeps_room(start, k) and self.keeps_room(end, k):
                    frames[k] = T
                    break
            else:
                self.judge.stand_at(self._first + k, PARKED)
        return Line(start, end, frames)

    def keeps_room(self, q: Floats, body: int | None = None) -> bool:
        """Whether all pairs, or those of one body, keep more than the floor."""
        self.judge.place(q)
        pairs = np.arange(len(self.judge.pairs))
        if body is not None:
            pairs = np.flatnonzero(self.judge.pairs[:, 1] == self._first + body)
        return all(self.judge.gap(int(k)) > self.floor + ROOM for k in pairs)

    def beside(self, q: Floats, rng: np.random.Generator) -> Floats:
        """A random frame beside one of the moving primitives, shape (4, 4)."""
        self.judge.place(q)
        i = int(rng.integers(1, self._links))
        geom = self.judge.geoms[i]
        centre = self.judge.data.geom_xpos[geom]
        axis = self.judge.data.geom_xmat[geom].reshape(3, 3)[:, 2]
        radius, half = self.judge.model.geom_size[geom, :2]
        away = np.cross(axis, rng.normal(size=3))
        away /= np.linalg.norm(away)
        T = np.eye(4)
        T[:3, :3] = Rotation.random(rng=rng).as_matrix()
        T[:3, 3] = centre + rng.uniform(-half, half) * axis
        T[:3, 3] += (radius + rng.uniform(*OFF)) * away
        return T

    def samples(self, line: Line, step: float) -> tuple[bool, int]:
        """Check samples of a line, no joint moving more than the step between two.

        Returns:
            Whether all keep the floor, and how many were looked at.
        """
        way = float(np.abs(line.end - line.start).max())
        count = int(np.ceil(way / step)) + 1
        for k in range(count):
            q = line.start + k / (count - 1) * (line.end - line.start)
            nearest = self.guard.judge_at_rest(q).nearest
            if nearest is not None and not nearest.headroom >= 0.0:
                return False, k + 1
        return True, count


def thin_figures(count: int, seed: int) -> dict[str, Any]:
    """Figures of lines past thin bodies, all cases together and each.

    Args:
        count: Lines in all.
        seed: Of the lines.
    """
    cases = []
    for k, (floor, needle) in enumerate(CASES):
        tool = "a needle" if needle else "none"
        say(f"{count // len(CASES)} lines, floor {floor * 1e3:g} mm, tool {tool}")
        world = ThinWorld(floor, needle)
        cases.append(case_figures(world, count // len(CASES), seed + k))
    sums = (
        "lines",
        "touching",
        "missed",
        "alarms_nothing_below_floor",
        "false_alarms",
        "check_s",
        "check_lines",
    )
    total: dict[str, Any] = {key: sum(c[key] for c in cases) for key in sums}
    total["samples"] = [
        {
            "cost": cost,
            **{
                key: sum(c["samples"][at][key] for c in cases)
                for key in ("missed", "seconds", "looked_at")
            },
        }
        for at, cost in enumerate(COSTS)
    ]
    return {**total, "cases": cases, "plan": plan_figures()}


class Checked(NamedTuple):
    """Lines that were checked as wholes.

    Attributes:
        least: True least distance on each, shape (k,) [m].
        clear: Which were called clear, shape (k,).
        judged: Halves of lines that were judged for that.
        seconds: Processor time that took [s].
    """

    least: Floats
    clear: Bools
    judged: int
    seconds: float

    def touching(self, floor: float) -> Bools:
        """Which lines come below the floor."""
        return self.least < floor - TOUCH


def check_lines(world: ThinWorld, lines: list[Line]) -> Checked:
    """Check lines as wholes, and find out what is true."""
    least, clear = np.zeros(len(lines)), np.zeros(len(lines), dtype=np.bool_)
    judged, seconds = 0, 0.0
    # The first call loads what is compiled.
    world.guard.check_path([world.guard.home])
    for k, line in enumerate(lines):
        world.stand(line.frames)
        least[k] = world.judge.least_on_line(line.start, line.end, world.floor, GRAIN)
        begin = process_time()
        path = world.guard.check_path([line.start, line.end])
        seconds += process_time() - begin
        clear[k] = path.clear
        judged += path.lines
    return Checked(least, clear, judged, seconds)


def case_figures(world: ThinWorld, count: int, seed: int) -> dict[str, Any]:
    """Figures of one floor and tool."""
    rng = np.random.default_rng(seed)
    lines = [world.draw(rng) for _ in range(count)]
    checked = check_lines(world, lines)
    least, alarms = checked.least, ~checked.clear
    touching = checked.touching(world.floor)
    resolved = world.floor + world.resolution
    above = least[alarms] - world.floor
    return {
        "floor_mm": world.floor * 1e3,
        "needle": world.needle,
        "lines": count,
        "touching": int(touching.sum()),
        "missed": int((touching & checked.clear).sum()),
        "alarms_nothing_below_floor": int((alarms & (least >= world.floor)).sum()),
        "false_alarms": int((alarms & (least > resolved)).sum()),
        "farthest_alarm_mm": float(1e3 * above.max(initial=0.0)),
        "resolution_mm": 1e3 * world.resolution,
        "check_s": checked.seconds,
        "check_lines": checked.judged,
        "samples": samples_figures(world, lines, touching, least, checked.seconds),
    }


def samples_figures(
    world: ThinWorld,
    lines: list[Line],
    touching: Bools,
    least: Floats,
    budget: float,
) -> list[dict[str, Any]]:
    """What checks of samples miss that take as long in all [s], and multiples of it."""
    step = FIRST_STEP
    for _ in range(ROUNDS):
        # The step that would have taken the budget, by what this one took.
        step *= run_samples(world, lines, step)[2] / budget
    found = []
    for cost in COSTS:
        clear, looked, seconds = run_samples(world, lines, step / cost)
        missed = touching & clear
        depths = 1e3 * (world.floor - least[missed])
        found.append(
            {
                "cost": seconds / budget,
                "seconds": seconds,
                "step_rad": step / cost,
                "looked_at": looked,
                "missed": int(missed.sum()),
                "deepest_missed_mm": float(depths.max(initial=0.0)),
            }
        )
    return found


def run_samples(
    world: ThinWorld, lines: list[Line], step: float
) -> tuple[Bools, int, float]:
    """Which lines seem clear, how many samples were looked at, and how long [s]."""
    clear, looked, seconds = np.zeros(len(lines), dtype=bool), 0, 0.0
    for k, line in enumerate(lines):
        world.stand(line.frames)
        begin = process_time()
        clear[k], count = world.samples(line, step)
        seconds += process_time() - begin
        looked += count
    return clear, looked, seconds


def plan_figures() -> dict[str, Any]:
    """Time of a check of a whole plan: a task of the bay, between all rows."""
    say(f"a plan of {PLAN} rows")
    scene = bay_scene("path")
    guard = Guard(scene)
    rows = bay_task(PLAN).for_scene(scene)
    guard.check_path(rows[:2])
    times = []
    for _ in range(REPEATS):
        begin = perf_counter()
        path = guard.check_path(rows)
        times.append(perf_counter() - begin)
    return {
        "rows": len(rows),
        "clear": path.clear,
        "lines": path.lines,
        "median_s": float(np.median(times)),
        "longest_s": float(max(times)),
    }
