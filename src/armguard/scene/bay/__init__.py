"""The paper's testbed as data: two arms in an operating bay, and three tasks."""

from pathlib import Path

from armguard.errors import UnknownNameError
from armguard.scene.contents import FLOOR
from armguard.scene.file import load_scene
from armguard.scene.scene import Scene
from armguard.scene.settings import Mode
from armguard.scene.trajectory import Trajectory
from armguard.scene.trajectory_file import load_trajectory

FOLDER = Path(__file__).parent

# Cycles of the bundled tasks; the paper's were "from 150 time steps to 2000".
TASKS = (150, 700, 2000)


def bay_path() -> Path:
    """The bay's scene file; a good one to copy."""
    return FOLDER / "bay.yaml"


def bay_scene(mode: Mode = "fixed", *, floor: float = FLOOR) -> Scene:
    """Two seven-joint arms, fixtures and handled objects: 35 primitives.

    Args:
        mode: How the distance the arms keep is made; the file's is "fixed", with the
            paper's 1.2 in.
        floor: Distance that stays to be kept in the other modes [m].

    Example:
        >>> from armguard import bay_scene
        >>> bay_scene().buffer, bay_scene("path").buffer
        (0.03048, 0.005)
    """
    scene = load_scene(bay_path())
    if mode != "fixed":
        scene.buffer = floor
        scene.set_mode(mode)
    return scene


def bay_task(cycles: int) -> Trajectory:
    """A bundled operator-like task.

    Args:
        cycles: 150, 700 or 2000.

    Raises:
        UnknownNameError: There is no task of that length.
    """
    if cycles not in TASKS:
        known = ", ".join(map(str, TASKS))
        raise UnknownNameError(f"no task has {cycles} cycles; there are {known}")
    return load_trajectory(FOLDER / f"task_{cycles}.csv")
