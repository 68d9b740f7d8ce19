"""Primitives around a triangle soup: one, or as many as the target needs."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.shapes import PlacedShape
from armguard.robot.fitting.clipping import cut
from armguard.robot.fitting.enclose import (
    Enclosure,
    best_box,
    best_capsule,
    hull_points,
    middle_and_half,
    principal_axes,
)
from armguard.robot.fitting.overreach import overreach, overreaches
from armguard.robot.fitting.triangle_tree import triangle_tree

Floats = NDArray[np.float64]

# A capsule is measured several times faster than a box in the cycle, so a box has to
# overreach this much less to be taken where a capsule would do [-].
BOX_GAIN = 0.75

# Where a piece may be cut, as shares of its length along an axis.
CUTS = (0.25, 0.5, 0.75)

# Cuts that are followed up for a piece, and what one must leave of its overreach to be
# worth a primitive [-].
TRIALS = 5
GAIN = 0.95

# Half length below which a piece is not cut [m].
LEAST_PIECE = 0.008

# Spacing of samples while looking for where to cut, and for the final figure [m].
COARSE = 0.004
FINE = 0.001


def cover(
    triangles: Floats, *, target: float, max_primitives: int
) -> tuple[list[PlacedShape], list[float]]:
    """Primitives whose union holds every triangle, and the overreach of each [m].

    Starts with one primitive around everything. As long as one overreaches the target,
    the piece of surface inside it is cut where that helps most, and each half is
    enclosed anew. Triangles that straddle a cut are cut themselves, so each piece of
    surface lies in one convex primitive: that is the containment.

    Args:
        triangles: Corners, shape (n, 3, 3) [m].
        target: Overreach to stay below [m].
        max_primitives: Primitives to stay below.
    """
    tree = triangle_tree(triangles)
    pieces = [piece_of(triangles)]
    shapes = [enclose(pieces[0].points, target).shape]
    reach = overreaches(tree, shapes, COARSE)
    settled: set[int] = set()
    while len(shapes) < max_primitives:
        open_pieces = [k for k in range(len(shapes)) if k not in settled]
        worst = max(open_pieces, key=lambda k: reach[k], default=-1)
        if worst < 0 or reach[worst] <= target + COARSE - FINE:
            break
        for halves in promising_cuts(pieces[worst]):
            trial = [s for k, s in enumerate(shapes) if k != worst]
            trial += [enclose(half.points, target).shape for half in halves]
            new, enough = range(len(shapes) - 1, len(trial)), GAIN * reach[worst]
            if all(overreach(tree, trial, k, COARSE) < enough for k in new):
                pieces = [p for k, p in enumerate(pieces) if k != worst] + halves
                shapes, reach = trial, overreaches(tree, trial, COARSE)
                settled = set()
                break
        else:
            settled.add(worst)
    return shapes, overreaches(tree, shapes, FINE)


class Piece(NamedTuple):
    """A part of the surface.

    Attributes:
        triangles: Corners, shape (n, 3, 3) [m].
        points: The points that span its convex hull, shape (k, 3) [m].
    """

    triangles: Floats
    points: Floats


def piece_of(triangles: Floats) -> Piece:
    """Triangles with the points that span their hull."""
    return Piece(triangles, hull_points(triangles.reshape(-1, 3)))


def enclose(points: Floats, target: float) -> Enclosure:
    """The capsule or the box around points, whichever serves better."""
    capsule = best_capsule(points)
    if capsule.reach <= 0.6 * target:
        return capsule
    box = best_box(points)
    return box if box.reach < BOX_GAIN * capsule.reach else capsule


def promising_cuts(piece: Piece) -> list[list[Piece]]:
    """Both halves of a few cuts, the one that leaves the least overreach first."""
    axes = principal_axes(piece.points)
    centre, half = middle_and_half(piece.points, axes)
    ranked = []
    for k in range(3):
        if half[k] < LEAST_PIECE:
            continue
        for share in CUTS:
            offset = float(centre @ axes[:, k] + (2.0 * share - 1.0) * half[k])
            sides = cut(piece.triangles, axes[:, k], offset)
            if min(map(len, sides)) > 0:
                halves = [piece_of(side) for side in sides]
                reach = [quick_reach(side.points) for side in halves]
                ranked.append((max(reach), sum(reach), halves))
    ranked.sort(key=lambda cut: cut[:2])
    return [halves for _, _, halves in ranked[:TRIALS]]


def quick_reach(points: Floats) -> float:
    """Overreach of a primitive around points, not refined [m]."""
    capsule = best_capsule(points, refine=False)
    return min(capsule.reach, best_box(points, refine=False).reach)
