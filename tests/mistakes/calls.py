"""Mistakes in a scene in Python.

A function makes or fills a scene; the answer is what it raises or logs.
"""

import numpy as np

from armguard import Box, Capsule, Guard, Pose, Scene, Sphere
from mistakes.mistake import Mistake


def with_arm(**given):
    """Adds the arm to a scene."""
    return lambda scene, urdf: scene.add_robot(urdf, "a", **given)


def with_part(*given, **named):
    """Adds an object to a scene."""
    return lambda scene, _: scene.add(*given, **named)


def alone(**given):
    """Makes a scene."""
    return lambda scene, _: Scene(**given)


def at_one_place(scene, urdf):
    """Guards two arms whose bases coincide."""
    for name in ("a", "b"):
        scene.add_robot(
            urdf,
            name,
            stopping={"deceleration": 1.0},
            home={"turn": 0.5, "lift": 0.1},
        )
    Guard(scene, self_test=False)


CUBE = Box(size=(1, 1, 1))
IN_MILLIMETRES = ([(0, 0, 0), (1200, 0, 0), (0, 800, 0)], [(0, 1, 2)])

CALLS = {
    "degrees of a pose": Mistake(
        *("is 90 rad", "rpy[2]", "give radians: 1.5708"),
        lambda *_: Pose(rpy=(0, 0, 90)),
    ),
    "few degrees of a pose": Mistake(
        *("[0.0, 0.0, 10.0]", "robot 'a': base: rpy", "give radians"),
        with_arm(base=Pose(rpy=(0, 0, 10))),
    ),
    "degrees of a home position": Mistake(
        *("at 45", "home puts joint 'turn'", "give radians"),
        with_arm(home={"turn": 45}),
    ),
    "degrees of a figure": Mistake(
        *("is 500", "deceleration of joint 'turn'", "give radians"),
        with_arm(stopping={"deceleration": 500}),
    ),
    "degrees of a deceleration": Mistake(
        *("is 57 rad/s²", "deceleration of joint 'turn'", "give radians: 0.995"),
        with_arm(stopping={"deceleration": 57}),
        logged=True,
    ),
    "milliseconds": Mistake(*("is 20 s", "period", "20 ms are 0.02"), alone(period=20)),
    "one millisecond": Mistake(
        *("is 1 s", "period", "give seconds: 0.001"), alone(period=1), logged=True
    ),
    "milliseconds late": Mistake(*("is 5 s", "late", "5 ms are 0.005"), alone(late=5)),
    "millimetres of a buffer": Mistake(
        *("is 30 m", "buffer", "give metres: 0.03"), alone(buffer=30)
    ),
    "millimetres of the margin": Mistake(
        *("is 500 m", "margin", "give metres: 0.5"), alone(margin=500)
    ),
    "millimetres of a fit": Mistake(
        *("is 30 m", "robot 'a': fit_target", "give metres: 0.03"),
        with_arm(fit_target=30),
    ),
    "millimetres of a joint": Mistake(
        *("at 100", "home puts joint 'lift'", "give metres"),
        with_arm(home={"lift": 100}),
    ),
    "millimetres of a base": Mistake(
        *("50 m", "robot 'a': base", "give metres: 0.05"),
        with_arm(base=Pose(xyz=(50, 0, 0))),
        logged=True,
    ),
    "millimetres of a box": Mistake(
        *("2000 m", "object 't'", "give metres: 2"),
        with_part(Box(size=(1200, 2000, 50)), "t"),
        logged=True,
    ),
    "millimetres of a capsule": Mistake(
        *("300 m", "object 't'", "give metres: 0.3"),
        with_part(Capsule(start=(0, 0, 0), end=(0, 0, 300), radius=50), "t"),
        logged=True,
    ),
    "millimetres of a place": Mistake(
        *("800 m", "object 't': pose", "give metres: 0.8"),
        with_part(CUBE, "t", pose=Pose(xyz=(0, -800, 0))),
        logged=True,
    ),
    "millimetres of a mesh": Mistake(
        *("1200 m", "object 't'", "give metres: 1.2"),
        lambda scene, _: scene.add_mesh(IN_MILLIMETRES, "t"),
        logged=True,
    ),
    "millimetres a second": Mistake(
        *("is 1600 m/s", "object 't': top_speed", "give metres"),
        with_part(Sphere(radius=0.1), "t", top_speed=1600),
    ),
    "few millimetres a second": Mistake(
        *("is 60 m/s", "object 't': top_speed", "give 0.06"),
        with_part(Sphere(radius=0.1), "t", top_speed=60),
        logged=True,
    ),
    "NaN": Mistake(
        *("is nan s", "period", "it must be finite and >= 0"), alone(period=np.nan)
    ),
    "text for a number": Mistake(
        *("'20ms'", "period", "it must be a number [s]"), alone(period="20ms")
    ),
    "a flag for a number": Mistake(
        *("is True", "buffer", "it must be a number [m]"), alone(buffer=True)
    ),
    "text for a position": Mistake(
        *("at '0.5'", "home puts joint 'turn'", "it must be a number [rad or m]"),
        with_arm(home={"turn": "0.5"}),
    ),
    "text for a figure": Mistake(
        *("is '5'", "deceleration", "it must be a number, or numbers by joint name"),
        with_arm(stopping={"deceleration": "5"}),
    ),
    "positions as a list": Mistake(
        *("[0.5, 0.1]", "robot 'a': home", "give a mapping by name, such as {'turn'"),
        with_arm(home=[0.5, 0.1]),
    ),
    "a base as a list": Mistake(
        *("[0, 0, 0]", "robot 'a': base", "give a Pose, such as Pose(xyz=(0, 0, 0)"),
        with_arm(base=[0, 0, 0]),
    ),
    "a pose as a tuple": Mistake(
        *("(0, 0, 1)", "object 't': pose", "give a Pose, such as"),
        with_part(CUBE, "t", pose=(0, 0, 1)),
    ),
    "stopping as a number": Mistake(
        *("is 5.0", "robot 'a': stopping", "such as {'deceleration': 5.0}"),
        with_arm(stopping=5.0),
    ),
    "numbers without joints": Mistake(
        *("[5, 5, 5]", "deceleration", "it must be a number, or numbers by joint name"),
        with_arm(stopping={"deceleration": [5, 5, 5]}),
    ),
    "a misspelt figure": Mistake(
        *("'decelaration'", "figure", "did you mean 'deceleration'"),
        with_arm(stopping={"decelaration": 1}),
    ),
    "name and shape exchanged": Mistake(
        *("Box(", "the name", "it must be text, as in add(Box(size="),
        with_part("t", CUBE),
    ),
    "one size of three": Mistake(
        *("is 2.0", "Box size", "it must be 3 numbers, as in (0.1, 0.2, 0.3)"),
        lambda *_: Box(size=2.0),
    ),
    "text for a size": Mistake(
        *("is '0.1'", "Sphere radius", "it must be a number [m]"),
        lambda *_: Sphere(radius="0.1"),
    ),
    "a mesh without faces": Mistake(
        *("of 1 arrays", "a mesh", "give its vertices and its faces"),
        lambda scene, _: scene.add_mesh((np.zeros((3, 3)),), "t"),
    ),
    "a file for a scene": Mistake(
        *("'two.yaml'", "Scene", "read a scene file with load_scene(FILE)"),
        lambda *_: Guard("two.yaml"),
    ),
    "no shape": Mistake(
        *("1.0 is no shape", "object 't'", "give shapes such as"),
        with_part([1.0], "t"),
    ),
    "a quaternion that is not unit": Mistake(
        *("norm 0.5", "quat_wxyz", "it must be 1"),
        lambda *_: Pose(quat_wxyz=(0.5, 0, 0, 0)),
    ),
    "two numbers of three": Mistake(
        *("(0.0, 0.0)", "xyz", "it must be 3 finite numbers"),
        lambda *_: Pose(xyz=(0, 0)),
    ),
    "another robot": Mistake(
        *("'fr3'", "robot", "or one of the named robots: baxter"),
        lambda scene, _: scene.add_robot("fr3", "a"),
    ),
    "another mode": Mistake(
        *("'pth'", "mode", "one of fixed, speed, path"), alone(mode="pth")
    ),
    "two robots at one place": Mistake(
        *("coincide", "bases of 'a' and 'b'", "give one a `base`"), at_one_place
    ),
}
