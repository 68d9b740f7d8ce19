"""Whole arms compared with a set of cells, by descent of its summaries.

Either primitives descend, each by its exact distance to the cubes of cells, or the arm
is rasterised to a second set, and both are descended together: two summaries have in
common what both have members in.
"""

from typing import NamedTuple

import numpy as np

from armguard.address import array_at, stack
from armguard.cells.carve import look_of
from armguard.cells.clearance import claims_of, make_nearest, make_query, search
from armguard.cells.masks import mask_shape
from armguard.cells.state import NONE, Bits, Lattice, Look
from armguard.cells.words import put_word
from armguard.geometry.bounds import row_bounds
from armguard.geometry.place import place_row
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.kernel import kernel
from armguard.lanes import lowest
from armguard.robot.kinematics import forward_kinematics
from armguard.table import (
    IntVector,
    LongMatrix,
    LongVector,
    Matrix,
    Vector,
    opener,
    table,
)

# What is found in place of a word: nothing, or that a primitive is not in the cube.
CLEAR, OUTSIDE = -1, -2

# Columns of what is found: word and cell, and what was visited.
WORD, CELL, VISITED = range(3)


@table
class Arms(NamedTuple):
    """Primitives that joints move.

    Attributes:
        parent: See `KinematicTable`, from here to `axis`.
        joint_kind: Joint kinds.
        q_index: Places in q.
        gain: Multipliers and offsets.
        T_parent_joint: Joint frames.
        axis: Joint axes.
        kinds: ShapeKind of each primitive, shape (m,).
        bodies: Their bodies, shape (m,).
        local_rows: Their rows in the frames of these, shape (m, 16).
        T_world: Poses of all bodies, overwritten, shape (b, 12).
    """

    parent: IntVector
    joint_kind: IntVector
    q_index: IntVector
    gain: Matrix
    T_parent_joint: Matrix
    axis: Matrix
    kinds: IntVector
    bodies: IntVector
    local_rows: Matrix
    T_world: Matrix


arms_of, bits_of = opener(Arms), opener(Bits)


@kernel(inline=False)
def place_bodies(q: Vector, arms: Arms) -> None:
    """Write the poses of all bodies."""
    forward_kinematics(
        q, arms.parent, arms.joint_kind, arms.q_index, arms.gain,
        arms.T_parent_joint, arms.axis, arms.T_world,
    )  # fmt: skip


@kernel(inline=False)
def is_within(kind: int, row: Vector, lattice: Lattice) -> bool:
    """Whether a primitive is in the cube of the cells; false where a number is NaN."""
    box = array_at(stack(6), (6,), np.float64)
    row_bounds(kind, row, 0.0, box)
    edge = lattice.side * lattice.cell
    for k in range(3):
        low = lattice.low[k]
        if not (box[k] >= low and box[k + 3] <= low + edge):
            return False
    return True


@kernel(inline=False, entry=True)
def descend_primitives(
    q: Matrix, arms_lines: LongVector, claims_lines: LongVector, out: LongMatrix
) -> None:
    """Compare arms with the occupied cells, primitive by primitive.

    Args:
        q: Joint positions, shape (n, joints) [rad or m].
        arms_lines: Ledger of `Arms`.
        claims_lines: Ledger of `Claims`.
        out: Nearest occupied cell that the first primitive meets which meets any, its
            word and bit, or CLEAR or OUTSIDE; cubes visited; shape (n, 3).
    """
    arms, claims = arms_of(arms_lines), claims_of(claims_lines)
    query, best = make_query(), make_nearest()
    row = query.row
    for n in range(q.shape[0]):
        place_bodies(q[n], arms)
        out[n, WORD], out[n, CELL], out[n, VISITED] = CLEAR, -1, 0
        for i in range(arms.kinds.shape[0]):
            query.kind = arms.kinds[i]
            row[:] = 0.0
            place_row(
                arms.kinds[i], arms.local_rows[i], arms.T_world[arms.bodies[i]], row
            )
            if not is_within(arms.kinds[i], row, claims.lattice):
                out[n, WORD] = OUTSIDE
                break
            best.gap, best.word, best.cell = row[0], -1, -1
            best.visited = best.measured = 0
            search(query, -1, claims.lattice, claims.occupied, best)
            out[n, VISITED] += best.visited
            if best.word >= 0:
                out[n, WORD], out[n, CELL] = best.word, best.cell
                break


