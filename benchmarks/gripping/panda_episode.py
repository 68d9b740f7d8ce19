"""A Panda picks something up among clutter and puts it down where it is free."""

from dataclasses import dataclass
from functools import cache
from math import sqrt
from time import process_time
from typing import Any

import numpy as np

from armguard.errors import ArmguardError
from armguard.geometry import Pose
from armguard.respond import Action, Command, Guard
from armguard.scene import Gripper, Scene
from armguard.scene.settings import IndexSettings
from arrays import Floats
from gripping.panda_arm import ARM, BASE, HAND, POSTURE, PandaArm
from gripping.panda_judge import GRIPPER, PandaJudge
from gripping.pick_and_place import (
    Outcome,
    Picker,
    carries_clear,
    ends_of_way,
    pick_and_place,
    told,
)
from gripping.plant import Plant
from gripping.solids import box
from gripping.workplace import PERIOD, STOPPING, Tool, Workplace, cluttered

# The hand and its fingers, about the frame `panda_hand`.
PANDA = Tool(
    tips=0.113, palm=0.084, hand=(0.035, 0.106), finger=(0.011, 0.026), widest=0.04
)

# Joints stop, are late and miss what they are told as those of the gantry; their top
# speeds are Franka's. Nothing swings, as the plant does not.
FIGURES = {key: value for key, value in STOPPING.items() if key != "velocity"} | {
    "velocity_error": 1e-3,
    "ramp": 0.0,
    "settle": 0.0,
    "settle_time": 0.0,
}

# The table ends beside the base; half of its sizes, and its middle [m].
TABLE = box((0.8, 1.0, 0.05), (0.35, 0.0, -0.05))

# How fast a way is gone that is looked at before, and how often it is [m/s, s].
SPEED, STEP = 0.3, 0.02

# Longest time for a straight piece of it [s], and how near its end counts [m].
LONGEST, NEAR = 4.0, 1e-3

# Longest time for which an operator pushes [s], and how he brings a hand back that
# slides meanwhile [1/s].
PUSHED, STIFF = 10.0, 25.0

# Share of his speed with which an operator tries again.
SLOWER = 0.6

# How far joints stay off their limits on such a way [rad], and the arm off everything:
# its elbow is elsewhere when the hand goes the same way at another speed [m].
OFF_LIMITS, CLEAR = 0.1, 0.025


@dataclass(frozen=True)
class PandaPlace(Workplace):
    """A workplace whose robot is a Panda.

    Attributes:
        posture: Joint positions it begins with, shape (8,).
    """

    posture: Floats

    def scene(self) -> Scene:
        """The scene, with the Panda named 'arm'."""
        scene = Scene(mode="path", period=PERIOD, index=IndexSettings(kind=self.index))
        names = [f"panda_joint{k + 1}" for k in range(ARM)] + ["panda_finger_joint1"]
        scene.add_robot(
            "panda",
            name="arm",
            base=Pose(xyz=BASE),
            stopping=FIGURES,
            home=dict(zip(names, self.posture.tolist(), strict=True)),
            gripper=Gripper(
                link=HAND,
                fingers=("panda_leftfinger", "panda_rightfinger"),
                coarse=self.coarse,
            ),
            response=self.response,
        )
        self.add_solids(scene)
        return scene


class PandaPlant(Plant):
    """A Panda that is late and misses what it is told, led by its hand.

    Args:
        guard: The guard.
        rng: Draws delays and errors.
        arm: The Panda as MuJoCo sees it.
    """

    fingers = slice(ARM, ARM + 1)

    def __init__(self, guard: Guard, rng: np.random.Generator, arm: PandaArm) -> None:
        super().__init__(guard, rng)
        self.arm = arm

    @property
    def seen(self) -> Floats:
        """Where hand and fingers are as measured last: x, y, z, left, right [m]."""
        at = self.arm.hand(self.measured)[:3, 3]
        return np.array([*at, self.measured[ARM], self.measured[ARM]])

    def cycle(self, wish: Floats) -> Command:
        """One cycle in which velocities of hand and fingers are asked for [m/s]."""
        if not wish.any():
            return self.drive(np.zeros(ARM + 1))
        joints = self.arm.lead(self.measured, wish[:3])
        return self.drive(np.array([*joints, 0.5 * (wish[3] + wish[4])]))


