"""Unintended grasps: the guard is to hold back each of them before anything touches.

The same operator with the same plant does it without a guard as well: an accident in
which nothing is touched then is none, and left out.
"""

from dataclasses import dataclass
from time import process_time
from types import SimpleNamespace
from typing import Any

import numpy as np

from armguard.respond import Action, Guard
from arrays import Floats
from episodes.campaign import LeftOut
from gripping.judge import FINGERS, HELD, Judge, Pair
from gripping.pick_and_place import Picker, pick, rest
from gripping.plant import Plant
from gripping.workplace import (
    GANTRY,
    PERIOD,
    Solid,
    Workplace,
    drawn_object,
    half_width,
    settings,
    table,
)

TARGET, NEIGHBOUR = "target", "neighbour"

# Every kind comes as often as every other one.
KINDS = ("hand", "speed", "closing", "neighbour", "undeclared", "held")

# How fast each kind is driven [m/s].
SPEEDS = {
    "hand": (0.02, 0.8),
    "speed": (0.1, 0.8),
    "closing": (0.1, 0.6),
    "neighbour": (0.03, 0.3),
    "undeclared": (0.02, 0.06),
    "held": (0.02, 0.8),
}

# Gap between the two objects on the table: of neighbours, and of all others [m].
CLOSE, APART = (0.01, 0.025), (0.1, 0.15)

# How long the operator goes on once it could touch [s].
PUSHES = 0.6

# Way of a drive, and where closed fingers come from [m].
WAY, FROM = 0.25, 0.12

# How far fingers are open that are closed [m].
NARROW = 0.006


@dataclass(frozen=True)
class Accident:
    """An accident of the gripper.

    Attributes:
        kind: One of `KINDS`.
        speed: How fast [m/s].
        sideways: Whether closed fingers come from a side, not from above.
    """

    kind: str
    speed: float
    sideways: bool


class Unguarded:
    """Commands a robot what its operator desires."""

    def __init__(self, guard: Guard) -> None:
        self.home = guard.home
        self.tables = guard.tables

    def filter(
        self, _q: Floats, desired: Floats, *_: Any, **__: Any
    ) -> SimpleNamespace:
        """See `Guard.filter`."""
        follow = Action.FOLLOW
        return SimpleNamespace(velocity=desired, action=follow, actions={"arm": follow})

    def grasp(self, _robot: str, _name: str) -> None:
        """See `Guard.grasp`."""


def run_episode(seed: int) -> dict[str, Any]:
    """One episode: what the judge found."""
    begin = process_time()
    rng = np.random.default_rng([seed, 4])
    kind = KINDS[seed % len(KINDS)]
    accident = Accident(kind, float(rng.uniform(*SPEEDS[kind])), rng.random() < 0.5)
    place = drawn_place(kind, rng)
    guard = Guard(place.scene(), self_test=False)
    if not carry_out(accident, place, Unguarded(guard), seed).judge.findings.touched:
        raise LeftOut(f"nothing is touched without a guard ({kind})")
    picker = carry_out(accident, place, guard, seed)
    found = picker.judge.findings
    return {
        "seed": seed,
        "kind": kind,
        "speed_asked": accident.speed,
        "meant": len({name for _, name in found.intended}),
        "simulated_s": len(picker.plant.rows) * PERIOD,
        "worked_s": process_time() - begin,
        "stops": picker.plant.stops,
        **found.figures(),
        "response": place.response,
    }


def drawn_place(kind: str, rng: np.random.Generator) -> Workplace:
    """A table with two objects on it, one beside the other along y."""
    target = drawn_object(rng, np.zeros(2))
    neighbour = drawn_object(rng, np.zeros(2))
    gap = rng.uniform(*(CLOSE if kind == "neighbour" else APART))
    beside = half_width(target) + gap + half_width(neighbour)
    neighbour = neighbour.moved_to(neighbour.at + np.array([0.0, beside, 0.0]))
    objects = {TARGET: target, NEIGHBOUR: neighbour}
    fixtures: dict[str, Solid] = {"table": table()}
    if kind == "undeclared":
        fixtures[TARGET] = objects.pop(TARGET)
    home = np.array([*rng.uniform(-0.2, 0.2, 2), 0.0, 0.03, 0.03])
    place = Workplace(objects, fixtures, home=home, **settings(rng))
    home[2] = place.travel(GANTRY)
    return place


