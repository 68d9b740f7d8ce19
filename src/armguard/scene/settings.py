"""Settings of a scene: how the buffer is made, how near pairs are found."""

from dataclasses import dataclass
from typing import Literal, get_args

# How the distance a robot must keep is made: a number; from its stopping figures and
# its speed; from these and from where it may go while it stops.
Mode = Literal["fixed", "speed", "path"]
MODES: tuple[Mode, ...] = get_args(Mode)


@dataclass(frozen=True, slots=True)
class CubeSettings:
    """The octree's root cube.

    Attributes:
        centre: Its centre [m].
        edge: Its edge [m].
    """

    centre: tuple[float, float, float]
    edge: float


@dataclass(frozen=True, slots=True)
class IndexSettings:
    """Which index, and how fine.

    Attributes:
        kind: "octree", or "brute_force" for comparison.
        leaf_capacity: The paper's N: a leaf with more primitives is split.
        max_depth: Leaves at this depth are not split; chosen by the scene if None.
        cube: Root cube; chosen by the scene if None, enlarged if too small.
    """

    kind: Literal["octree", "brute_force"] = "octree"
    leaf_capacity: int = 5
    max_depth: int | None = None
    cube: CubeSettings | None = None


# What a robot does about what is near; see `armguard.respond.RESPONSES`.
ResponseName = Literal["stop", "slow", "deflect", "field"]

# How what a pair of two robots has left is shared between them.
Sharing = Literal["contribution", "equal", "priority"]

# What is done with a first position far from where the robot is.
FarStart = Literal["ramp", "refuse"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ResponseSettings:
    """What a robot does about what is near, and how it is given back to its operator.

    Attributes:
        kind: The response.
        sharing: How what a pair of two robots has left is shared.
        priority: Under "priority" the robot of the higher one is yielded to [-].
        recover_speed: Share of its top speeds on a way out of what is too near [-].
        resume_speed: The same while it catches up with positions it is told [-].
        far: Distance between a joint and the position it is told from which on it does
            not simply follow, until it is half as far [rad or m].
        far_start: Whether it catches up with a first position so far away, or is
            refused.
        evade: Whether it moves out of the way of objects that come at it, whatever its
            operator wants.
        evade_speed: Share of its top speeds it then uses at most [-].
        evade_time: It begins when an object that goes on straight would be too near in
            this time, or up to twice as early if it knows no good way out [s].
        field_speed: Share of its top speeds a field moves it at, at most [-].
        attraction: Under "field": speed towards the goal by what is left of the way,
            near its end [1/s].
        repulsion: Under "field": speed at which a pair is opened that has half of
            `influence` left [m/s].
        influence: Under "field": pairs that have no more than this left at rest are
            pushed apart [m].
        patience: Under "field": a goal that has not come nearer for this time is told
            as a local minimum [s].
    """

    kind: ResponseName = "deflect"
    sharing: Sharing = "contribution"
    priority: float = 0.0
    recover_speed: float = 0.1
    resume_speed: float = 0.1
    far: float = 0.2
    far_start: FarStart = "ramp"
    evade: bool = False
    evade_speed: float = 0.5
    evade_time: float = 1.0
    field_speed: float = 0.3
    attraction: float = 5.0
    repulsion: float = 0.08
    influence: float = 0.1
    patience: float = 1.5


# What each of these may be.
CHOICES: dict[str, tuple[str, ...]] = {
    "kind": get_args(ResponseName),
    "sharing": get_args(Sharing),
    "far_start": get_args(FarStart),
}
