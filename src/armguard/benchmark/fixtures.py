"""The bay with many more fixtures around it."""

import numpy as np

from armguard.geometry import Box, Capsule, Pose
from armguard.scene import Scene, bay_scene

# Fixtures stand in a shell around the bay's cube, so that the arms move among as many
# neighbours as before while the world grows [m].
INNER, OUTER = 1.15, 3.0


def crowded_bay(primitives: int, seed: int = 0) -> Scene:
    """The bay with fixtures added until it has so many primitives.

    A tenth of the added fixtures stand inside the arms' reach but clear of both arms
    at home, the rest farther out.

    Args:
        primitives: All primitives, the bay's 35 included.
        seed: Of the places.
    """
    scene = bay_scene()
    rng = np.random.default_rng(seed)
    for k in range(max(primitives - 35, 0)):
        inside = k % 10 == 0
        while True:
            span = INNER if inside else OUTER
            x, y, z = rng.uniform(-span, span, 3)
            away = max(abs(x), abs(y), abs(z))
            if inside and np.hypot(x + 0.55, abs(y) - 0.42) > 0.75:
                break
            if not inside and away > INNER + 0.2:
                break
        size = rng.uniform(0.005, 0.02, 3)
        roll, pitch, yaw = rng.uniform(-np.pi, np.pi, 3)
        shape = (
            Box(half_extents=(float(size[0]), float(size[1]), float(size[2])))
            if k % 2
            else Capsule(
                start=(0.0, 0.0, 0.0), end=(0.0, 0.0, 0.05), radius=float(size[0])
            )
        )
        pose = Pose(
            xyz=(float(x), float(y), float(z + 1.28)),
            rpy=(float(roll), float(pitch), float(yaw)),
        )
        scene.add(shape, name=f"fixture{k}", pose=pose)
    return scene
