"""Coal's shapes and requests, set so that its answers are as good as they get."""

import coal

from armguard.geometry import Box, Capsule


def coal_shape(shape):
    """Coal's shape; a rounding is its swept sphere."""
    if isinstance(shape, Box):
        box = coal.Box(*shape.size)
        box.setSweptSphereRadius(shape.rounding)
        return box
    if isinstance(shape, Capsule):
        return coal.Capsule(shape.radius, 2.0 * shape.end[2])
    return coal.Sphere(shape.radius)


def coal_request():
    """A request with tolerances of 1e-12; with its own, Coal errs by 1e-6."""
    request = coal.DistanceRequest()
    request.enable_signed_distance = True
    request.gjk_tolerance = request.epa_tolerance = 1e-12
    request.gjk_max_iterations = request.epa_max_iterations = 1000
    return request
