"""Free configurations near the middle of the joint limits, and closed fingers."""

from collections.abc import Collection, Iterable, Iterator, Set
from dataclasses import dataclass
from itertools import combinations
from math import inf

import numpy as np
from numpy.typing import NDArray

from armguard.robot.model import Joint, JointKind, RobotModel
from armguard.robot.tree import joints_above, rigid_groups
from armguard.scene.pair_distances import Distances
from armguard.scene.proposal import HALF_TURN
from armguard.scene.scene import Scene
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]

# Configurations that are looked at; the first is the middle of the limits, the last
# ones lie anywhere within them.
SAMPLES = 300

# A configuration with this much room beyond every buffer ends the search [m].
ROOM = 0.05

# Bases nearer than this stand at one place [m].
ONE_PLACE = 0.01

# Nearness to the middle counts more than room beyond this share of the most found [-].
ENOUGH = 0.5

# Pairs of primitives measured in one search at most; a scene of many obstacles is
# given fewer samples.
MOST_MEASURED = 20_000_000

# Positions are proposed in steps of this many decimals [rad or m].
DECIMALS = 3

# Fingers without a common joint belong to one gripper only if they slide no farther
# than this [m].
FINGER_STROKE = 0.1

# Positions of a gripper from one end of its way to the other.
POSITIONS = 11

# Closed fingers overlap by no more than this [m].
TOUCH = 0.002


