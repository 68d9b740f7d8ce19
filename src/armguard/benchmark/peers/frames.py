"""What peers want of shapes: capsules along z, hulls with faces."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from armguard.geometry import Capsule, Hull

Floats = NDArray[np.float64]


def along_z(shape: Capsule, T: Floats) -> tuple[float, Floats]:
    """Length of a capsule's axis and a frame in whose z axis it lies, centred."""
    start, end = np.array(shape.start), np.array(shape.end)
    length = float(np.linalg.norm(end - start))
    z = (end - start) / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
    x = np.cross(z, np.eye(3)[np.abs(z).argmin()])
    x /= np.linalg.norm(x)
    local = np.eye(4)
    local[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    local[:3, 3] = (start + end) / 2.0
    return length, T @ local


def outward_faces(shape: Hull) -> NDArray[np.intp] | None:
    """Triangles of a hull's surface, counter-clockwise from outside; None if flat."""
    if len(shape.vertices) < 4:
        return None
    spread = np.ptp(shape.vertices, axis=0)
    if not spread.min() > 0.0:
        return None
    try:
        hull = ConvexHull(shape.vertices / spread)
    except QhullError:
        return None
    faces = hull.simplices.copy()
    corners = hull.points[faces]
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = (n * hull.equations[:, :3]).sum(axis=1) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    return np.asarray(faces)
