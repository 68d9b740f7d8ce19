"""Links to primitives: exact where they can be, fitted where not, kept on disk."""

from collections.abc import Callable
from itertools import count

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.pose import Pose
from armguard.geometry.shapes import PlacedShape
from armguard.robot.fitting.exact import exact_shapes, hulls_are_contained
from armguard.robot.fitting.few_corners import with_few_corners
from armguard.robot.fitting.parallel import fit_links
from armguard.robot.fitting.ready import ready_fit
from armguard.robot.fitting.store import fit_key, is_exact, read_fit, write_fit
from armguard.robot.meshes import check_faces, load_triangles
from armguard.robot.model import (
    CollisionElement,
    Cylinder,
    FittedLink,
    Link,
    MeshFile,
    RobotModel,
)

Floats = NDArray[np.float64]


def fit_robot(
    model: RobotModel,
    *,
    target: float = 0.030,
    max_primitives: int = 8,
    progress: Callable[[str, int, int], None] | None = None,
) -> dict[str, FittedLink]:
    """Primitives of every link that has collision geometry, fitted on all cores.

    A fit is taken from the cache, or from those that the package brings, if it is of
    the link's geometry and these settings.

    Args:
        model: The robot.
        target: Overreach to stay below where the primitives allow it [m].
        max_primitives: Primitives a mesh or cylinder may be given.
        progress: Called as each fit begins, with the link's name, its number and the
            count of these fits.
    """
    links = [link for link in model.links.values() if link.collisions]
    settings = {"target": target, "max_primitives": max_primitives}
    keys = {k.name: fit_key(k, settings.values()) for k in links if not is_exact(k)}
    kept = {name: read_fit(key, name) for name, key in keys.items()}
    for link in links:
        if kept.get(link.name, link) is None:
            kept[link.name] = fit = ready_fit(keys[link.name], link)
            if fit is not None:
                # Its proof is not repeated.
                write_fit(keys[link.name], fit)
    open_ = [link for link in links if kept.get(link.name, link) is None]
    begun = count(1)

    def started(name: str) -> None:
        if progress is not None:
            progress(name, next(begun), len(open_))

    def finished(fit: FittedLink) -> None:
        write_fit(keys[fit.link], fit)

    fitted = fit_links(fit_link, open_, settings, started, finished)
    return {
        link.name: fitted.get(link.name) or kept.get(link.name) or fit_link(link)
        for link in links
    }


def fit_link(
    link: Link, *, target: float = 0.030, max_primitives: int = 8
) -> FittedLink:
    """Primitives of one link.

    Meshes of a link are covered together: what one reaches into, the other may fill.

    Args:
        link: The link.
        target: Overreach to stay below where the primitives allow it [m].
        max_primitives: Primitives the meshes together, or a cylinder, may be given.
    """
    shapes: list[PlacedShape] = []
    sources = []
    soup = []
    for element in link.collisions:
        if isinstance(element.geometry, MeshFile):
            soup.append(placed_triangles(element))
        elif isinstance(element.geometry, Cylinder):
            sources.append("cylinder")
            shapes += placed_cylinder(element, target, max_primitives)
        else:
            sources.append("exact")
            pose = Pose.from_matrix(element.T_link_geometry)
            shapes.append(PlacedShape(element.geometry, pose))
    if soup:
        from armguard.robot.fitting.cover import cover

        sources.append("mesh")
        check_faces(f"of link {link.name}", sum(map(len, soup)))
        triangles = np.concatenate(soup)
        found, reach = cover(triangles, target=target, max_primitives=max_primitives)
        shapes += [
            PlacedShape(s.shape, s.pose, r) for s, r in zip(found, reach, strict=True)
        ]
    exact = exact_shapes(link)
    return FittedLink(
        link=link.name,
        shapes=tuple(shapes),
        overreach=max((s.model_error for s in shapes), default=0.0),
        source=", ".join(dict.fromkeys(sources)),
        exact=tuple(with_few_corners(placed) for placed in exact),
        contained=hulls_are_contained(exact, shapes),
    )


def placed_triangles(element: CollisionElement) -> Floats:
    """Triangles of a mesh in the link's frame, shape (n, 3, 3) [m]."""
    assert isinstance(element.geometry, MeshFile)
    T = element.T_link_geometry
    return np.asarray(load_triangles(element.geometry) @ T[:3, :3].T + T[:3, 3])


def placed_cylinder(
    element: CollisionElement, target: float, max_primitives: int
) -> list[PlacedShape]:
    """Primitives around a cylinder in the link's frame."""
    from armguard.robot.fitting.cylinders import enclose_cylinder

    assert isinstance(element.geometry, Cylinder)
    around = enclose_cylinder(
        element.geometry.radius, element.geometry.length, target, max_primitives
    )
    return [
        PlacedShape(
            s.shape,
            Pose.from_matrix(element.T_link_geometry @ s.pose.matrix()),
            s.model_error,
        )
        for s in around
    ]
