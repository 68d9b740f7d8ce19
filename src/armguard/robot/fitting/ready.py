"""Fits that the package brings, by the geometry of a link; proven before they are used.

A file of them is of one repository of descriptions: `robots` has the arms of a robot
and the keys of its links, `fits` the fits by key. `release/make_fits.py` writes them.
"""

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.errors import ArmguardError
from armguard.geometry.convex_hull import convex_hull
from armguard.geometry.pose import Pose
from armguard.geometry.shapes import Hull, PlacedShape
from armguard.kernel import PACKAGE
from armguard.robot.fitting.enclose import hull_points
from armguard.robot.fitting.exact import sticks_out
from armguard.robot.fitting.few_corners import gaps
from armguard.robot.fitting.proof import uncovered
from armguard.robot.fitting.store import as_shape
from armguard.robot.meshes import load_triangles
from armguard.robot.model import FittedLink, Link, MeshFile

Floats = NDArray[np.float64]

FOLDER = PACKAGE / "robot" / "ready_fits"

# By how much a point of a hull may lie beyond qhull's planes [m].
PLANE = 1e-9


@cache
def ready_file(path: Path) -> Mapping[str, Any]:
    """A file of fits."""
    held: Mapping[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return held


def ready_fit(key: str, link: Link) -> FittedLink | None:
    """The fit that the package brings for a link.

    Args:
        key: Of the link's geometry and the settings of its fit.
        link: The link.

    Returns:
        The fit, None if there is none, or if it does not hold the link's meshes as they
        are read here.
    """
    for path in sorted(FOLDER.glob("*.json")):
        row = ready_file(path)["fits"].get(key)
        if row is not None:
            try:
                return proven_fit(row, link)
            except (ArmguardError, IndexError, ValueError):
                return None
    return None


def proven_fit(row: Mapping[str, Any], link: Link) -> FittedLink | None:
    """A fit from its row; None if its shapes are not proven to hold the meshes.

    Args:
        row: Its primitives (`shapes`), its hulls, and whether these were proven to lie
            in the primitives.
        link: A link of meshes alone.

    Raises:
        MeshError: A mesh cannot be read.
        ShapeError: The hull has no corner.
        IndexError: The mesh lacks a corner.
        ValueError: The link has more or fewer meshes.
    """
    shapes = tuple(map(as_shape, row["shapes"]))
    exact = []
    for element, held in zip(link.collisions, row["hulls"], strict=True):
        assert isinstance(element.geometry, MeshFile)
        triangles = load_triangles(element.geometry)
        points, T = triangles.reshape(-1, 3), element.T_link_geometry
        # Each corner is given by how many points it is after the one before.
        corners = points[np.cumsum(held["corners"])]
        hull = Hull(points=corners, rounding=held["rounding"])
        if not hull_holds(hull, hull_points(points)):
            return None
        faces = triangles @ T[:3, :3].T + T[:3, 3]
        if sticks_out(faces, shapes) or len(uncovered(faces, shapes)):
            return None
        exact.append(PlacedShape(hull, Pose.from_matrix(T), held["model_error"]))
    return FittedLink(
        link=link.name,
        shapes=shapes,
        overreach=max(placed.model_error for placed in shapes),
        source="mesh",
        exact=tuple(exact),
        contained=bool(row["contained"]),
    )


def hull_holds(hull: Hull, points: Floats) -> bool:
    """Whether all points lie in a hull, to the rounding of qhull's planes.

    Not in a flat one.

    Args:
        hull: The hull.
        points: Points, shape (n, 3) [m].
    """
    whole = convex_hull(hull.vertices)
    if whole is None:
        return False
    planes = whole.equations
    beyond = (points @ planes[:, :3].T + planes[:, 3]).max(axis=1)
    out = points[beyond > PLANE]
    return len(out) == 0 or bool(gaps(out, hull.vertices).max() <= hull.rounding)
