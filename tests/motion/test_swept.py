"""What a stopping arm can touch is a stop, though by a hair; what it cannot is none.

The joints of a small arm do their worst, each on its own; the ball is put where the tip
can just get to in one direction, at any time of its stop.
"""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import trimesh

from armguard.geometry import (
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    Hull,
    Pose,
    Sphere,
)
from armguard.guard import Level
from armguard.respond import Guard
from armguard.robot.model import CollisionElement, Link, MeshFile
from armguard.scene import Scene
from planar import LENGTHS, LIMIT, chain, chain_guard, place, two_chains
from sliding import EXACT, RADIUS, let_go, motion_of, rest_of

PERIOD = 2e-3

# Least deceleration of each joint: one rests long before the next [rad/s²].
BRAKES = (8.0, 1.5, 4.0)

# Share of that which a stop may be harder [-].
HARDER = 1.2

FIGURES = {
    **EXACT,
    "acceleration": 1.0,
    "position_error": 1e-3,
    "velocity_error": 0.01,
    "command": 4e-3,
}


def figures(joints):
    """Figures of so many joints."""
    least = {f"joint{k}": BRAKES[k] for k in range(joints)}
    most = {name: HARDER * brake for name, brake in least.items()}
    return {**FIGURES, "deceleration": least, "deceleration_most": most}


# How far the ball is inside what the tip can get to, and outside [m].
GRAIN, LEFT = 1e-8, 5e-4

# Distance to be kept [m].
FLOOR = 0.01

STATES, FEW = 40, 10

MOMENTS = 81
SHARES = np.linspace(0.0, 1.0, 5)


def least_and_most(speed, brake):
    """Times and ways of a joint that brakes at once, and of one that goes on.

    Args:
        speed: Measured speed, not 0 [rad/s].
        brake: Its least deceleration [rad/s²].
    """
    sign, fastest = np.sign(speed), abs(speed) + FIGURES["velocity_error"]
    slowest = max(abs(speed) - FIGURES["velocity_error"], 0.0)
    late = FIGURES["command"] + PERIOD
    own = {**EXACT, "deceleration": HARDER * brake}
    least = motion_of(own, slowest, 0.0, 0.0)
    own = {**EXACT, "deceleration": brake}
    most = motion_of(own, fastest, FIGURES["acceleration"], late)
    error = FIGURES["position_error"]
    rests = rest_of(*most[:2])
    return sign, rests, (least[0], least[2] - error), (most[0], most[2] + error)


def positions(q, v, horizon=0.0):
    """Times of a stop [s], and positions joints can have then, shape (t, k, n)."""
    bounds = [least_and_most(x, own) for x, own in zip(v, BRAKES, strict=False)]
    horizon = max(horizon, *(rests for _, rests, _, _ in bounds))
    times = np.linspace(0.0, horizon, MOMENTS)
    ranges = []
    for x, (sign, _, least, most) in zip(q, bounds, strict=True):
        low, high = np.interp(times, *least), np.interp(times, *most)
        ranges.append(x + sign * (low + np.multiply.outer(SHARES, high - low)))
    rows = [
        np.stack([ranges[k][i] for k, i in enumerate(chosen)], axis=-1)
        for chosen in product(range(len(SHARES)), repeat=len(q))
    ]
    return times, np.stack(rows, axis=1)


def swept(kinds, q, v, horizon=0.0):
    """Times of a stop, and where the tip can be then, (t,) [s] and (t, k, 2) [m]."""
    times, rows = positions(q, v, horizon)
    return times, place(kinds, rows)


def state(rng, joints):
    """Random positions, velocities, and a direction."""
    q = rng.uniform(-0.6, 0.6, joints) * LIMIT
    v = rng.choice([-1.0, 1.0], joints) * rng.uniform(0.1, 1.0, joints)
    angle = rng.uniform(-np.pi, np.pi)
    return q, v, np.array([np.cos(angle), np.sin(angle)])


ARMS = [("turn", "turn"), ("turn", "slide"), ("turn",) * 3]


