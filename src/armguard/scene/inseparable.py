"""Links of one robot that are nearer than their buffer wherever its joints are."""

from dataclasses import dataclass
from math import floor

import numpy as np
from numpy.typing import NDArray

from armguard.robot.model import Joint, JointKind
from armguard.robot.tree import joints_above, rigid_groups
from armguard.scene.pair_distances import Distances
from armguard.scene.proposal import HALF_TURN
from armguard.scene.scene import Scene
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]

# Configurations in which pairs are measured.
SAMPLES = 1000

# A distance that changes less than this is constant [m].
CONSTANT = 1e-4

# Axes are parallel above this cosine of their angle [-].
PARALLEL = 0.999

# Buffers are proposed in steps of this [m].
STEP = 1e-4


@dataclass(frozen=True, slots=True)
class Inseparable:
    """Two links that cannot keep their buffer.

    Attributes:
        a: One link, 'robot/link'.
        b: The other.
        reason: Why.
        buffer: A buffer that they can keep [m]; None if the pair is to be allowed.
    """

    a: str
    b: str
    reason: str
    buffer: float | None = None

    def settle(self, scene: Scene) -> None:
        """Allow the pair in a scene, or give it the buffer."""
        if self.buffer is None:
            scene.allow(self.a, self.b, reason=self.reason)
        else:
            scene.set_buffer(self.a, self.b, self.buffer)


def inseparable_links(scene: Scene, tables: SceneTables) -> list[Inseparable]:
    """Pairs of links of one robot that are too near each other by construction.

    These are sections of a telescope that come nearer than their buffer, and links that
    are nearer than it at home and in each of `SAMPLES` configurations. Sampling proves
    nothing: the user decides.

    Args:
        scene: The scene.
        tables: The compiled scene.
    """
    distances = Distances(tables)
    home = distances.at(tables.home)
    sections = {k: telescope(scene, *pair) for k, pair in enumerate(distances.pairs)}
    own = [
        k
        for k, (a, b) in enumerate(distances.pairs)
        if sections[k] or (home[k] < distances.buffers[k] and robot_of_both(a, b))
    ]
    if not own:
        return []
    least, most = distances.extremes(configurations(tables), own)
    found = []
    for k in own:
        (a, b), buffer = distances.pairs[k], distances.buffers[k]
        if sections[k] and least[k] < buffer:
            joints = " and ".join(f"'{joint}'" for joint in sections[k])
            reason = f"sections of a telescope; {joints} move them"
            found.append(Inseparable(a, b, reason))
        elif most[k] < buffer:
            found.append(constant_or_near(a, b, float(least[k]), float(most[k])))
    return found


def constant_or_near(a: str, b: str, least: float, most: float) -> Inseparable:
    """A pair that is always nearer than its buffer, by its distances [m]."""
    if most <= 0.0:
        return Inseparable(a, b, "their shapes overlap wherever their joints are")
    where = f"{most * 1e3:.1f} mm apart"
    if most - least < CONSTANT:
        return Inseparable(a, b, f"{where} wherever their joints are")
    reason = f"at most {where} wherever their joints are"
    return Inseparable(a, b, reason, floor(most / 2.0 / STEP) * STEP)


def robot_of_both(a: str, b: str) -> str:
    """The robot of which two bodies are links; "" if there is none."""
    robot, slash, _ = a.partition("/")
    return robot if slash and b.startswith(f"{robot}/") else ""


def configurations(tables: SceneTables) -> Floats:
    """Configurations anywhere within the limits, the same each time, shape (s, n)."""
    low = np.where(np.isfinite(tables.lower), tables.lower, -HALF_TURN)
    high = np.where(np.isfinite(tables.upper), tables.upper, HALF_TURN)
    return np.random.default_rng(0).uniform(low, high, size=(SAMPLES, len(low)))


def telescope(scene: Scene, a: str, b: str) -> tuple[str, ...]:
    """Joints that slide two sections of a telescope along one axis.

    Args:
        scene: The scene.
        a: A body.
        b: Another body.

    Returns:
        Their names from the outer section on; empty if the bodies are no sections.
    """
    robot = robot_of_both(a, b)
    model = scene.robots[robot].model if robot else None
    if model is None or sum(map(slides, model.joints.values())) < 2:
        return ()
    links = [body.removeprefix(f"{robot}/") for body in (a, b)]
    groups = rigid_groups(model)
    for outer, inner in (links, links[::-1]):
        above = {joint.name for joint in joints_above(model, outer)}
        between = [j for j in joints_above(model, inner) if j.name not in above][::-1]
        moving = [joint for joint in between if joint.kind is not JointKind.FIXED]
        nested = len(moving) > 1 and groups[moving[0].parent] == groups[outer]
        if nested and slide_along_one_axis(between):
            return tuple(joint.name for joint in moving)
    return ()


def slides(joint: Joint) -> bool:
    """Whether a joint is prismatic."""
    return joint.kind is JointKind.PRISMATIC


def slide_along_one_axis(chain: list[Joint]) -> bool:
    """Whether the moving joints of a chain only slide, with parallel axes."""
    turned, axes = np.eye(3), []
    for joint in chain:
        turned = turned @ joint.T_parent_joint[:3, :3]
        if slides(joint):
            axes.append(turned @ joint.axis)
        elif joint.kind is not JointKind.FIXED:
            return False
    return all(abs(axes[0] @ axis) > PARALLEL for axis in axes)
