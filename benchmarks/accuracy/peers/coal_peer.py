"""Coal, with tolerances of 1e-12 and a thousand iterations."""

from typing import Any

import coal

from accuracy.regimes import Pair
from armguard.benchmark.peers.coal_pairs import coal_convex
from armguard.benchmark.peers.shapes import peer_geometry


def request() -> Any:
    """A request set so that its answers are as good as they get."""
    asked = coal.DistanceRequest()
    asked.enable_signed_distance = True
    asked.gjk_tolerance = asked.epa_tolerance = 1e-12
    asked.gjk_max_iterations = asked.epa_max_iterations = 1000
    return asked


def ask(pair: Pair) -> float | None:
    """Signed distance, or None where the pair is not supported."""
    one = peer_geometry(coal, coal_convex, pair.shape_a, pair.T_a)
    two = peer_geometry(coal, coal_convex, pair.shape_b, pair.T_b)
    if one is None or two is None:
        return None
    frames = [coal.Transform3s(T[:3, :3], T[:3, 3]) for T in (one[1], two[1])]
    try:
        found = coal.distance(
            one[0], frames[0], two[0], frames[1], request(), coal.DistanceResult()
        )
    except RuntimeError as error:
        if "not yet" in str(error) or "not supported" in str(error):
            return None
        raise
    return float(found) - pair.shape_a.rounding - pair.shape_b.rounding