@pytest.mark.parametrize("speed", [0.0, 0.05])
@pytest.mark.parametrize("kinds", ARMS)
def test_what_an_arm_can_touch_while_it_stops_is_a_stop(kinds, speed):
    rng, n = np.random.default_rng(8), len(kinds)
    mover = {"top_speed": speed} if speed else {}
    guard = chain_guard(
        kinds, (5.0, 5.0), figures(n), mover, period=PERIOD, buffer=FLOOR
    )
    now = 0.0
    for _ in range(STATES):
        q, v, direction = state(rng, n)
        times, points = swept(kinds, q, v)
        # The ball gets to where the tip gets in that direction.
        approach = speed * times[:, None]
        t, k = np.unravel_index(
            np.argmax(points @ direction + approach), points.shape[:2]
        )
        for beyond in (-GRAIN, LEFT + speed * times[-1] / 64.0):
            away = 2.0 * RADIUS + FLOOR + speed * times[t] + beyond
            ball = Pose(xyz=(*(points[t, k] + away * direction), 0.0))
            # Long enough since the last time for the ball to have got there.
            now += 1000.0
            guard.place("ball", ball, stamp=now)
            let_go(guard)
            verdict = guard.step(q, now, velocity=v, now=now)
            stopped = verdict.level is Level.STOP
            assert stopped == (beyond < 0.0), (q, v, direction)
            assert verdict.nearest.headroom <= beyond + GRAIN


def rim(radius, z):
    """Points of a circle about the z axis, shape (k, 3) [m]."""
    angle = np.linspace(0.0, 2.0 * np.pi, 90, endpoint=False)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z + 0 * angle], -1)


def ball_of(axes):
    """Points of an ellipsoid, shape (k, 3) [m]."""
    rows = np.random.default_rng(5).normal(size=(200, 3))
    return np.array(axes) * rows / np.linalg.norm(rows, axis=1)[:, None]


CORNERS = np.array(list(product((-0.08, 0.08), (-0.05, 0.05), (-0.03, 0.03))))
TETRAHEDRON = np.array([(-0.08, 0, 0.02), (0.09, 0.05, 0), (0, -0.07, 0), (0, 0, 0.1)])

# A tool at the tip, points of its surface, and what its bound may be too wide by: what
# is curved is bounded by a box about it [m].
TOOLS = {
    "box": (Box(size=(0.16, 0.1, 0.06)), CORNERS, LEFT),
    "hull": (Hull(points=TETRAHEDRON), TETRAHEDRON, LEFT),
    "capsule": (
        Capsule(start=(-0.08, 0, 0), end=(0.06, 0.03, 0.02), radius=1e-6),
        np.array([(-0.08, 0, 0), (0.06, 0.03, 0.02)]),
        LEFT,
    ),
    "cylinder": (
        Cylinder(radius=0.04, height=0.12),
        np.concatenate([rim(0.04, -0.06), rim(0.04, 0.06)]),
        5e-3,
    ),
    "cone": (
        Cone(radius=0.05, height=0.12, top_radius=0.02),
        np.concatenate([rim(0.05, -0.06), rim(0.02, 0.06)]),
        5e-3,
    ),
    "ellipsoid": (
        Ellipsoid(semi_axes=(0.08, 0.05, 0.03)),
        ball_of((0.08, 0.05, 0.03)),
        5e-3,
    ),
}
TURNS = ("turn", "turn")
TURNED = Pose(rpy=(0.4, 0.5, 0.7))


@pytest.mark.parametrize("name", TOOLS)
def test_what_a_tool_can_touch_while_its_arm_stops_is_a_stop(name):
    tool, surface, left = TOOLS[name]
    scene = Scene(buffer=FLOOR, margin=1.0, period=PERIOD)
    scene.add_robot(chain(TURNS, 1e-3), name="arm", stopping=figures(2))
    held = Pose(xyz=(LENGTHS[1], 0.0, 0.0), rpy=TURNED.rpy)
    scene.add(tool, name="tool", pose=held, attached_to="arm/link1")
    touch_by_a_hair(scene, surface @ TURNED.matrix()[:3, :3].T, left)


