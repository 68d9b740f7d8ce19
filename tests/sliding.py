"""Balls that slide on one line, and the worst their declared figures allow.

On a line every bound of the proof is exact: what a pair needs is what its two sides
can come nearer at the corner of what is declared. `worst_stop` finds that by small
steps of a joint that does its worst, without any formula of the program.
"""

import numpy as np

from armguard.geometry import Pose, Sphere
from armguard.guard.watch import RUNNING
from armguard.respond import Guard
from armguard.robot.model import CollisionElement, Joint, JointKind, Link, RobotModel
from armguard.scene import Scene

RADIUS = 0.05

# Where the second slide and the fixed body are, from the first one's zero [m].
APART = 10.0

# How far a slide goes, and the farthest of its ball from its base [m].
LIMIT = 50.0
REACH = LIMIT + RADIUS

# Figures of a slide that adds as little as may be to what is needed.
EXACT = {
    "velocity": 2.0,
    "acceleration": 1e-9,
    "deceleration": 10.0,
    "deceleration_most": 20.0,
    "position_error": 0.0,
    "velocity_error": 0.0,
    "tracking_error": 0.0,
    "sensing": 0.0,
    "command": 0.0,
    "stale": 1.0,
}

# A measured stop: speeds [m/s], times [s] and ways [m].
MEASURED = [(v, 0.4 * v, 0.2 * v * v) for v in np.linspace(0.125, 2.0, 16).tolist()]

# How many times the least `sensing` a cycle may be longer where its time is unknown.
UNTOLD_CYCLE = 1.0

# Step of a joint that does its worst [s].
STEP = 5e-5


def slide():
    """A ball on a joint that slides along x."""
    ball = CollisionElement(geometry=Sphere(radius=RADIUS), T_link_geometry=np.eye(4))
    joint = Joint(
        name="joint",
        kind=JointKind.PRISMATIC,
        parent="base",
        child="ball",
        T_parent_joint=np.eye(4),
        axis=np.array([1.0, 0.0, 0.0]),
        lower=-LIMIT,
        upper=LIMIT,
    )
    links = {"base": Link(name="base"), "ball": Link(name="ball", collisions=(ball,))}
    return RobotModel(
        name="slide", path=None, links=links, joints={"joint": joint}, root="base"
    )


def slides(*figures, mover=None, others=0, response="deflect", **settings):
    """A guard of slides on one line, the second from the right; or of one and a ball.

    Args:
        figures: What differs from `EXACT`, for each slide.
        mover: Options of the ball in the place of the second slide.
        others: Further balls, far from the line.
        response: What the slides do about what is near.
        settings: Options of the scene.
    """
    scene = Scene(**{"buffer": 0.0, "margin": 1.0, **settings})
    for name, own, x in zip(("left", "right"), figures, (0.0, APART), strict=False):
        scene.add_robot(
            slide(),
            name=name,
            base=Pose(xyz=(x, 0.0, 0.0)),
            stopping={**EXACT, **own},
            response=response,
        )
    if len(figures) == 1:
        scene.add(
            Sphere(radius=RADIUS),
            name="ball",
            pose=Pose(xyz=(APART, 0.0, 0.0)),
            **(mover or {}),
        )
    for k in range(others):
        pose = Pose(xyz=(k, 50.0, 0.0))
        scene.add(Sphere(radius=RADIUS), name=f"other{k}", pose=pose)
    return Guard(scene, self_test=False)


def at_gap(gap, joints=1):
    """Positions at which the first slide is this far from what is opposite [m]."""
    return [APART - 2.0 * RADIUS - gap] + [0.0] * (joints - 1)


def let_go(guard):
    """Have the slides driven by their operators, whatever was before."""
    guard.reset()
    guard._watch.phase[:] = RUNNING


def motion_of(figures, speed, push, effect, top=None):
    """Times, speeds and ways of a slide that is pushed, and then stops.

    Args:
        figures: What differs from `EXACT`.
        speed: Its speed, of either sign [m/s].
        push: Acceleration until the stop takes effect, of either sign [m/s²].
        effect: When that is [s].
        top: Greatest speed its operator drives it to; its top speed if None [m/s].
    """
    f = {"ramp": 0.0, **EXACT, **figures}
    top = max(abs(speed), f["velocity"] if top is None else top)
    end = effect + f["ramp"] + top / f["deceleration"] + STEP
    # Both the moment the stop takes effect and its end are steps.
    before = np.linspace(0.0, effect, round(effect / STEP) + 2)
    after = np.linspace(effect, end, round((end - effect) / STEP) + 1)
    driven = np.clip(speed + push * before, -top, top)
    since = after - effect
    share = np.minimum(since / f["ramp"], 1.0) if f["ramp"] > 0.0 else 1.0 + 0.0 * since
    left = np.maximum(abs(driven[-1]) - f["deceleration"] * integral(since, share), 0.0)
    times = np.concatenate([before, after])
    speeds = np.concatenate([driven, np.sign(driven[-1]) * left])
    return times, speeds, integral(times, speeds)


def rest_of(times, speeds):
    """When such a slide rests [s]."""
    return float(times[np.flatnonzero(speeds)[-1]]) if speeds.any() else 0.0


def worst_stop(figures, speed, reaction, driven=None):
    """How far a slide gets at most before it rests [m], and how long it takes [s].

    Args:
        figures: What differs from `EXACT`.
        speed: Its measured speed [m/s].
        reaction: From the measurement until a stop takes effect [s].
        driven: Greatest speed its operator may drive it to; its top speed if None
            [m/s].
    """
    f = {"velocity_error": 0.0, "settle": 0.0, **EXACT, **figures}
    speed = min(speed + f["velocity_error"], f["velocity"])
    top = None if driven is None else min(driven, f["velocity"])
    times, speeds, ways = motion_of(figures, speed, f["acceleration"], reaction, top)
    swing = f["settle"] * speeds[times <= reaction].max() / f["velocity"]
    return ways[-1] + swing + f["position_error"], max(rest_of(times, speeds), reaction)


def integral(times, values):
    """Running integral by the trapezoidal rule."""
    parts = 0.5 * np.diff(times) * (values[1:] + values[:-1])
    return np.concatenate([[0.0], np.cumsum(parts)])
