"""A guard, simulated arms and an operator in one loop, and who judges them."""

from collections import Counter
from dataclasses import dataclass, field, replace

import numpy as np

from armguard.guard import Level
from armguard.respond import Action, Guard
from armguard.scene import bay_scene, compile_scene
from armguard.scene.two_pandas import two_pandas_scene
from armguard.simulation import Operator, Plant, TeleDriver
from closed_loop.judge import Judge

SCENES = {"bay": lambda: bay_scene("path"), "two-pandas": two_pandas_scene}

# An arm moves if one of its joints is faster than this [rad/s or m/s].
MOVES = 0.02


@dataclass
class Round:
    """What came of some time at work.

    Attributes:
        levels: Cycles at each level.
        stops: How often an arm was stopped.
        deflected: Cycles in which the command differed from the desired motion.
        least: Least distance of a checked pair, as MuJoCo measures it [m].
        moving: Share of the time each arm moved.
        stuck: Longest time each arm stood though its operator led it [s].
    """

    levels: Counter = field(default_factory=Counter)
    stops: int = 0
    deflected: int = 0
    least: float = np.inf
    moving: np.ndarray = field(default_factory=lambda: np.zeros(2))
    stuck: np.ndarray = field(default_factory=lambda: np.zeros(2))


def scene_with(name, response, rate):
    """A bundled scene, all robots with one response, at a rate [Hz]."""
    scene = SCENES[name]()
    scene.period = 1.0 / rate
    for robot in list(scene.robots.values()):
        how = replace(robot.response, kind=response)
        scene._robots[robot.name] = replace(robot, response=how)
    return scene


def judge_of(name):
    """MuJoCo on the same scene; nothing may be gripped, hands are what they are."""
    scene = SCENES[name]()
    for item in list(scene.objects.values()):
        scene._objects[item.name] = replace(item, graspable=None)
    for robot in list(scene.robots.values()):
        scene._robots[robot.name] = replace(robot, gripper=None)
    return Judge(scene, compile_scene(scene))


def work(name, response="deflect", seconds=60.0, rate=250.0, seed=1):
    """Let operators work for some time."""
    scene = scene_with(name, response, rate)
    guard, judge = Guard(scene, self_test=False), judge_of(name)
    plant, driver = Plant(scene), TeleDriver(guard, seed)
    operator, found = Operator(driver), Round()
    blocked, before, stood = {}, Action.FOLLOW, np.zeros(2)
    cycles, period = int(seconds * rate), 1.0 / rate
    for k in range(cycles):
        q, v = plant.measure()
        desired, engages = operator.drive(k * period, q, blocked)
        for robot in engages:
            guard.engage(robot)
        command = guard.filter(q, desired, k * period, velocity=v)
        blocked, action = command.blocked, command.action
        found.levels[command.verdict.level] += 1
        found.stops += action >= Action.STOP > before
        found.deflected += bool((np.abs(command.velocity - desired) > 0.05).any())
        before = action
        for r in range(2):
            own = driver.own(r)
            moves = np.abs(v[own]).max() > MOVES
            led = np.abs(desired[own]).max() > MOVES
            found.moving[r] += moves / cycles
            stood[r] = (
                stood[r] + period if led and not moves else 0.0 if moves else (stood[r])
            )
        found.stuck = np.maximum(found.stuck, stood)
        plant.advance(period, command.velocity, command.actions)
        found.least = min(found.least, judge.distance(plant.q))
    return found


def summary(found, seconds):
    """A round in one line."""
    total = sum(found.levels.values())
    levels = ", ".join(
        f"{Level(level).name} {100.0 * n / total:.1f} %"
        for level, n in sorted(found.levels.items())
    )
    return (
        f"{seconds:.0f} s: {levels}; {found.stops} stops; less than desired "
        f"{100.0 * found.deflected / total:.1f} %; moving "
        f"{np.round(100.0 * found.moving, 1)} %; longest stuck "
        f"{np.round(found.stuck, 2)} s; least {found.least * 1e3:.1f} mm"
    )