@pytest.mark.parametrize("speed", [0.0, 0.05])
def test_what_the_meshes_of_a_link_can_touch_is_a_stop(speed, tmp_path):
    """Its primitives enclose them, and would stop it where the meshes need not."""
    model = chain(TURNS)
    pieces = [TETRAHEDRON, CORNERS + np.array([0.02, 0.01, 0.04])]
    elements = []
    for k, points in enumerate(pieces):
        path = tmp_path / f"piece{k}.stl"
        trimesh.convex.convex_hull(points).export(path)
        place_of_tip = Pose(xyz=(LENGTHS[1], 0.0, 0.0)).matrix()
        elements.append(
            CollisionElement(geometry=MeshFile(path=path), T_link_geometry=place_of_tip)
        )
    link = Link(name="link1", collisions=tuple(elements))
    model = replace(model, links={**model.links, "link1": link})
    scene = Scene(buffer=FLOOR, margin=1.0, period=PERIOD)
    scene.add_robot(model, name="arm", stopping=figures(2))
    touch_by_a_hair(scene, np.concatenate(pieces), LEFT, speed)


def touch_by_a_hair(scene, surface, left, speed=0.0):
    """Put a ball where a surface at the tip just gets to, and where it just does not.

    Args:
        scene: An arm that turns about two joints.
        surface: Points of what is at its tip, in directions of its last link [m].
        left: Beyond this the ball must not stop the arm [m].
        speed: Top speed of the ball [m/s].
    """
    rng = np.random.default_rng(7)
    ball, far = Sphere(radius=RADIUS), Pose(xyz=(5.0, 5.0, 0.0))
    scene.add(ball, name="ball", pose=far, top_speed=speed)
    guard, now = Guard(scene, self_test=False), 0.0
    x, y, z = surface.T
    for _ in range(FEW):
        q, v, direction = state(rng, 2)
        direction = np.array([*direction, rng.uniform(-1.0, 1.0)])
        direction /= np.linalg.norm(direction)
        times, rows = positions(q, v)
        approach = speed * np.repeat(times, rows.shape[1] * len(surface))
        rows = rows.reshape(-1, 2)
        tips, angle = place(TURNS, rows), rows.sum(axis=1)[:, None]
        points = np.stack(
            [
                tips[:, :1] + np.cos(angle) * x - np.sin(angle) * y,
                tips[:, 1:] + np.sin(angle) * x + np.cos(angle) * y,
                0.0 * angle + z,
            ],
            axis=-1,
        ).reshape(-1, 3)
        k = int(np.argmax(points @ direction + approach))
        for beyond in (-GRAIN, left + speed * times[-1] / 64.0):
            at = points[k] + (RADIUS + FLOOR + approach[k] + beyond) * direction
            # Long enough since the last time for the ball to have got there.
            now += 1000.0
            guard.place("ball", Pose(xyz=tuple(at)), stamp=now)
            let_go(guard)
            verdict = guard.step(q, now, velocity=v, now=now)
            stopped = verdict.level is Level.STOP
            assert stopped == (beyond < 0.0), (q, v, direction)
            assert verdict.nearest.headroom <= beyond + GRAIN


@pytest.mark.parametrize("kinds", ARMS[:2])
def test_what_two_arms_can_touch_of_each_other_is_a_stop(kinds):
    rng, n = np.random.default_rng(9), len(kinds)
    for _ in range(FEW):
        q, v, direction = state(rng, n)
        other_q, other_v, _ = state(rng, n)
        times, _ = swept(kinds, other_q, other_v)
        times, points = swept(kinds, q, v, times[-1])
        _, others = swept(kinds, other_q, other_v, times[-1])
        reach = (points @ direction).max(axis=1)
        back = (others @ direction).min(axis=1)
        t = int(np.argmax(reach - back))
        if t == 0:
            continue
        tip = points[t, np.argmax(points[t] @ direction)]
        tip_of_other = others[t, np.argmin(others[t] @ direction)]
        for beyond in (-GRAIN, 2.0 * LEFT):
            base = tip + (2.0 * RADIUS + FLOOR + beyond) * direction - tip_of_other
            bases, homes = [(0.0, 0.0), base], [q, other_q]
            guard = two_chains(
                kinds, bases, homes, figures(n), period=PERIOD, buffer=FLOOR
            )
            let_go(guard)
            both_v = np.concatenate([v, other_v])
            both = np.concatenate([q, other_q])
            verdict = guard.step(both, 5.0, velocity=both_v, now=5.0)
            stopped = verdict.level is Level.STOP
            assert stopped == (beyond < 0.0), (both, both_v, direction)
            assert verdict.nearest.headroom <= beyond + GRAIN
