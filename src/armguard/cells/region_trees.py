"""Static objects as region octrees, with which whole arms are compared."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.cells.descent import (
    CELL,
    CLEAR,
    VISITED,
    WORD,
    Arms,
    descend_primitives,
    descend_trees,
)
from armguard.cells.masks import clear_masks, mask_shapes
from armguard.cells.state import BLOCK_SIDE, MEMBERS, NONE, empty_bits, empty_look
from armguard.cells.view import CellView, places_of
from armguard.errors import CellMapError
from armguard.geometry.place import place_row
from armguard.geometry.shapes import ShapeKind
from armguard.scene import Scene
from armguard.scene.compile import compile_scene
from armguard.scene.poses import body_poses
from armguard.scene.tables import SceneTables
from armguard.table import Ledger

Floats = NDArray[np.float64]
Words = NDArray[np.uint64]


@dataclass(frozen=True, slots=True)
class RegionHits:
    """Configurations compared with region octrees.

    Attributes:
        clear: Whether every link is proven to keep its buffers from all static objects,
            shape (n,).
        cell: Place of a black cell along x, y and z that a link meets; -1 where it is
            clear, or a link leaves the cube, shape (n, 3).
        visited: Cubes of cells that were compared, shape (n,).
    """

    clear: NDArray[np.bool_]
    cell: NDArray[np.int64]
    visited: NDArray[np.int64]


class RegionTrees:
    """Region octrees of a scene's static objects, and the links that move among them.

    A cell is black where it may meet an object that is grown by its buffer. There is a
    tree for all links that are checked against the same objects with the same buffers.
    A link that meets no black cell keeps its buffers. One that meets any is nearer than
    its buffer and the diagonal of a cell. A link that is not wholly in the cube counts
    as too near.

    Attributes:
        trees: Cells of each tree, the black ones occupied.

    Args:
        scene: The scene, or its tables.
        centre: Middle of the cube, world [m].
        cell: Edge of a cell [m].
        size: Cells along an edge of the cube: 64, 128, 256 or 512.

    Raises:
        SceneError: The scene contradicts itself.
        CellMapError: A number is out of its range, or an object is a half-space.

    Example:
        >>> import armguard as ag
        >>> scene = ag.bay_scene()
        >>> trees = ag.RegionTrees(scene, centre=(1.4, 0, 1), cell=0.04, size=128)
        >>> bool(trees.compare([scene.home]).clear[0])
        True
    """

    def __init__(
        self,
        scene: Scene | SceneTables,
        centre: ArrayLike,
        cell: float = 0.01,
        size: int = 256,
    ) -> None:
        t = scene if isinstance(scene, SceneTables) else compile_scene(scene)
        view = CellView(centre, cell, size)
        self._joints, self._size = len(t.q_names), size
        words = (size // 4) ** 3
        look, tree = empty_look(view.claims.lattice, words, 0), empty_bits(words, NONE)
        self._look, self._tree = Ledger(look), Ledger(tree)
        self.trees: list[CellView] = []
        self._arms: list[Ledger] = []
        moving, static = riders_and_obstacles(t)
        rows = placed_rows(t, static)
        groups = t.groups[static]
        rules = [
            (t.checked[g, groups].tobytes(), t.buffers[g, groups].tobytes())
            for g in t.groups[moving]
        ]
        for rule in dict.fromkeys(rules):
            own = moving[[one == rule for one in rules]]
            group = t.groups[own[0]]
            near = np.flatnonzero(t.checked[group, groups])
            if (t.kinds[static[near]] == ShapeKind.HALF_SPACE).any():
                raise CellMapError(
                    "a half-space has no end, so no cells; give a box in its place"
                )
            slacks = np.zeros((len(near), 2))
            slacks[:, 1] = t.buffers[group, groups[near]]
            kinds = np.ascontiguousarray(t.kinds[static[near]])
            mask_shapes(kinds, rows[near], slacks, self._look.lines)
            found = CellView(centre, cell, size)
            set_words(found, look.inside | look.shell)
            clear_masks(self._look.lines)
            self.trees.append(found)
            self._arms.append(Ledger(arms_table(t, own)))
        self._claims = [Ledger(one.claims) for one in self.trees]

    def compare(self, q: ArrayLike, *, rasterised: bool = False) -> RegionHits:
        """Compare the moving links with the trees in many configurations.

        Args:
            q: Joint positions in the order of the scene, shape (n, joints) [rad or m];
                a row with a number that is not finite is not clear.
            rasterised: Whether each arm is rasterised to a tree and two trees are
                descended together, in place of the primitives and one tree.

        Raises:
            CellMapError: `q` is no array of numbers of that shape.
        """
        given = rows_of(q, self._joints)
        blocks = self._size // BLOCK_SIDE
        clear, visited = np.ones(len(given), dtype=bool), np.zeros(len(given), np.int64)
        cell = np.full((len(given), 3), -1, dtype=np.int64)
        for arms, claims in zip(self._arms, self._claims, strict=True):
            left = np.flatnonzero(clear)
            out = np.zeros((len(left), 3), dtype=np.int64)
            if rasterised:
                trees = self._look.lines, self._tree.lines, claims.lines
                descend_trees(given[left], arms.lines, *trees, out)
            else:
                descend_primitives(given[left], arms.lines, claims.lines, out)
            visited[left] += out[:, VISITED]
            clear[left] = out[:, WORD] == CLEAR
            hit = out[:, CELL] >= 0
            cell[left[hit]] = places_of(out[hit, WORD], out[hit, CELL], blocks)
        return RegionHits(clear, cell, visited)


def rows_of(q: ArrayLike, joints: int) -> Floats:
    """Joint positions as an array, shape (n, joints).

    Raises:
        CellMapError: They are none.
    """
    try:
        rows = np.ascontiguousarray(q, dtype=np.float64)
    except (TypeError, ValueError):
        rows = np.zeros(0)
    if rows.ndim != 2 or rows.shape[1] != joints:
        raise CellMapError(f"q must be an array of numbers, (rows, {joints})")
    return rows


def riders_and_obstacles(t: SceneTables) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Primitives that robots move, and those that are static and present."""
    coarse = {part.coarse for part in t.holds.grippers}
    names = np.array(list(t.body_names)[: t.modelled])
    kept = ~np.isin(names, sorted(coarse))
    for item in t.standing.values():
        kept[item.places] &= item.present
    moved = np.zeros(t.modelled, dtype=bool)
    moved[: t.moving_count] = t.robot_of_primitive >= 0
    return np.flatnonzero(kept & moved), np.flatnonzero(kept & ~moved)


