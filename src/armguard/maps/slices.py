"""Slices of a robot's configurations: which are free over two of its joints."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from armguard.batch.checker import Checker
from armguard.errors import did_you_mean
from armguard.maps.cell_plan import CoordinationError
from armguard.maps.diagram import CELLS, FINEST, Grid, boxes_of, grid_of
from armguard.prove.paving import Paver
from armguard.prove.tile_search import (
    FREE,
    LABEL,
    PARAMETERS,
    TOUCHING,
    UNKNOWN,
)
from armguard.prove.tube import Tube
from armguard.robot.kinematics import PRISMATIC
from armguard.scene import Scene
from armguard.scene.compile import compile_scene
from armguard.scene.restricted import restricted, riders

# A joint that may be anywhere is divided into so many parts, or fewer.
PARTS = 16


@dataclass(frozen=True, slots=True, eq=False)
class Slice:
    """Configurations of a robot over two of its joints.

    Attributes:
        joints: Both, 'robot/joint'.
        units: Unit of each, "rad" or "m".
        anywhere: Joints that may be anywhere within their limits: what is free is free
            for all their positions. All others are at home.
        lower: Least position of both joints [rad or m].
        upper: Greatest position of both [rad or m].
        step: Side of a cell [rad or m].
        labels: FREE, TOUCHING or UNKNOWN in each cell, shape (k, m): a cell is free if
            all of it is.
    """

    joints: tuple[str, str]
    units: tuple[str, str]
    anywhere: tuple[str, ...]
    lower: tuple[float, float]
    upper: tuple[float, float]
    step: float
    labels: Grid

    def share(self, label: int) -> float:
        """Share of the cells that have a label [-]."""
        return float((self.labels == label).mean())

    @property
    def others(self) -> str:
        """Where the other joints are, in words."""
        if not self.anywhere:
            return "the others at home"
        names = " and ".join(name.split("/", 1)[1] for name in self.anywhere)
        return f"{names} anywhere, the others at home"

    @property
    def shares(self) -> str:
        """How much of the slice is what, in words."""
        words = (FREE, "free"), (TOUCHING, "forbidden"), (UNKNOWN, "unknown")
        return ", ".join(
            f"{100.0 * self.share(label):.1f} % {word}" for label, word in words
        )

    @property
    def sentence(self) -> str:
        """The slice in one sentence."""
        return f"{' and '.join(self.joints)}, {self.others}: {self.shares}"


def common_robot(joints: Sequence[str], names: Sequence[str]) -> str:
    """Robot of the first of some joints, to which all of them have to belong.

    Args:
        joints: The joints, 'robot/joint'.
        names: All joints of the scene.

    Raises:
        CoordinationError: A joint is none of this robot, or is named twice.
    """
    robot = joints[0].split("/", 1)[0]
    own = [known for known in names if known.split("/", 1)[0] == robot]
    for name in joints:
        if name not in own or joints.count(name) > 1:
            wrong = "is named twice" if name in own else f"is no joint of '{robot}'"
            hint = "" if name in own else f"; {did_you_mean(name, own or names)}"
            raise CoordinationError(f"'{name}' {wrong}{hint}")
    return robot


def configuration_slice(
    scene: Scene, joints: tuple[str, str], anywhere: Collection[str] = ()
) -> Slice:
    """Which configurations of a robot are free over two of its joints.

    Pairs of the robot's links with each other, the still world, and other robots at
    home have to keep their buffers.

    Args:
        scene: The scene.
        joints: Two joints of one robot, 'robot/joint'.
        anywhere: Joints of it that may be anywhere, 'robot/joint'.

    Raises:
        CoordinationError: A joint is none of this robot, or is named twice.
        SceneError: The scene contradicts itself.
    """
    tables = compile_scene(scene)
    names, every = tables.q_names, [*joints, *anywhere]
    robot = common_robot(every, names)
    number = [part.name for part in tables.robots].index(robot)
    if len(anywhere) > PARAMETERS - 2:
        raise CoordinationError(
            f"{len(anywhere)} joints may be anywhere; give {PARAMETERS - 2} or fewer"
        )
    paver = Paver(
        Checker(restricted(tables, riders(tables), lambda a, b: number in (a, b)))
    )
    places = [names.index(name) for name in every]
    lower, upper = tables.lower[places], tables.upper[places]
    finest = FINEST * float((upper - lower)[:2].max())
    tubes, owner = [], np.zeros(len(names), dtype=np.intp)
    for d, k in enumerate(places):
        # What may be anywhere has a parameter too, which is divided into a few parts.
        ends = np.array([lower[d], upper[d]] if d < 2 else [0.0, PARTS * finest])
        rows = np.tile(tables.home, (2, 1))
        rows[:, k] = lower[d], upper[d]
        tubes.append(Tube.straight(ends, rows))
        owner[k] = d
    paving = paver.pave_box(tubes, owner, finest)
    near = np.flatnonzero(paving.leaves[:, LABEL] != FREE)
    boxes = boxes_of(paving, near, tuple(tubes[:2])) - np.repeat(lower[:2], 2)
    label = paving.leaves[near, LABEL].astype(np.uint8)
    low, high = lower.tolist(), upper.tolist()
    slides = tables.q_index[tables.joint_kind == PRISMATIC]
    first, second = ("m" if k in slides else "rad" for k in places[:2])
    return Slice(
        joints=joints,
        units=(first, second),
        anywhere=tuple(anywhere),
        lower=(low[0], low[1]),
        upper=(high[0], high[1]),
        step=finest / CELLS,
        labels=grid_of(boxes, label, tuple(upper[:2] - lower[:2]), finest / CELLS),
    )
