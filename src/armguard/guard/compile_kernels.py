"""Compile a part of the kernels into the cache.

python -m armguard.guard.compile_kernels [guarded]
Started by a guard that finds nothing compiled, so that two processes share the work.
"""

import sys

import numpy as np

from armguard.geometry import Capsule, Pose, Sphere
from armguard.guard.monitor import Monitor
from armguard.index.small_tree import compile_octree
from armguard.robot.model import CollisionElement, Joint, JointKind, Link, RobotModel
from armguard.robot.stopping import stopping_figures
from armguard.scene.scene import Scene
from armguard.scene.settings import Mode


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


def compile_cycle(mode: Mode) -> None:
    """Monitor the smallest scene for a cycle."""
    model = one_joint()
    scene = Scene(mode=mode)
    figures = stopping_figures(model, deceleration=4.0)
    scene.add_robot(model, name="rod", stopping=figures)
    scene.add(Sphere(radius=0.1), name="ball", pose=Pose(xyz=(0.0, 1.0, 0.0)))
    guard = Monitor(scene, self_test=False, compiling=True)
    guard.step(guard.home, 0.0)
    if mode != "fixed":
        guard.check_path([guard.home, guard.home])


if __name__ == "__main__":
    compile_octree()
    if "guarded" in sys.argv[1:]:
        compile_cycle("path")
