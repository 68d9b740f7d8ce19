"""What may be gripped, by what, and how: settings of objects and of grippers."""

from dataclasses import dataclass
from typing import Annotated, Self

from pydantic import AfterValidator, Field, model_validator

from armguard.errors import SceneError, UnknownNameError, did_you_mean
from armguard.robot.model import RobotModel
from armguard.robot.tree import joints_above, rigid_groups
from armguard.scene.schema import (
    CLOSED,
    METRES,
    MOST_CREEP,
    MOST_OVERLAP,
    NotNegative,
    Positive,
    at_most,
)

CREEP, OVERLAP = at_most(MOST_CREEP, "m/s"), at_most(MOST_OVERLAP, "m")


@dataclass(frozen=True, slots=True, kw_only=True)
class Grasp:
    """How an object may be approached, touched, lifted and put down.

    The speed at which fingers may close on it falls with the distance, from
    `intent_speed` at `near` to `creep` at contact.

    Attributes:
        near: Distance of fingers from which on their approach may be intended [m].
        intent_speed: An approach of fingers that are asked to move faster is not
            intended [m/s].
        creep: Greatest speed of a contact [m/s].
        depth: How far fingers and support may overlap with it [m].
        aim: How near to it the way of the middle between the fingers has to lead [m].
        touch: Fingers that are no farther away count as touching when it is grasped
            [m].
        lift: Distance from its support from which on it has lifted clear [m].
        expiry: Longest time a contract by intent is in force [s].
    """

    __pydantic_config__ = CLOSED

    near: Annotated[Positive, METRES] = 0.1
    intent_speed: Annotated[Positive, CREEP] = 0.1
    creep: Annotated[Positive, CREEP] = 0.02
    depth: Annotated[NotNegative, OVERLAP] = 0.002
    aim: Annotated[NotNegative, OVERLAP] = 0.01
    touch: Annotated[NotNegative, OVERLAP] = 0.005
    lift: Annotated[NotNegative, OVERLAP] = 0.010
    expiry: Positive = 30.0

    @model_validator(mode="after")
    def _creep_is_slower(self) -> Self:
        if self.creep > self.intent_speed:
            raise ValueError(
                f"creep is {self.creep} m/s; it must not exceed intent_speed, "
                f"{self.intent_speed} m/s"
            )
        return self


def no_link_twice(links: tuple[str, ...]) -> tuple[str, ...]:
    """Refuse a finger that is named twice."""
    if len(set(links)) != len(links):
        raise ValueError("fingers names a link twice")
    return links


@dataclass(frozen=True, slots=True, kw_only=True)
class Gripper:
    """A gripper of a robot.

    Attributes:
        link: The link that carries the held object, and its fingers.
        fingers: Links that may touch the gripped object; `link` may be one of them.
        coarse: Whether one box round link and fingers takes their place while nothing
            is near.
        swap: Distance beyond what the box needs at which it is replaced by the links'
            own primitives; 1.5 times that far it comes back [m].
    """

    __pydantic_config__ = CLOSED

    link: str
    fingers: Annotated[
        tuple[str, ...], Field(min_length=1), AfterValidator(no_link_twice)
    ]
    coarse: bool = True
    swap: Annotated[NotNegative, METRES] = 0.05


def check_links(name: str, model: RobotModel, gripper: Gripper) -> None:
    """Check that the links of a gripper are those of one.

    Raises:
        UnknownNameError: One does not exist.
        SceneError: Its link does not move, or a finger does not ride on it or has no
            shape.
    """
    for link in (gripper.link, *gripper.fingers):
        if link not in model.links:
            raise UnknownNameError(
                f"robot '{name}' has no link '{link}' for its gripper; "
                f"{did_you_mean(link, model.links)}"
            )
    groups = rigid_groups(model)
    own = groups[gripper.link]
    if own == groups[model.root]:
        raise SceneError(
            f"robot '{name}': gripper.link '{gripper.link}' is part of its base; name "
            "one that joints move"
        )
    for finger in gripper.fingers:
        if not model.links[finger].collisions:
            raise SceneError(
                f"robot '{name}': finger '{finger}' has no collision geometry, so "
                "its contacts cannot be detected"
            )
        chain = (finger, *(joint.parent for joint in joints_above(model, finger)))
        if own not in (groups[link] for link in chain):
            raise SceneError(
                f"robot '{name}': finger '{finger}' does not ride on gripper.link "
                f"'{gripper.link}'"
            )
