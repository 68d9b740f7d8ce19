"""Displacement bounds of the moving primitives for given steps of the joints."""

import numpy as np
from numpy.typing import NDArray

from armguard.motion.chains import chains
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]


def displacement_bounds(tables: SceneTables, steps: Floats) -> Floats:
    """Bound the displacement of any point of each moving primitive.

    A point moves no farther than the sum of |step| times lever over the joints above
    it, from any configuration that the guard accepts.

    Args:
        tables: A compiled scene.
        steps: Displacement of each joint, shape (n,) or (k, n) [rad or m].

    Returns:
        Bounds, shape (m,) or (k, m) [m].

    Example:
        >>> import numpy as np
        >>> from armguard.motion import displacement_bounds
        >>> from armguard.scene import bay_scene, compile_scene
        >>> tables = compile_scene(bay_scene())
        >>> float(displacement_bounds(tables, np.zeros(14)).max())
        0.0
    """
    found = chains(tables)
    sizes = np.abs(np.atleast_2d(steps)[:, tables.q_index] * tables.gain[:, 0])
    bounds = np.zeros((len(sizes), tables.moving_count))
    for i, body in enumerate(tables.bodies[: tables.moving_count]):
        count = int(found.length[body])
        bounds[:, i] = sizes[:, found.joints[body, :count]] @ found.levers[i, :count]
    return bounds[0] if np.ndim(steps) == 1 else bounds
