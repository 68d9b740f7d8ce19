"""Chains of joints in a plane, with a ball at the tip, and where that is."""

import numpy as np

from armguard.geometry import Pose, Sphere
from armguard.motion.pair_state import Pair
from armguard.motion.state import NEXT
from armguard.record import dtype_of
from armguard.respond import Guard
from armguard.robot.model import CollisionElement, Joint, JointKind, Link, RobotModel
from armguard.scene import Scene
from sliding import EXACT, RADIUS

KINDS = {"turn": JointKind.REVOLUTE, "slide": JointKind.PRISMATIC}

# Length of what each joint moves [m].
LENGTHS = (0.5, 0.3, 0.4)

# Of each joint [rad] or [m].
LIMIT = 1.0


def place(kinds, q):
    """Where the tip of a chain is, shape (..., 2) [m].

    What slides does so along what it carries.

    Args:
        kinds: "turn" or "slide" for each joint.
        q: Joint positions, shape (..., n).
    """
    q = np.asarray(q)
    angle, p = np.zeros(q.shape[:-1]), np.zeros((*q.shape[:-1], 2))
    for k, (kind, length) in enumerate(zip(kinds, LENGTHS, strict=False)):
        angle = angle + q[..., k] * (kind == "turn")
        reach = length + q[..., k] * (kind == "slide")
        p = p + np.stack([reach * np.cos(angle), reach * np.sin(angle)], axis=-1)
    return p


def chain(kinds, radius=RADIUS):
    """A robot of these joints, and a ball of this radius at its tip."""
    links, joints = {"base": Link(name="base")}, {}
    above, before = "base", 0.0
    for k, (kind, length) in enumerate(zip(kinds, LENGTHS, strict=False)):
        ball = CollisionElement(
            geometry=Sphere(radius=radius),
            T_link_geometry=Pose(xyz=(length, 0, 0)).matrix(),
        )
        tip = k == len(kinds) - 1
        links[f"link{k}"] = Link(name=f"link{k}", collisions=(ball,) if tip else ())
        joints[f"joint{k}"] = Joint(
            name=f"joint{k}",
            kind=KINDS[kind],
            parent=above,
            child=f"link{k}",
            T_parent_joint=Pose(xyz=(before, 0, 0)).matrix(),
            axis=np.array([0.0, 0.0, 1.0] if kind == "turn" else [1.0, 0.0, 0.0]),
            lower=-LIMIT,
            upper=LIMIT,
        )
        above, before = f"link{k}", length
    return RobotModel(name="chain", path=None, links=links, joints=joints, root="base")


def chain_scene(kinds, ball, figures=EXACT, mover=None, **settings):
    """A scene of a chain and a ball.

    Args:
        kinds: "turn" or "slide" for each joint.
        ball: Its centre, shape (2,) [m].
        figures: Stopping figures.
        mover: Options of the ball.
        settings: Options of the scene.
    """
    scene = Scene(**{"buffer": 0.0, "margin": 1.0, **settings})
    scene.add_robot(chain(kinds), name="arm", stopping=figures)
    pose = Pose(xyz=(*ball, 0.0))
    scene.add(Sphere(radius=RADIUS), name="ball", pose=pose, **(mover or {}))
    return scene


def chain_guard(*args, **settings):
    """A guard of a chain and a ball, see `chain_scene`."""
    return Guard(chain_scene(*args, **settings), self_test=False)


def two_chains(kinds, bases, homes, figures=EXACT, **settings):
    """A guard of two chains, with their bases [m] and homes, each a row for either."""
    scene = Scene(**{"buffer": 0.0, "margin": 1.0, **settings})
    for name, base, q in zip(("left", "right"), bases, homes, strict=True):
        scene.add_robot(
            chain(kinds),
            name=name,
            base=Pose(xyz=(*base, 0.0)),
            home={f"joint{k}": x for k, x in enumerate(q)},
            stopping=figures,
        )
    return Guard(scene, self_test=False)


def pair_of(tables):
    """The pair of a chain's tip and the ball, as a proof gets it.

    Args:
        tables: Their compiled scene.
    """
    pair = np.zeros(1, dtype_of(Pair)).view(np.recarray)[0]
    pair.kind, pair.body, pair.plan = tables.kinds[:2], tables.bodies[:2], NEXT
    pair.row = pair.local = tables.local_rows[:2]
    pair.exact = -1
    return pair
