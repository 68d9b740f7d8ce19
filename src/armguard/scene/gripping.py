"""What may be gripped, by what, and how: settings of objects and of grippers."""

from dataclasses import dataclass, fields
from math import isfinite

from armguard.errors import SceneError


@dataclass(frozen=True, slots=True, kw_only=True)
class Grasp:
    """How an object may be approached, touched, lifted and put down.

    The speed at which fingers may close on it falls with the distance, from
    `intent_speed` at `near` to `creep` at contact.

    Attributes:
        near: Distance of fingers from which on their approach may be meant [m].
        intent_speed: Fingers that are asked to move faster mean nothing by it [m/s].
        creep: Greatest speed of a contact [m/s].
        depth: How far fingers and support may overlap with it [m].
        aim: How near to it the way of the middle between the fingers has to lead [m].
        touch: Fingers that are no farther away count as touching when it is grasped
            [m].
        lift: Distance from what it stood on from which on it has lifted clear [m].
        expiry: Longest time a contract by intent is in force [s].
    """

    near: float = 0.1
    intent_speed: float = 0.1
    creep: float = 0.02
    depth: float = 0.002
    aim: float = 0.01
    touch: float = 0.005
    lift: float = 0.010
    expiry: float = 30.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Gripper:
    """A gripper of a robot.

    Attributes:
        link: The link that carries what is held, and its fingers.
        fingers: Links that may touch what is gripped; `link` may be one of them.
        coarse: Whether one box round link and fingers stands for them while nothing is
            near.
        swap: Distance beyond what the box needs at which it is replaced by the links'
            own primitives; 1.5 times that far it comes back [m].
    """

    link: str
    fingers: tuple[str, ...]
    coarse: bool = True
    swap: float = 0.05


def check_grasp(who: str, grasp: Grasp) -> Grasp:
    """Return settings that can be true.

    Raises:
        SceneError: They cannot.
    """
    for field in fields(Grasp):
        value = getattr(grasp, field.name)
        if not (isfinite(value) and value >= 0.0):
            raise SceneError(
                f"{who}: graspable.{field.name} is {value}; it must be finite and >= 0"
            )
    for name in ("near", "intent_speed", "creep", "expiry"):
        if getattr(grasp, name) == 0.0:
            raise SceneError(f"{who}: graspable.{name} is 0; it must be > 0")
    if grasp.creep > grasp.intent_speed:
        raise SceneError(
            f"{who}: graspable.creep is {grasp.creep} m/s; it must not exceed "
            f"intent_speed, {grasp.intent_speed} m/s"
        )
    return grasp


def check_gripper(who: str, gripper: Gripper) -> Gripper:
    """Return settings that can be true; whether its links exist is asked elsewhere.

    Raises:
        SceneError: They cannot.
    """
    if not gripper.fingers:
        raise SceneError(f"{who}: gripper.fingers must name one link or more")
    if len(set(gripper.fingers)) != len(gripper.fingers):
        raise SceneError(f"{who}: gripper.fingers names a link twice")
    if not (isfinite(gripper.swap) and gripper.swap >= 0.0):
        raise SceneError(
            f"{who}: gripper.swap is {gripper.swap} m; it must be finite and >= 0"
        )
    return gripper
