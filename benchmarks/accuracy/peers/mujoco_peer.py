"""MuJoCo: `mj_geomDistance` on a model of two geoms."""

from typing import Any

import mujoco
import numpy as np

from accuracy.regimes import Pair
from armguard.benchmark.peers.frames import along_z, outward_faces
from armguard.geometry import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Sphere,
)

GEOM = mujoco.mjtGeom

# Beyond this MuJoCo is not asked for a distance [m].
FARTHEST = 1e9


def add_geom(spec: Any, name: str, shape: Any, T: Any) -> bool:
    """Add a mocap body with the shape as its geom; False if MuJoCo has none."""
    if isinstance(shape, Sphere):
        kind, size = GEOM.mjGEOM_SPHERE, (shape.radius, 0.0, 0.0)
    elif isinstance(shape, Capsule):
        length, T = along_z(shape, T)
        kind, size = GEOM.mjGEOM_CAPSULE, (shape.radius, length / 2.0, 0.0)
    elif isinstance(shape, Box):
        kind, size = GEOM.mjGEOM_BOX, shape.half_extents
    elif isinstance(shape, Cylinder):
        kind, size = GEOM.mjGEOM_CYLINDER, (shape.radius, shape.height / 2.0, 0.0)
    elif isinstance(shape, Ellipsoid):
        kind, size = GEOM.mjGEOM_ELLIPSOID, shape.semi_axes
    elif isinstance(shape, HalfSpace):
        kind, size = GEOM.mjGEOM_PLANE, (1.0, 1.0, 1.0)
    elif isinstance(shape, Hull) and outward_faces(shape) is not None:
        kind, size = GEOM.mjGEOM_MESH, (0.0, 0.0, 0.0)
        mesh = spec.add_mesh(name=name)
        mesh.uservert = shape.vertices.flatten()
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
    else:
        return False
    body = spec.worldbody.add_body(name=name, mocap=True)
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(T[:3, :3]).flatten())
    body.pos, body.quat = T[:3, 3], quaternion
    geom = body.add_geom(name=name, type=kind, size=list(size))
    if kind == GEOM.mjGEOM_MESH:
        geom.meshname = name
    return True


def ask(pair: Pair) -> float | None:
    """Signed distance, or None where the pair is not supported."""
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
    found = mujoco.mj_geomDistance(model, data, 0, 1, FARTHEST, np.zeros(6))
    return float(found) - pair.shape_a.rounding - pair.shape_b.rounding
