"""Pairs that need no check, each with its reason and its source."""

from dataclasses import dataclass

from armguard.robot.model import JointKind
from armguard.robot.tree import rigid_groups
from armguard.scene.scene import Scene


@dataclass(frozen=True, slots=True)
class PairRule:
    """A pair that is not checked.

    Attributes:
        body_a: One body.
        body_b: The other.
        reason: Why.
        source: Where that is from: "rigid", "adjacent", "srdf" or "scene".
    """

    body_a: str
    body_b: str
    reason: str
    source: str


def allowed_pairs(scene: Scene) -> list[PairRule]:
    """All pairs of bodies that are not checked although one of them moves.

    1. Rigid: both belong to one group of links that fixed joints hold together;
       attached objects belong to their link's group.
    2. Adjacent: their groups are joined by one moving joint. A link without geometry
       in between is a group of its own: what lies beyond it is checked.
    3. SRDF: the robot's `disable_collisions`.
    4. Scene: allowed explicitly.

    Pairs of two robots, and of a robot and an object, are only ever allowed
    explicitly.
    """
    rules: list[PairRule] = []
    for name, robot in scene.robots.items():
        groups = rigid_groups(robot.model)
        riders: dict[str, list[str]] = {}
        for link, group in groups.items():
            riders.setdefault(group, []).append(f"{name}/{link}")
        for thing in scene.objects.values():
            if thing.attached_to and thing.attached_to.startswith(f"{name}/"):
                link = thing.attached_to.split("/", 1)[1]
                riders[groups[link]].append(thing.name)
        for members in riders.values():
            rules += [
                PairRule(a, b, "they do not move against each other", "rigid")
                for k, a in enumerate(members)
                for b in members[k + 1 :]
            ]
        for joint in robot.model.joints.values():
            if joint.kind is JointKind.FIXED:
                continue
            rules += [
                PairRule(a, b, f"joined by '{joint.name}'", "adjacent")
                for a in riders[groups[joint.parent]]
                for b in riders[groups[joint.child]]
            ]
        rules += [
            PairRule(f"{name}/{p.link_a}", f"{name}/{p.link_b}", p.reason, "srdf")
            for p in robot.model.disabled_pairs
        ]
    rules += [PairRule(a.a, a.b, a.reason, "scene") for a in scene.allowances]
    return rules
