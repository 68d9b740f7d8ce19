"""A sampled proposal of pairs that may need no check; for review, never applied."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.address import array_at, stack
from armguard.geometry.pairs import measure
from armguard.geometry.place import place_row
from armguard.kernel import kernel
from armguard.robot.kinematics import forward_kinematics
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# A continuous joint has no limits to sample between; one turn shows it all [rad].
HALF_TURN = np.pi


@dataclass(frozen=True, slots=True)
class Proposal:
    """What sampling saw of a checked pair of bodies.

    Sampling proves nothing: a pair that never came near in a thousand
    configurations may do so in the next.

    Attributes:
        body_a: One body.
        body_b: The other.
        least: Least signed distance seen [m].
        greatest: Greatest signed distance seen [m].
        samples: Configurations looked at.
    """

    body_a: str
    body_b: str
    least: float
    greatest: float
    samples: int

    @property
    def kind(self) -> str:
        """'always' if the pair overlapped every time, else 'never'."""
        return "always" if self.greatest < 0.0 else "never"

    @property
    def yaml(self) -> str:
        """The line a user may paste into the scene file after a review."""
        seen = (
            f"overlapped in all of {self.samples} sampled configurations, by "
            f"{-self.greatest * 1e3:.0f} mm or more"
            if self.kind == "always"
            else f"no nearer than {self.least * 1e3:.0f} mm in {self.samples} "
            "sampled configurations"
        )
        return f'- {{a: {self.body_a}, b: {self.body_b}, reason: "{seen}"}}'


def propose_allowed(
    tables: SceneTables, *, samples: int = 2000, seed: int = 0
) -> list[Proposal]:
    """Checked pairs of one robot that always overlap, or never come within the margin.

    Args:
        tables: The compiled scene.
        samples: Random configurations within the joint limits.
        seed: Of the random configurations.

    Returns:
        Proposals, 'always' first, each in the order of the tables.
    """
    primitive_pairs, pairs = checked_pairs(tables)
    if not pairs:
        return []
    low = np.where(np.isfinite(tables.lower), tables.lower, -HALF_TURN)
    high = np.where(np.isfinite(tables.upper), tables.upper, HALF_TURN)
    rng = np.random.default_rng(seed)
    configurations = rng.uniform(low, high, size=(samples, len(low)))
    least, greatest = sampled_extremes(
        configurations,
        Tree.of(tables),
        tables.kinds,
        tables.bodies,
        tables.local_rows,
        primitive_pairs,
        len(pairs),
    )
    found = [
        Proposal(a, b, float(lo), float(hi), samples)
        for (a, b), lo, hi in zip(pairs, least, greatest, strict=True)
        if hi < 0.0 or lo > tables.margin
    ]
    return sorted(found, key=lambda p: p.kind)


def checked_pairs(tables: SceneTables) -> tuple[Ints, list[tuple[str, str]]]:
    """Primitive pairs of links of one robot that are checked.

    Returns:
        Two primitives and their body pair, ascending, shape (k, 3); the body pairs.
    """
    found: list[tuple[int, int, int]] = []
    pairs: dict[tuple[str, str], int] = {}
    count = len(tables.kinds)
    for i in range(tables.moving_count):
        for j in range(i + 1, count):
            a, b = tables.body_names[i], tables.body_names[j]
            if "/" not in a or a.split("/")[0] != b.split("/")[0]:
                continue
            if tables.checked[tables.groups[i], tables.groups[j]]:
                found.append((i, j, pairs.setdefault((a, b), len(pairs))))
    return np.array(found, dtype=np.int32).reshape(-1, 3), list(pairs)


class Tree(NamedTuple):
    """Joints of a scene, see `SceneTables`; and poses of its bodies, overwritten."""

    parent: Ints
    joint_kind: Ints
    q_index: Ints
    gain: Floats
    T_parent_joint: Floats
    axis: Floats
    T_world: Floats

    @classmethod
    def of(cls, tables: SceneTables) -> "Tree":
        """Joints of a compiled scene."""
        return cls(
            tables.parent,
            tables.joint_kind,
            tables.q_index,
            tables.gain,
            tables.T_parent_joint,
            tables.axis,
            np.zeros((len(tables.parent), 12)),
        )


def sampled_extremes(
    configurations: Floats,
    tree: Tree,
    kinds: Ints,
    bodies: Ints,
    local_rows: Floats,
    pairs: Ints,
    count: int,
) -> tuple[Floats, Floats]:
    """Least and greatest distance of body pairs over many configurations [m].

    Args:
        configurations: Joint positions, shape (s, n).
        tree: The joints.
        kinds: See `SceneTables`, from here to `local_rows`.
        bodies: Bodies of the primitives.
        local_rows: Primitives in their bodies.
        pairs: Two primitives and their body pair, ascending, shape (k, 3).
        count: Number of body pairs; those without primitives get inf and -inf.
    """
    extremes = np.full((3, count), np.inf)
    extremes[1] = -np.inf
    rows = np.stack((local_rows, local_rows))
    sample_extremes(configurations, tree, kinds, bodies, rows, pairs, extremes)
    return extremes[0], extremes[1]


@kernel(entry=True)
def sample_extremes(
    configurations: Floats,
    tree: Tree,
    kinds: Ints,
    bodies: Ints,
    rows: Floats,
    pairs: Ints,
    extremes: Floats,
) -> None:
    """Update the extremes of `sampled_extremes`.

    Args:
        configurations: See there.
        tree: See there.
        kinds: See there.
        bodies: See there.
        rows: Primitives in their bodies, and in the world, overwritten, shape
            (2, p, 16).
        pairs: See there.
        extremes: Least and greatest distance of each body pair [m], and a row of
            scratch, shape (3, k).
    """
    witness = array_at(stack(10), (10,), np.float64)
    least, greatest, nearest = extremes[0], extremes[1], extremes[2]
    local, world = rows[0], rows[1]
    for s in range(configurations.shape[0]):
        forward_kinematics(
            configurations[s],
            tree.parent,
            tree.joint_kind,
            tree.q_index,
            tree.gain,
            tree.T_parent_joint,
            tree.axis,
            tree.T_world,
        )
        for i in range(kinds.shape[0]):
            if bodies[i] >= 0:
                place_row(kinds[i], local[i], tree.T_world[bodies[i]], world[i])
        nearest[:] = np.inf
        for k in range(pairs.shape[0]):
            i, j, owner = pairs[k, 0], pairs[k, 1], pairs[k, 2]
            measure(kinds[i], world[i], kinds[j], world[j], witness)
            nearest[owner] = min(nearest[owner], witness[0])
        for p in range(nearest.shape[0]):
            least[p] = min(least[p], nearest[p])
            greatest[p] = max(greatest[p], nearest[p])
