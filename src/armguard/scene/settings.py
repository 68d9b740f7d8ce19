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
