"""`bench gripping`: what contracts, the models of a gripper and transactions cost."""

from time import perf_counter_ns
from typing import Any

import numpy as np

from armguard.geometry import Box, Cylinder, Pose
from armguard.respond import Guard
from armguard.scene import Grasp, Gripper, Scene
from speed.scenes import PERIOD
from timing import Progress, percentiles, quiet

CYCLES = 4_000

# Cycles between two changes of the model: the first is the one that changes it [-].
CYCLES_OF_MODEL = 10

# How far below the hand the cup's middle is, between the fingers [m].
BELOW_HAND = 0.14

# Whether the Panda has a gripper, and whether the cup is between its fingers.
CASES = {
    "far_without_gripper": (False, False),
    "far": (True, False),
    "under_contract": (True, True),
}


def bench(cycles: int, progress: Progress) -> dict[str, Any]:
    """Durations of `Guard.filter` of a Panda at rest, by what its gripper is about."""
    answer: dict[str, Any] = {"cycles": cycles}
    for name, (gripper, near) in CASES.items():
        progress(f"measuring {cycles} filtered cycles: {name}")
        guard = Guard(cup_scene(gripper, near), self_test=False, progress=progress)
        with quiet():
            answer[name] = percentiles(resting(guard, cycles))
    answer["contracts"] = len(guard.contracts)
    progress("changing the model, and who holds the cup")
    with quiet():
        answer |= swaps(cycles) | transactions(guard, max(cycles // 20, 5))
    return answer


def cup_scene(gripper: bool, near: bool) -> Scene:
    """A Panda over a table, and a cup between its fingers or out of reach."""
    scene = Scene(mode="path")
    fingers = ("panda_leftfinger", "panda_rightfinger")
    scene.add_robot(
        "panda",
        name="arm",
        home={"panda_finger_joint1": 0.0275},
        gripper=Gripper(link="panda_hand", fingers=fingers) if gripper else None,
    )
    scene.add(Box(size=(1.2, 2.0, 0.05)), name="table", pose=Pose(xyz=(0.7, 0, -0.1)))
    # Beneath the hand at home, 2.5 mm from each finger.
    height = 0.59 - BELOW_HAND if near else -0.02
    scene.add(
        Cylinder(radius=0.025, height=0.1),
        name="cup",
        pose=Pose(xyz=(0.307, 0.0, height)),
        graspable=Grasp(aim=0.05) if gripper else False,
    )
    return scene


def resting(guard: Guard, count: int, start: float = 0.0) -> list[int]:
    """Durations of cycles in which no motion is desired [ns]."""
    still = np.zeros(len(guard.q_names))
    taken = []
    for k in range(count):
        begin = perf_counter_ns()
        guard.filter(guard.home, still, start + k * PERIOD, velocity=still)
        taken.append(perf_counter_ns() - begin)
    return taken


def swaps(count: int) -> dict[str, Any]:
    """Durations of cycles that change the model, and of those that do not."""
    guard = Guard(cup_scene(True, False), self_test=False)
    swap: list[int] = []
    other: list[int] = []
    for k in range(max(count // CYCLES_OF_MODEL, 2)):
        guard.swap_model("arm", ("detailed", "coarse")[k % 2])
        first, _, *rest = resting(guard, CYCLES_OF_MODEL, k * CYCLES_OF_MODEL * PERIOD)
        swap.append(first)
        other += rest
    return {"with_swap": percentiles(swap), "without_swap": percentiles(other)}


def transactions(guard: Guard, count: int) -> dict[str, Any]:
    """Durations of `grasp` and `release`."""
    times = np.zeros((count, 3))
    for k in range(count):
        begin = perf_counter_ns()
        guard.grasp("arm", "cup")
        middle = perf_counter_ns()
        guard.release("arm", "cup")
        times[k] = begin, middle, perf_counter_ns()
    grasped, released = np.diff(times).T
    return {"grasp": percentiles(grasped), "release": percentiles(released)}