@kernel(inline=False, entry=True)
def descend_trees(
    q: Matrix, arms_lines: LongVector, look_lines: LongVector,
    tree_lines: LongVector, claims_lines: LongVector, out: LongMatrix,
) -> None:  # fmt: skip
    """Compare arms with the occupied cells, each rasterised to a tree.

    Args:
        q: Joint positions, shape (n, joints) [rad or m].
        arms_lines: Ledger of `Arms`.
        look_lines: Ledger of a `Look` without masks, which it is again afterwards.
        tree_lines: Ledger of `Bits` without a cell, which it is again afterwards.
        claims_lines: Ledger of `Claims`.
        out: A cell that an arm and the occupied ones have in common, its word and bit,
            or CLEAR or OUTSIDE; members visited; shape (n, 3).
    """
    arms, claims = arms_of(arms_lines), claims_of(claims_lines)
    look, tree = look_of(look_lines), bits_of(tree_lines)
    row = array_at(stack(ROW_WIDTH), (ROW_WIDTH,), np.float64)
    for n in range(q.shape[0]):
        place_bodies(q[n], arms)
        out[n, WORD], out[n, CELL], out[n, VISITED] = CLEAR, -1, 0
        for i in range(arms.kinds.shape[0]):
            row[:] = 0.0
            place_row(
                arms.kinds[i], arms.local_rows[i], arms.T_world[arms.bodies[i]], row
            )
            if not is_within(arms.kinds[i], row, claims.lattice):
                out[n, WORD] = OUTSIDE
                break
            mask_shape(arms.kinds[i], row, 0.0, 0.0, look)
        if out[n, WORD] == CLEAR:
            grow_tree(look, tree)
            descend_both(tree, claims.occupied, out[n])
        clear_tree(look, tree)


@kernel(inline=False)
def grow_tree(look: Look, out: Bits) -> None:
    """Set the cells of the masks, and the summaries."""
    for k in range(look.notes.masked):
        word = look.masked[k]
        put_word(word, look.inside[word] | look.shell[word], out)


@kernel(inline=False)
def clear_tree(look: Look, out: Bits) -> None:
    """Take all cells off a tree and the masks that it was grown from."""
    for k in range(look.notes.masked):
        word = look.masked[k]
        look.inside[word] = look.shell[word] = NONE
        put_word(word, NONE, out)
    look.notes.masked = 0


@kernel(inline=False)
def descend_both(a: Bits, b: Bits, out: LongVector) -> None:
    """Find the first cell that two sets have in common.

    Args:
        a: A set.
        b: Another one of the same lattice.
        out: Word and bit of the cell, which stay without one; members that both have
            are counted.
    """
    for root in range(a.roots.shape[0]):
        blocks = a.roots[root] & b.roots[root]
        while blocks != 0:
            block = (root << 6) + lowest(blocks)
            blocks &= blocks - np.uint64(1)
            groups = a.blocks[block] & b.blocks[block]
            out[VISITED] += 1
            while groups != 0:
                group = (block << 6) + lowest(groups)
                groups &= groups - np.uint64(1)
                words = a.groups[group] & b.groups[group]
                out[VISITED] += 1
                while words != 0:
                    word = (group << 6) + lowest(words)
                    words &= words - np.uint64(1)
                    cells = a.words[word] & b.words[word]
                    out[VISITED] += 1
                    if cells != 0:
                        out[WORD], out[CELL] = word, lowest(cells)
                        return
