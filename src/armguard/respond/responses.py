"""What a robot does about what is near: one table, that scenes and tests read.

A response changes what is asked for before it is proven. It cannot make anything safe
that is not, and what it leaves unsafe is taken back or stopped by the proof.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from armguard.scene.settings import ResponseName


@dataclass(frozen=True, slots=True)
class ResponseKind:
    """A way to answer what is near.

    Attributes:
        words: What it does, for people.
        keeps_direction: Whether what is told has the direction that was asked for.
        stops: Whether what cannot be proven ends in a stop, not in less of it.
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