class PandaPicker(Picker):
    """An operator who brings a hand back that slides while he pushes."""

    def push(self, wish: Floats, part_of: tuple[str, ...], other: str) -> bool:
        """Ask for the same until all these parts are felt to touch; whether they do."""
        here = self.plant.seen[:3]
        for _ in range(int(PUSHED / PERIOD)):
            q = self.plant.q
            if all(self.judge.gap(q, part, other) <= 0.0 for part in part_of):
                return True
            held = wish.copy()
            back = STIFF * (here - self.plant.seen[:3])
            held[:3] = np.where(wish[:3] == 0.0, back, wish[:3])
            if self.plant.cycle(held).action >= Action.STOP:
                return False
        return False

    def again(self, *, fingers: bool) -> None:
        """Leave what is in the way, to try again without hurry, and more slowly."""
        super().again(fingers=fingers)
        self.fast *= SLOWER


def run_episode(seed: int) -> dict[str, Any]:
    """One episode: its outcome, and what the judge found."""
    begin = process_time()
    rng = np.random.default_rng([seed, 2])
    while True:
        place, name, goal = cluttered(rng, PANDA)
        place.fixtures["table"] = TABLE
        drawn = certified(place, name, goal)
        if drawn is not None:
            break
    guard, arm, place = drawn
    outcome = Outcome(seed, certified=True)
    judge = PandaJudge(place, arm)
    picker = PandaPicker(PandaPlant(guard, rng, arm), judge, PANDA, rng)
    pick_and_place(picker, place, name, goal, outcome)
    outcome.worked_s = process_time() - begin
    return told(picker, place, outcome)


def certified(
    place: Workplace, name: str, goal: Floats
) -> tuple[Guard, PandaArm, PandaPlace] | None:
    """A guard of a place whose way is proven at rest, the Panda, and where it begins.

    Returns:
        None where the Panda does not get everywhere, or something is in the way.
    """
    model = scene_of_panda().robots["arm"].model
    arm = PandaArm(model, {**place.fixtures, **place.objects})
    ends = ends_of_way(place, name, goal, PANDA)
    begin = np.array([*POSTURE, ends[0, 3]])
    at_home = follow(arm, begin, ends[:1])
    rows = None if at_home is None else follow(arm, at_home[-1], ends[1:])
    if at_home is None or rows is None or not is_clear(place, arm, rows):
        return None
    if not carries_clear(place, name, ends):
        return None
    with_panda = PandaPlace(**vars(place), posture=at_home[-1])
    try:
        guard = Guard(with_panda.scene(), self_test=False)
    except ArmguardError:
        # Something stands where the arm begins.
        return None
    meant = place.objects[name]
    guard.remove(name)
    clear = guard.check_path(np.array([at_home[-1], *rows])).clear
    guard.place(name, Pose(xyz=tuple(meant.at.tolist())))
    return (guard, arm, with_panda) if clear else None


def is_clear(place: Workplace, arm: PandaArm, rows: list[Floats]) -> bool:
    """Whether the arm, but for its gripper, is far from everything on a way."""
    judge = PandaJudge(place, arm)
    return all(
        distance >= CLEAR
        for q in rows
        for (part, _), distance in judge.near(q).items()
        if part not in GRIPPER
    )


@cache
def scene_of_panda() -> Scene:
    """A scene with nothing but a Panda."""
    scene = Scene(mode="path")
    scene.add_robot("panda", name="arm", base=Pose(xyz=BASE))
    return scene


def follow(arm: PandaArm, begin: Floats, ends: Floats) -> list[Floats] | None:
    """Joint positions on a way of the hand, by straight pieces.

    Args:
        arm: The Panda.
        begin: Joint positions it begins with, shape (8,).
        ends: Where hand and fingers are at the end of each piece, shape (k, 5) [m].

    Returns:
        None where the hand does not get to one of them.
    """
    q, rows = begin.copy(), []
    for end in ends:
        q[ARM] = end[3]
        for _ in range(int(LONGEST / STEP)):
            way = end[:3] - arm.hand(q)[:3, 3]
            left = sqrt(way @ way)
            if left <= NEAR:
                break
            q[:ARM] += STEP * arm.lead(q, way * min(SPEED / left, 0.5 / STEP))
            if not is_within(arm, q):
                return None
            rows.append(q.copy())
        else:
            return None
    return rows


def is_within(arm: PandaArm, q: Floats) -> bool:
    """Whether the arm's joints are off their limits."""
    low, high = arm.limits
    inside = (q[:ARM] >= low + OFF_LIMITS) & (q[:ARM] <= high - OFF_LIMITS)
    return bool(inside.all())
