"""A pair of shapes as Coal measures it, with all that can be made before made."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from armguard.benchmark.peers.shapes import peer_geometry
from armguard.geometry import Shape

Floats = NDArray[np.float64]


class CoalPair(NamedTuple):
    """What a call of Coal needs.

    Attributes:
        functor: Distance of the two geometries.
        T_a: Frame of A.
        T_b: Frame of B.
        request: Coal's own settings.
        result: Where it answers.
        geometries: The two; the functor only points to them.
    """

    functor: Any
    T_a: Any
    T_b: Any
    request: Any
    result: Any
    geometries: tuple[Any, Any]


def coal_pair(a: Shape, T_a: Floats, b: Shape, T_b: Floats) -> CoalPair:
    """Two shapes ready to be measured.

    Raises:
        ImportError: Coal is not installed.
        TypeError: Coal has nothing for one of them.
    """
    import coal

    geometries, frames = [], []
    for shape, T in ((a, T_a), (b, T_b)):
        found = peer_geometry(coal, coal_convex, shape, T)
        if found is None:
            raise TypeError(f"Coal has nothing for a {type(shape).__name__}")
        geometry, world = found
        geometry.setSweptSphereRadius(shape.rounding)
        geometries.append(geometry)
        frames.append(coal.Transform3s(world[:3, :3], world[:3, 3]))
    return CoalPair(
        coal.ComputeDistance(*geometries),
        frames[0],
        frames[1],
        coal.DistanceRequest(),
        coal.DistanceResult(),
        (geometries[0], geometries[1]),
    )


def coal_convex(vertices: Floats, faces: NDArray[np.intp]) -> Any:
    """Coal's convex polytope."""
    import coal

    points = coal.StdVec_Vec3s()
    points.extend(list(vertices))
    triangles = coal.StdVec_Triangle()
    triangles.extend([coal.Triangle(*(int(i) for i in face)) for face in faces])
    return coal.Convex(points, triangles)
