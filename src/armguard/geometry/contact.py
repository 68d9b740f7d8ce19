"""When two cores are so near that their direction is mostly round-off."""

from armguard.geometry.vec3 import Vec3
from armguard.kernel import kernel

# Share of the cores' size [-].
OF_SIZE = 1e-10

# Share of the coordinates: what is lost where they are subtracted [-].
OF_COORDINATES = 1e-15


@kernel
def contact_gap(size: float, p: Vec3, q: Vec3) -> float:
    """Distance below which two cores count as meeting [m].

    Args:
        size: How large they are [m].
        p: A point of one, in the frame the other's is given in [m].
        q: A point of the other [m].
    """
    coordinates = abs(p[0]) + abs(p[1]) + abs(p[2]) + abs(q[0]) + abs(q[1]) + abs(q[2])
    return OF_SIZE * size + OF_COORDINATES * coordinates
