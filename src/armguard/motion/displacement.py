"""Displacement bounds of the moving primitives for given steps of the joints."""

import numpy as np
from numpy.typing import NDArray

from armguard.motion.chains import Chains, chains
from armguard.motion.outermost import true_limits
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]


def scene_chains(tables: SceneTables) -> Chains:
    """Chains of a scene's bodies, and levers of its moving primitives."""
    m = tables.moving_count
    return chains(
        tables.parent,
        tables.joint_kind,
        tables.gain,
        tables.q_index,
        tables.T_parent_joint,
        tables.axis,
        *true_limits(tables),
        tables.kinds[:m],
        tables.bodies[:m],
        tables.local_rows[:m],
    )


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
    found = scene_chains(tables)
    sizes = np.abs(np.atleast_2d(steps)[:, tables.q_index] * tables.gain[:, 0])
    bounds = np.zeros((len(sizes), tables.moving_count))
    for i, body in enumerate(tables.bodies[: tables.moving_count]):
        count = int(found.length[body])
        bounds[:, i] = sizes[:, found.joints[body, :count]] @ found.levers[i, :count]
    return bounds[0] if np.ndim(steps) == 1 else bounds
