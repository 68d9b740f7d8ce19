"""Collision geometry of a URDF link."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.shapes import Box, Capsule, Ellipsoid, Shape, Sphere
from armguard.robot.model import CollisionElement, Cylinder, MeshFile
from armguard.robot.xml_source import Element, Reader

# A sphere caps a cylinder if centre and radius fit this well [m].
CAP_TOLERANCE = 1e-6

# Where the mesh of a name is.
MeshFinder = Callable[[str], Path]

GEOMETRIES = ("box", "capsule", "cylinder", "ellipsoid", "mesh", "sphere")


def read_collisions(
    reader: Reader,
    link: Element,
    files: MeshFinder,
) -> tuple[CollisionElement, ...]:
    """All <collision> elements of a link; capped cylinders become capsules."""
    return join_capsules(
        [
            CollisionElement(
                geometry=read_geometry(reader, element, files),
                T_link_geometry=reader.origin(element),
                line=element.sourceline,
            )
            for element in link.iterchildren("collision")
        ]
    )


def read_geometry(
    reader: Reader,
    collision: Element,
    files: MeshFinder,
) -> Shape | Cylinder | MeshFile:
    """The one shape of a <collision>'s <geometry>.

    `<capsule radius length>` is read as the newer URDF versions have it: the length is
    that of the cylinder between the caps. `<ellipsoid radii>` is that of SDF.
    """
    geometry = collision.find("geometry")
    children = [] if geometry is None else list(geometry.iterchildren("*"))
    if len(children) != 1:
        raise reader.fail(
            collision,
            f"<collision> has {len(children)} shapes in its <geometry>; it must be one",
        )
    (shape,) = children
    if shape.tag == "sphere":
        return Sphere(radius=reader.size(shape, "radius")[0])
    if shape.tag == "box":
        x, y, z = reader.size(shape, "size", 3)
        return Box(size=(x, y, z))
    if shape.tag == "ellipsoid":
        x, y, z = reader.size(shape, "radii", 3)
        return Ellipsoid(semi_axes=(x, y, z))
    if shape.tag in ("cylinder", "capsule"):
        (radius,), (length,) = (reader.size(shape, n) for n in ("radius", "length"))
        return (Cylinder if shape.tag == "cylinder" else capsule)(radius, length)
    if shape.tag == "mesh":
        name = reader.attribute(shape, "filename")
        a, b, c = reader.numbers(shape, "scale", 3, "1 1 1")
        if not a * b * c != 0.0:
            raise reader.fail(shape, f'<mesh> scale is "{shape.get("scale")}"')
        return MeshFile(files(name), (a, b, c))
    raise reader.fail(
        shape,
        f"<{shape.tag}> is no shape of a URDF; there are {', '.join(GEOMETRIES)}",
    )


def capsule(radius: float, length: float) -> Capsule:
    """Capsule along z whose axis has the given length [m]."""
    return Capsule(start=(0, 0, -length / 2), end=(0, 0, length / 2), radius=radius)


def join_capsules(
    elements: list[CollisionElement],
) -> tuple[CollisionElement, ...]:
    """Make one capsule of a cylinder and the two spheres that cap it.

    URDF long had no capsule, so files write one as three shapes. The union is the
    same; one capsule is exact where enclosing the bare cylinder is not.
    """
    left = list(elements)
    joined = []
    for element in elements:
        if not isinstance(element.geometry, Cylinder):
            continue
        caps = [cap_at(element, side, left) for side in (-0.5, 0.5)]
        if caps[0] is None or caps[1] is None or caps[0] is caps[1]:
            continue
        for gone in (element, caps[0], caps[1]):
            left = [other for other in left if other is not gone]
        whole = capsule(element.geometry.radius, element.geometry.length)
        joined.append(replace(element, geometry=whole))
    return (*joined, *left)


def cap_at(
    cylinder: CollisionElement, side: float, elements: list[CollisionElement]
) -> CollisionElement | None:
    """The sphere that caps one end of a cylinder, None if there is none."""
    shape = cylinder.geometry
    assert isinstance(shape, Cylinder)
    end = np.array([0.0, 0.0, side * shape.length, 1.0])
    centre: NDArray[np.float64] = (cylinder.T_link_geometry @ end)[:3]
    for element in elements:
        sphere = element.geometry
        if (
            isinstance(sphere, Sphere)
            and abs(sphere.radius - shape.radius) <= CAP_TOLERANCE
            and np.abs(element.T_link_geometry[:3, 3] - centre).max() <= CAP_TOLERANCE
        ):
            return element
    return None
