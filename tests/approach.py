"""Scenes in which stops are predicted, and an arm that turns towards a ball."""

import numpy as np

from armguard.geometry import Pose, Sphere
from armguard.respond import Guard
from armguard.scene import Scene, bay_scene
from arms import simple_arm

FIGURES = {
    "deceleration": 4.0,
    "acceleration": 8.0,
    "deceleration_most": 8.0,
    "velocity": 2.0,
    "sensing": 0.003,
    "command": 0.003,
    "stale": 0.05,
}

# Time of a cycle [s].
PERIOD = 0.001

# The ball's centre is this far from the arm's axis, its angle is 45 degrees [m].
CENTRE = np.sqrt(0.5)

# Radii of ball and arm [m].
BALL, ARM = 0.1, 0.04


def ball_scene(*, ball=None, settings=None, response="deflect", **figures):
    """One joint, one metre of arm and a ball of radius 0.1 m."""
    scene = Scene(**{"mode": "path", "margin": 0.6, **(settings or {})})
    scene.add_robot(
        simple_arm(joints=1, length=1.0),
        name="arm",
        stopping={**FIGURES, **figures},
        response=response,
        home={"joint1": -1.0},
    )
    scene.add(
        Sphere(radius=BALL),
        name="ball",
        pose=Pose(xyz=(0.5, 0.5, 0.2)),
        **(ball or {}),
    )
    return scene


def ball_guard(**options):
    """A guard of that scene."""
    return Guard(ball_scene(**options))


def angle_at(gap):
    """Where the joint is if the arm is this far from the ball [m] -> [rad]."""
    return np.pi / 4 - np.arcsin((BALL + ARM + gap) / CENTRE)


def moving(guard, gap, speed, age=None):
    """Verdict of an arm that was let go and is this near and this fast.

    Args:
        guard: From `ball_guard`.
        gap: Distance [m].
        speed: Speed towards the ball [rad/s].
        age: Age of the measurement [s]; None for the declared delay.
    """
    guard.reset()
    q = angle_at(gap)
    guard.step([q - speed * PERIOD], 0.0, velocity=[0.0])
    now = None if age is None else PERIOD + age
    if age is not None:
        # The cycle itself is not late: the one before came a period earlier.
        guard.reset()
        guard.step([q - speed * PERIOD], 0.0, velocity=[0.0], now=now - PERIOD)
    return guard.step([q], PERIOD, velocity=[speed], now=now)


def gap_of(guard, speed, deficit, age=None):
    """Gap at which an arm of that speed lacks a given length [m], by bisection."""
    near, far = 0.0, 0.5
    for _ in range(60):
        gap = 0.5 * (near + far)
        pair = moving(guard, gap, speed, age).nearest
        if pair is not None and -pair.headroom > deficit:
            near = gap
        else:
            far = gap
    return near


def moving_bay(mode="path", period=PERIOD):
    """The bay with stops predicted from its figures; its floor is the mode's own."""
    return in_mode(bay_scene(), mode, period)


def in_mode(made, mode, period=PERIOD):
    """The robots and objects of a scene, all in one mode with its own floor."""
    scene = Scene(mode=mode, period=period, index=made.index)
    for name, robot in made.robots.items():
        scene.add_robot(
            robot.model,
            name=name,
            base=robot.base,
            home=robot.home,
            stopping=robot.stopping,
        )
    for name, item in made.objects.items():
        scene.add([*item.shapes, *item.surfaces], name=name, pose=item.pose)
    for pair in made.allowances:
        scene.allow(pair.a, pair.b, reason=pair.reason)
    return scene