def free_homes(
    scene: Scene, tables: SceneTables, robots: Set[str], ignored: Set[str] = frozenset()
) -> Iterator[dict[str, dict[str, float]]]:
    """Configurations in which all pairs keep their buffers.

    Those with at least half of the most room found come first, the nearest to the
    middle of the limits before all others.

    The search is the same each time. Robots of one model get the same positions. A
    pair that is nearer than its buffer in every sample is left to the guard.

    Args:
        scene: The scene.
        tables: The compiled scene.
        robots: Robots that may be elsewhere; all others stay at home.
        ignored: Robots whose pairs with each other do not count.

    Yields:
        Positions by robot and joint [rad or m].
    """
    distances = Distances(tables)
    count = max(20, min(SAMPLES, MOST_MEASURED // max(len(distances), 1)))
    counts = np.array(
        [not {robot_of(a), robot_of(b)} <= ignored for a, b in distances.pairs], bool
    )
    seen, room = [], []
    for q in candidates(scene, tables, robots, count):
        seen.append(q)
        room.append(distances.at(q) - distances.buffers)
        if not (room[-1][counts] < ROOM).any():
            break
    rooms = np.array(room).reshape(len(seen), -1)
    counts &= rooms.max(axis=0, initial=-inf) >= 0.0
    least = rooms[:, counts].min(axis=1, initial=inf)
    enough = least >= ENOUGH * max(least.max(), 0.0)
    for k in [*np.flatnonzero(enough).tolist(), *np.argsort(-least).tolist()]:
        if least[k] < 0.0:
            return
        at = dict(zip(tables.q_names, seen[k].tolist(), strict=True))
        yield {
            name: {joint: at[f"{name}/{joint}"] for joint in robot.model.q_names}
            for name, robot in scene.robots.items()
            if name in robots
        }


def robot_of(body: str) -> str:
    """The robot of a link, or the object itself."""
    return body.partition("/")[0]


def coinciding(
    scene: Scene, contacts: Iterable[Collection[str]]
) -> list[tuple[str, str]]:
    """Robots in contact whose bases stand at one place.

    Args:
        scene: The scene.
        contacts: Pairs of bodies in contact.
    """
    touching = [{robot_of(body) for body in pair} for pair in contacts]
    return [
        (first.name, second.name)
        for first, second in combinations(scene.robots.values(), 2)
        if {first.name, second.name} in touching
        and np.linalg.norm(np.subtract(first.base.xyz, second.base.xyz)) < ONE_PLACE
    ]


def candidates(
    scene: Scene, tables: SceneTables, robots: Set[str], count: int
) -> Iterator[Floats]:
    """Configurations from the middle of the limits outwards, each shape (n,)."""
    rng = np.random.default_rng(0)
    for k in range(count):
        q, drawn = tables.home.copy(), dict[object, Floats]()
        for part in tables.robots:
            own = slice(part.first_joint, part.first_joint + part.joint_count)
            low, high = tables.lower[own], tables.upper[own]
            ends = np.isfinite(low) & np.isfinite(high)
            low, high = np.where(ends, low, -HALF_TURN), np.where(ends, high, HALF_TURN)
            kind = (part.joints, low.tobytes(), high.tobytes())
            if kind not in drawn:
                drawn[kind] = rng.uniform(-1.0, 1.0, size=len(low))
            half = (high - low) / 2.0
            at = np.round((low + high) / 2.0 + k / count * half * drawn[kind], DECIMALS)
            if part.name in robots:
                q[own] = np.clip(at, low, high) + 0.0
        yield q


@dataclass(frozen=True, slots=True)
class Gripping:
    """A gripper as its joints show it.

    Attributes:
        carrier: The link the fingers are joined to.
        fingers: The outermost links with geometry that its joints move.
        joints: Places of q that close it, by name.
        links: All links with geometry that its joints move.
    """

    carrier: str
    fingers: tuple[str, ...]
    joints: tuple[str, ...]
    links: tuple[str, ...]


def grippings(model: RobotModel, shaped: Set[str]) -> list[Gripping]:
    """Grippers of a robot: links that one joint moves against each other.

    These are links on both sides of a joint that another joint mimics, and two links
    that slide in opposite directions by no more than `FINGER_STROKE`.

    Args:
        model: The robot.
        shaped: Links that have geometry.
    """
    groups = rigid_groups(model)
    families: dict[tuple[str, ...], list[Joint]] = {}
    moving = [
        joint for joint in model.joints.values() if joint.kind is not JointKind.FIXED
    ]
    for joint in moving:
        driver = joint.mimic.joint if joint.mimic else joint.name
        families.setdefault((driver,), []).append(joint)
    for k, a in enumerate(moving):
        for b in moving[k + 1 :]:
            if groups[a.parent] == groups[b.parent] and slide_together(a, b):
                families[a.name, b.name] = [a, b]
    found = []
    for drivers, joints in families.items():
        children = {groups[joint.child] for joint in joints}
        roots = [joint for joint in joints if groups[joint.parent] not in children]
        if len(roots) < 2 or len({groups[joint.parent] for joint in roots}) > 1:
            continue
        links = tuple(
            link for link in model.links if link in shaped and groups[link] in children
        )
        inner = {
            groups[joint.parent]
            for link in links
            for joint in joints_above(model, link)
        }
        fingers = tuple(link for link in links if groups[link] not in inner)
        if len(fingers) > 1:
            found.append(Gripping(roots[0].parent, fingers, drivers, links))
    return found


def slide_together(a: Joint, b: Joint) -> bool:
    """Whether two joints slide fingers towards each other."""
    for joint in (a, b):
        stroke = joint.upper - joint.lower
        if joint.kind is not JointKind.PRISMATIC or not stroke <= FINGER_STROKE:
            return False
    if a.mimic or b.mimic:
        return False
    axes = [joint.T_parent_joint[:3, :3] @ joint.axis for joint in (a, b)]
    return float(axes[0] @ axes[1]) < -0.99


def touching_fingers(
    scene: Scene, tables: SceneTables, q: Floats | None = None
) -> dict[tuple[str, str], str]:
    """Pairs of one gripper's links that do no more than touch when it is closed.

    The distance is about 0 at one end of the gripper's way, and grows towards the
    other end.

    Args:
        scene: The scene.
        tables: The compiled scene.
        q: Configuration in which they must touch; either end of the way if None.

    Returns:
        The reason why each pair may touch, by the names of its bodies.
    """
    distances = Distances(tables)
    found: dict[tuple[str, str], str] = {}
    for own, joint, way in strokes(scene, tables, q):
        by_end = np.array([distances.at(end) for end in (way[0], way[-1])])
        now = by_end.min(axis=0) if q is None else distances.at(q)
        for k, (a, b) in enumerate(distances.pairs):
            if not {a, b} <= own or abs(now[k]) > distances.buffers[k]:
                continue
            opens = by_end[:, k].max() > now[k] + distances.buffers[k]
            if opens and now[k] >= -TOUCH:
                found[a, b] = f"fingers of one gripper; {joint} closes them"
    return found


def strokes(
    scene: Scene, tables: SceneTables, q: Floats | None = None
) -> Iterator[tuple[set[str], str, Floats]]:
    """The way of each gripper from one end to the other.

    Args:
        scene: The scene.
        tables: The compiled scene.
        q: Positions of all other joints; home if None.

    Yields:
        Bodies that its joints move, the quoted names of these joints, and
        configurations, shape (k, n).
    """
    place = {name: k for k, name in enumerate(tables.q_names)}
    for name, robot in scene.robots.items():
        for gripping in grippings(robot.model, robot.fits.keys()):
            joints = [place[f"{name}/{joint}"] for joint in gripping.joints]
            ends = tables.lower[joints], tables.upper[joints]
            if np.isfinite(ends).all():
                way = np.tile(tables.home if q is None else q, (POSITIONS, 1))
                way[:, joints] = np.linspace(*ends, POSITIONS)
                own = {f"{name}/{link}" for link in gripping.links}
                yield own, " and ".join(map(repr, gripping.joints)), way
