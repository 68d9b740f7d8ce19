"""FCL, by python-fcl, which offers no way to set the tolerance of 1e-6."""

from typing import Any

import fcl
import numpy as np

from accuracy.regimes import Pair
from armguard.benchmark.peers.shapes import peer_geometry


def convex(vertices: Any, faces: Any) -> Any:
    """FCL's convex polytope."""
    flat = np.concatenate([np.full((len(faces), 1), 3), faces], axis=1).flatten()
    return fcl.Convex(vertices, len(faces), flat)


def ask(pair: Pair) -> float | None:
    """Signed distance, or None where the pair is not supported."""
    one = peer_geometry(fcl, convex, pair.shape_a, pair.T_a)
    two = peer_geometry(fcl, convex, pair.shape_b, pair.T_b)
    if one is None or two is None:
        return None
    a, b = (
        fcl.CollisionObject(shape, fcl.Transform(T[:3, :3].copy(), T[:3, 3].copy()))
        for shape, T in (one, two)
    )
    asked = fcl.DistanceRequest(enable_signed_distance=True)
    found = fcl.distance(a, b, asked, fcl.DistanceResult())
    return float(found) - pair.shape_a.rounding - pair.shape_b.rounding
