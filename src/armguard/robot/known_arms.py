"""Arms that are recognised by the names and the distances of their joints."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from armguard.robot.model import Joint, JointKind, RobotModel

FILE = Path(__file__).with_name("known_arms.toml")

# How far the distance of two joints may differ from that of the description [m].
# Calibrated kinematics differ by a millimetre.
LENGTH_TOLERANCE = 0.002


@dataclass(frozen=True, slots=True)
class KnownArm:
    """A recognised arm.

    Attributes:
        name: Its name in `known_arms.toml`.
        title: Maker and type.
        family: Family of its stopping figures.
        joints: Its joints, from the base to the hand, as the robot names them.
        home: A home by joint, with the fingers that the robot has open [rad or m].
    """

    name: str
    title: str
    family: str
    joints: tuple[str, ...]
    home: Mapping[str, float]


@cache
def known_data() -> Mapping[str, Any]:
    """Families and arms of the data file."""
    return tomllib.loads(FILE.read_text(encoding="utf-8"))


def known_arms(model: RobotModel) -> tuple[KnownArm, ...]:
    """The arms that are recognised in a robot; each joint belongs to at most one.

    Args:
        model: The robot.
    """
    movers = {j.child: j for j in model.joints.values()}
    found: list[tuple[float, KnownArm]] = []
    for name, row in known_data()["arms"].items():
        for prefix in prefixes(model, row["joints"][0]):
            joints = tuple(prefix + joint for joint in row["joints"])
            lengths = chain_lengths(model, movers, joints)
            if lengths is None:
                continue
            miss = float(np.abs(np.subtract(lengths, row["lengths"])).max())
            if miss <= LENGTH_TOLERANCE:
                home = dict(zip(joints, map(float, row["home"]), strict=True))
                for finger, position in row.get("fingers", {}).items():
                    if prefix + finger in model.q_names:
                        home[prefix + finger] = position
                arm = KnownArm(name, row["title"], row["family"], joints, home)
                found.append((miss, arm))
    taken: set[str] = set()
    kept = []
    for _, arm in sorted(found, key=lambda pair: pair[0]):
        if taken.isdisjoint(arm.joints):
            taken.update(arm.joints)
            kept.append(arm)
    return tuple(kept)


def known_home(model: RobotModel) -> dict[str, float]:
    """A home of the recognised arms, if the robot's SRDF names no configuration.

    Args:
        model: The robot.

    Returns:
        Positions by joint [rad or m]; a position outside a joint's limits is left out.
    """
    if model.group_states:
        return {}
    return {
        name: position
        for arm in known_arms(model)
        for name, position in arm.home.items()
        if model.joints[name].lower <= position <= model.joints[name].upper
    }


def prefixes(model: RobotModel, joint: str) -> list[str]:
    """What precedes the name of an arm's first joint in a robot's joint names."""
    return [name.removesuffix(joint) for name in model.joints if name.endswith(joint)]


def chain_lengths(
    model: RobotModel, movers: Mapping[str, Joint], joints: Sequence[str]
) -> list[float] | None:
    """Distances from each joint's origin to the next one's at the zero pose.

    Args:
        model: The robot.
        movers: The joint above each link.
        joints: Joints, from the base on.

    Returns:
        Distances [m]; None if the robot has no such chain.
    """
    lengths = []
    for first, second in pairwise(joints):
        joint = model.joints.get(second)
        if joint is None or first not in model.joints:
            return None
        origin = joint.T_parent_joint[:, 3]
        while (above := movers.get(joint.parent)) is not None and above.name != first:
            if above.kind is not JointKind.FIXED:
                return None
            origin, joint = above.T_parent_joint @ origin, above
        if above is None:
            return None
        lengths.append(float(np.linalg.norm(origin[:3])))
    return lengths


def family_figures(family: str) -> tuple[dict[str, Any], dict[str, str]]:
    """Figures of a family and where each is from, by the names of `StoppingFigures`."""
    rows = known_data()["families"][family]
    values: dict[str, Any] = {}
    sources: dict[str, str] = {}
    if "like" in rows:
        values, sources = family_figures(rows["like"])
    for key, row in rows.items():
        if key != "like":
            values[key], sources[key] = row
    return values, sources
