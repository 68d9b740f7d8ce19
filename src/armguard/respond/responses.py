"""Responses of a robot to near bodies: one table, which scenes and tests read.

A response changes the requested motion before the proof. It cannot make an unsafe
motion safe: the proof reduces or stops any motion that is still unsafe.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from armguard.scene.settings import ResponseName


@dataclass(frozen=True, slots=True)
class ResponseKind:
    """Properties of a response to near bodies.

    Attributes:
        words: What the robot does, in words.
        keeps_direction: Whether the command keeps the direction of the request.
        stops: Whether an unproven request ends in a stop, not in a slower motion.
    """

    words: str
    keeps_direction: bool
    stops: bool


RESPONSES: Mapping[ResponseName, ResponseKind] = {
    "stop": ResponseKind("goes on as asked, or stops", True, True),
    "slow": ResponseKind("slows down on its own way", True, False),
    "deflect": ResponseKind("takes the nearest safe way", False, False),
    "field": ResponseKind(
        "is drawn to a goal, and pushed off what is near", False, False
    ),
}
