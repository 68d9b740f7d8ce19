"""A contract as it is told: who may touch whom, how, and until when."""

from dataclasses import dataclass, field
from math import isfinite

import numpy as np

from armguard.errors import GraspError
from armguard.geometry.pose import Pose
from armguard.guard import grips as at
from armguard.guard.grips import Floats

# What the kinds of contracts are called.
KINDS = {
    at.BY_INTENT: "intent",
    at.STANDING: "standing",
    at.BESIDE: "beside",
    at.LET_GO: "let go",
    at.ASKED: "asked",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Region:
    """A box in which a contact may take place.

    Attributes:
        half_extents: Half of its sizes [m].
        pose: Its frame in the world, or in `frame`.
        frame: 'robot/link', or an object that may be gripped, it moves with; None for
            the world.
    """

    half_extents: tuple[float, float, float]
    pose: Pose = field(default_factory=Pose)
    frame: str | None = None

    def __post_init__(self) -> None:
        sizes = np.asarray(self.half_extents, dtype=np.float64)
        if sizes.shape != (3,) or not (np.isfinite(sizes).all() and (sizes > 0).all()):
            raise GraspError(
                f"Region half_extents are {self.half_extents}; they must be 3 finite "
                "numbers > 0 [m]"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Contract:
    """What two bodies are allowed beyond what every pair is.

    Attributes:
        a: One body: 'robot/link' or an object's name.
        b: The other.
        kind: "held": they are not checked, since a gripper holds the object; "intent":
            fingers approach what they are meant to grip; "standing": a held object
            stands on or beside what carries it, or is put down there; "beside": they
            are nearer than they may be and must not come nearer; "let go": fingers
            round what was released; "asked": somebody called `allow`.
        depth: How far they may overlap; negative for a distance they must keep [m].
        speed: Greatest closing speed at contact [m/s].
        gain: How much faster they may close for each metre of distance [1/s].
        until: When it expires, on the clock of `step`; None if it does not [s].
        rearmed_at: Distance from which on it is over; None if no distance ends it [m].
        ending: Whether it is over as soon as the pair can do without it.
        region: Whether it holds in a region only.
    """

    a: str
    b: str
    kind: str
    depth: float
    speed: float
    gain: float
    until: float | None
    rearmed_at: float | None
    ending: bool
    region: bool


def contract_of_row(row: Floats, a: str, b: str) -> Contract:
    """A contract in force, from its numbers."""
    until, rearm = float(row[at.UNTIL]), float(row[at.REARM])
    return Contract(
        a=a,
        b=b,
        kind=KINDS[int(row[at.KIND])],
        depth=float(row[at.DEPTH]),
        speed=float(row[at.CREEP]),
        gain=float(row[at.GAIN]),
        until=until if isfinite(until) else None,
        rearmed_at=rearm if isfinite(rearm) else None,
        ending=bool(row[at.STATE] in (at.ENDING, at.EXPIRED)),
        region=bool(row[at.REGION] != at.NOWHERE),
    )
