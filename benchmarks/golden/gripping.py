"""Plays with a gripper: something is picked up, carried, put down, and touched."""

import numpy as np

from armguard.errors import GraspError
from armguard.geometry import Box, Pose
from armguard.scene import Grasp, Gripper, Scene
from golden.drive import Drive, Play
from gripping.gantry import FIGURES, gantry

# Half of the sizes of the block that is picked up, and of a post beside it [m].
BLOCK, POST = (0.04, 0.04, 0.06), (0.04, 0.04, 0.1)

# Joint positions of open fingers, and of fingers that press on the block [m].
OPEN, TOUCHING = 0.04, 0.0195

# What the hand and its fingers are led to, in this order: x, y, z, both fingers [m],
# for so many cycles, and what is asked of the guard after that.
PICK_AND_PLACE = (
    ((0.0, 0.0, 0.15, OPEN), 450, ""),
    ((0.0, 0.0, 0.11, OPEN), 150, ""),
    ((0.0, 0.0, 0.11, TOUCHING), 350, "grasp"),
    ((0.0, 0.0, 0.25, TOUCHING), 300, ""),
    ((0.3, 0.1, 0.25, TOUCHING), 400, ""),
    ((0.3, 0.1, 0.08, TOUCHING), 700, "release"),
    ((0.3, 0.1, 0.105, OPEN), 300, ""),
    ((0.3, 0.1, 0.4, OPEN), 350, ""),
)


def gantry_scene() -> Scene:
    """A gantry over a table, a block that may be gripped, and a post."""
    scene = Scene(mode="path")
    scene.add_robot(
        gantry(),
        name="arm",
        stopping=FIGURES,
        home={"x": 0.0, "y": 0.0, "z": 0.4, "open_left": OPEN, "open_right": OPEN},
        gripper=Gripper(link="hand", fingers=("left", "right")),
    )
    table = Box(size=(2.0, 2.0, 0.1))
    scene.add(table, name="table", pose=Pose(xyz=(0, 0, -0.05)))
    for name, x, size in (("block", 0.0, BLOCK), ("post", 0.15, POST)):
        scene.add(
            Box(size=size),
            name=name,
            pose=Pose(xyz=(x, 0.0, size[2] / 2.0)),
            graspable=Grasp(),
        )
    return scene


def pick_and_place(drive: Drive) -> None:
    """Lead the hand from stage to stage."""
    k = drive.k
    for (x, y, z, fingers), cycles, then in PICK_AND_PLACE:
        if k <= cycles:
            drive.aim = np.array([x, y, z, fingers, fingers])
            return
        k -= cycles
        if k == 1 and then:
            ask(drive, then)


def ask(drive: Drive, call: str) -> None:
    """Have the gripper's state change, where the guard allows it."""
    try:
        getattr(drive.guard, call)("arm", "block")
    except GraspError:
        # Hashes of the commands show it: nothing is carried.
        drive.guard.engage()


def touching(drive: Drive) -> None:
    """Contacts that are allowed for a while, and both models of the hand in turns."""
    k = drive.k
    drive.aim = np.array([0.15, 0.0, 0.1285 if k % 900 < 600 else 0.2, OPEN, OPEN])
    if k == 600:
        drive.guard.allow("arm/hand", "post", depth=0.002, until=8.0)
    if k % 400 == 0:
        drive.guard.swap_model("arm", ("auto", "detailed", "coarse")[k // 400 % 3])


# Greatest speeds the hand and its fingers are led at [m/s].
SPEEDS = (0.2, 0.2, 0.1, 0.015, 0.015)

CYCLES = sum(cycles for _, cycles, _ in PICK_AND_PLACE)

GRIPPING = (
    Play(
        "gantry pick and place",
        gantry_scene,
        cycles=CYCLES,
        speed=SPEEDS,
        events=pick_and_place,
        aims=False,
    ),
    Play(
        "gantry contract",
        gantry_scene,
        cycles=2000,
        speed=(0.2, 0.2, 0.1, 0.015, 0.015),
        events=touching,
        aims=False,
    ),
)
