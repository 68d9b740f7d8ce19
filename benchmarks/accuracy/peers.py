"""Other libraries asked about the same pairs: `ask(pair)` gives a signed distance.

`None` where the library has no such pair. A rounding is no shape of theirs: they are
asked about the sharp shape, and the rounding is taken off their answer. Coal and MuJoCo
have tolerances of 1e-12 and a thousand iterations; python-fcl, with 1e-6, offers no way
to set them.
"""

from collections.abc import Callable
from typing import Any

import coal
import fcl
import mujoco
import numpy as np

from accuracy.regimes import Pair
from armguard.geometry import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Sphere,
)
from peers.shapes import along_z, coal_convex, outward_faces, peer_geometry

GEOM = mujoco.mjtGeom

# Beyond this MuJoCo is not asked for a distance [m].
FARTHEST = 1e9


def both(library: Any, convex: Any, pair: Pair) -> list[Any] | None:
    """Shapes and frames of a pair in a library; None where it lacks one."""
    found = [
        peer_geometry(library, convex, shape, T)
        for shape, T in ((pair.shape_a, pair.T_a), (pair.shape_b, pair.T_b))
    ]
    return None if None in found else found


def ask_coal(pair: Pair) -> float | None:
    """Coal."""
    found = both(coal, coal_convex, pair)
    if found is None:
        return None
    request = coal.DistanceRequest()
    request.enable_signed_distance = True
    request.gjk_tolerance = request.epa_tolerance = 1e-12
    request.gjk_max_iterations = request.epa_max_iterations = 1000
    placed = [
        part
        for shape, T in found
        for part in (shape, coal.Transform3s(T[:3, :3], T[:3, 3]))
    ]
    try:
        return float(coal.distance(*placed, request, coal.DistanceResult()))
    except RuntimeError as error:
        if "not yet" in str(error) or "not supported" in str(error):
            return None
        raise


def fcl_convex(vertices: Any, faces: Any) -> Any:
    """FCL's convex polytope."""
    flat = np.concatenate([np.full((len(faces), 1), 3), faces], axis=1).flatten()
    return fcl.Convex(vertices, len(faces), flat)


def ask_fcl(pair: Pair) -> float | None:
    """FCL, by python-fcl."""
    found = both(fcl, fcl_convex, pair)
    if found is None:
        return None
    placed = [
        fcl.CollisionObject(shape, fcl.Transform(T[:3, :3].copy(), T[:3, 3].copy()))
        for shape, T in found
    ]
    request = fcl.DistanceRequest(enable_signed_distance=True)
    return float(fcl.distance(*placed, request, fcl.DistanceResult()))


def add_geom(spec: Any, name: str, shape: Any, T: Any) -> bool:
    """Add a mocap body with the shape as its geom; False if MuJoCo has none."""
    match shape:
        case Sphere():
            kind, size = GEOM.mjGEOM_SPHERE, (shape.radius, 0.0, 0.0)
        case Capsule():
            length, T = along_z(shape, T)
            kind, size = GEOM.mjGEOM_CAPSULE, (shape.radius, length / 2.0, 0.0)
        case Box():
            kind, size = GEOM.mjGEOM_BOX, shape.half_extents
        case Cylinder():
            kind, size = GEOM.mjGEOM_CYLINDER, (shape.radius, shape.height / 2.0, 0.0)
        case Ellipsoid():
            kind, size = GEOM.mjGEOM_ELLIPSOID, shape.semi_axes
        case HalfSpace():
            kind, size = GEOM.mjGEOM_PLANE, (1.0, 1.0, 1.0)
        case Hull() if outward_faces(shape) is not None:
            kind, size = GEOM.mjGEOM_MESH, (0.0, 0.0, 0.0)
            mesh = spec.add_mesh(name=name)
            mesh.uservert = shape.vertices.flatten()
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
        case _:
            return False
    body = spec.worldbody.add_body(name=name, mocap=True)
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(T[:3, :3]).flatten())
    body.pos, body.quat = T[:3, 3], quaternion
    geom = body.add_geom(name=name, type=kind, size=list(size))
    if kind == GEOM.mjGEOM_MESH:
        geom.meshname = name
    return True


def ask_mujoco(pair: Pair) -> float | None:
    """MuJoCo: `mj_geomDistance` on a model of two geoms."""
    spec = mujoco.MjSpec()
    spec.option.ccd_tolerance = 1e-12
    spec.option.ccd_iterations = 1000
    if not add_geom(spec, "a", pair.shape_a, pair.T_a):
        return None
    if not add_geom(spec, "b", pair.shape_b, pair.T_b):
        return None
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return float(mujoco.mj_geomDistance(model, data, 0, 1, FARTHEST, np.zeros(6)))


def sharp(ask: Callable[[Pair], float | None]) -> Callable[[Pair], float | None]:
    """Takes the rounding of a pair off a peer's answer about the sharp shapes."""

    def rounded(pair: Pair) -> float | None:
        found = ask(pair)
        if found is None:
            return None
        return found - pair.shape_a.rounding - pair.shape_b.rounding

    return rounded


PEERS: dict[str, Callable[[Pair], float | None]] = {
    "Coal": sharp(ask_coal),
    "FCL": sharp(ask_fcl),
    "MuJoCo": sharp(ask_mujoco),
}