def carry_out(
    accident: Accident, place: Workplace, guard: Guard | Unguarded, seed: int
) -> Picker:
    """Have the accident happen, as far as the guard lets it."""
    rng = np.random.default_rng([seed, 5])
    picker = Picker(Plant(guard, rng), Judge(place, PERIOD), GANTRY, rng)
    target = {**place.fixtures, **place.objects}[TARGET]
    xy, low = target.at[:2], GANTRY.height_over(target)
    opened = GANTRY.opening(target)
    fingers = {(finger, TARGET) for finger in FINGERS}
    if accident.kind == "speed":
        run_into(picker, accident, target)
        picker.look()
    elif accident.kind == "held":
        carry_into(picker, accident, place)
    elif accident.kind == "neighbour":
        arrive(picker, xy, low, opened)
        drive(picker, (0.0, 0.0, -accident.speed, 0.0, 0.0))
        picker.look(fingers)
    else:
        arrive(picker, xy, low, opened)
        arrived = picker.lead(np.array([*xy, low]), picker.slow, open_to=opened)
        if not arrived:
            raise LeftOut(f"the operator did not get there ({accident.kind})")
        if accident.kind == "hand":
            drive(picker, (0.0, 0.0, -accident.speed, 0.0, 0.0))
            picker.look(fingers)
        else:
            drive(picker, (0.0, 0.0, 0.0, -accident.speed, -accident.speed))
            picker.look()
    return picker


def arrive(picker: Picker, xy: Floats, low: float, opened: float) -> None:
    """Go to where the operator becomes slow."""
    if not picker.over(xy, float(picker.plant.seen[2]), low, opened):
        raise LeftOut("the operator did not get there")


def run_into(picker: Picker, accident: Accident, target: Solid) -> None:
    """Run into something with closed fingers."""
    x, y, z = target.at
    tips = GANTRY.tips
    if accident.sideways:
        # The tips are at half of its height, and clear of the table.
        level = float(max(z, 0.01)) + tips
        begin = np.array([x - FROM, y, level])
        desired = (accident.speed, 0.0, 0.0, 0.0, 0.0)
    else:
        begin = np.array([x, y, z + target.half[2] + tips + FROM])
        desired = (0.0, 0.0, -accident.speed, 0.0, 0.0)
    above = np.array([*begin[:2], max(begin[2], picker.plant.seen[2])])
    there = picker.lead(above, picker.fast, open_to=NARROW)
    if not (there and picker.lead(begin, picker.fast, open_to=NARROW)):
        raise LeftOut("the operator did not get there (speed)")
    drive(picker, desired)


def carry_into(picker: Picker, accident: Accident, place: Workplace) -> None:
    """Grip something, lift it a little, and drive it into its neighbour."""
    stuck = pick(picker, place, TARGET, place.travel(GANTRY))
    if stuck is not None:
        raise LeftOut("it was not gripped (held)")
    standing: set[Pair] = {(HELD, "table")}
    up = np.add(picker.plant.seen[:3], (0.0, 0.0, 0.02))
    lifted = picker.lead(up, picker.slow)
    picker.look(standing)
    if not lifted:
        raise LeftOut("it was not lifted (held)")
    drive(picker, (0.0, accident.speed, 0.0, 0.0, 0.0))
    picker.look()


def drive(picker: Picker, desired: tuple[float, ...]) -> None:
    """Desire the same for as long as a way takes, and then some."""
    asked = np.array(desired)
    cycles = int((WAY / np.abs(asked).max() + PUSHES) / PERIOD)
    for _ in range(cycles):
        picker.plant.cycle(asked)
    rest(picker)
