"""The two parts of the kernels that two processes compile into the cache."""

from collections.abc import Callable
from typing import Any

import numba
import numpy as np

from armguard.geometry import Capsule, Pose, Sphere
from armguard.geometry.pairs import measure
from armguard.geometry.shapes import ShapeKind
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.index.small_tree import compile_octree
from armguard.respond.whole_cycle import (
    begin_filtered_cycle,
    end_filtered_cycle,
    run_filtered_cycle,
)
from armguard.robot.model import CollisionElement, Joint, JointKind, Link, RobotModel
from armguard.robot.stopping import stopping_figures
from armguard.scene.scene import Scene
from armguard.scene.settings import Mode
from armguard.separate import link

# Makes a guard of a scene, and calls what its cycles call.
TryOut = Callable[[Scene], None]


def one_joint() -> RobotModel:
    """The smallest robot there is."""
    rod = Capsule(start=(0.1, 0.0, 0.0), end=(0.4, 0.0, 0.0), radius=0.05)
    element = CollisionElement(geometry=rod, T_link_geometry=np.eye(4))
    return RobotModel(
        name="rod",
        path=None,
        links={
            "base": Link(name="base"),
            "rod": Link(name="rod", collisions=(element,)),
        },
        joints={
            "joint": Joint(
                name="joint",
                kind=JointKind.REVOLUTE,
                parent="base",
                child="rod",
                T_parent_joint=np.eye(4),
                axis=np.array([0.0, 0.0, 1.0]),
                lower=-1.0,
                upper=1.0,
                velocity=1.0,
            )
        },
        root="base",
    )


def compile_cycle(mode: Mode, try_out: TryOut) -> None:
    """Guard the smallest scene for a cycle."""
    model = one_joint()
    scene = Scene(mode=mode)
    figures = stopping_figures(model, deceleration=4.0)
    scene.add_robot(model, name="rod", stopping=figures)
    scene.add(Sphere(radius=0.1), name="ball", pose=Pose(xyz=(0.0, 1.0, 0.0)))
    try_out(scene)


def compile_filter(last_first: bool) -> None:
    """Compile the filtered cycle and all that it calls, see `link`."""
    link(run_filtered_cycle, last_first)
    lines, numbers = numba.int64[::1], numba.float64[::1]
    wish = (numbers, numba.int64, numbers, lines, lines)
    entries: tuple[tuple[Any, tuple[Any, ...]], ...] = (
        (run_filtered_cycle, wish),
        (begin_filtered_cycle, wish),
        (end_filtered_cycle, (numbers, numba.int64, lines, lines)),
    )
    for kernel, arguments in entries:
        kernel.compile(arguments)


def compile_here(guarded: bool, try_out: TryOut) -> None:
    """The part of a guard that starts: distances, fixed buffers, half of the filter."""
    row, out = np.zeros(ROW_WIDTH), np.zeros(WITNESS_WIDTH)
    measure(int(ShapeKind.SPHERE), row, int(ShapeKind.SPHERE), row, out)
    compile_cycle("fixed", try_out)
    if guarded:
        compile_filter(last_first=True)


def compile_there(guarded: bool, try_out: TryOut) -> None:
    """The part of the other process: the octree, half of the filter, paths."""
    compile_octree()
    if guarded:
        compile_filter(last_first=False)
        compile_cycle("path", try_out)