def placed_rows(t: SceneTables, chosen: NDArray[np.intp]) -> Floats:
    """Rows of static primitives in the world, shape (k, 16)."""
    rows, poses = t.local_rows[chosen].copy(), body_poses(t, t.home)
    for k, i in enumerate(chosen.tolist()):
        # What may be gripped has a frame.
        if t.bodies[i] >= 0:
            place_row(t.kinds[i], t.local_rows[i], poses[t.bodies[i]], rows[k])
    return rows


def arms_table(t: SceneTables, own: NDArray[np.intp]) -> Arms:
    """Some primitives that robots move, with their joints."""
    return Arms(
        parent=t.parent,
        joint_kind=t.joint_kind,
        q_index=t.q_index,
        gain=t.gain,
        T_parent_joint=t.T_parent_joint,
        axis=t.axis,
        kinds=np.ascontiguousarray(t.kinds[own]),
        bodies=np.ascontiguousarray(t.bodies[own]),
        local_rows=np.ascontiguousarray(t.local_rows[own]),
        T_world=np.zeros((len(t.parent), 12)),
    )


def set_words(out: CellView, words: Words) -> None:
    """Set the occupied cells of a view, with their summaries."""
    members = words
    for level in out.claims.occupied:
        level[:] = members
        taken = members != 0
        taken = np.append(taken, np.zeros(-len(taken) % MEMBERS, dtype=bool))
        members = np.packbits(taken, bitorder="little").view(np.uint64)
