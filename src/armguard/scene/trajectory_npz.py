"""Motion as NumPy's arrays."""

from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from armguard.errors import TrajectoryError
from armguard.scene.trajectory import Trajectory

# What others call the arrays, ours first.
NAMES = ("names", "joint_names", "joints")
POSITIONS = ("q", "qpos", "positions", "joint_positions")
TIMES = ("t", "time", "times", "stamps", "timestamps")


def read_npz(path: Path) -> Trajectory:
    """NPZ with `names`, `q` and perhaps `t`, or under what others call these."""
    try:
        # Opened here, since NumPy leaves a file open that it cannot read.
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            held = {key: arrays[key] for key in arrays.files}
    except (ValueError, BadZipFile, EOFError, AttributeError) as error:
        told = str(error) or type(error).__name__
        if "Object arrays" in told:
            told = "an array holds Python objects; write names as np.array(names)"
        elif "pickle" in told or "no attribute" in told:
            told = "it was not written by np.savez"
        raise TrajectoryError(f"'{path.name}' is no NPZ file: {told}") from None
    names = tuple(str(name) for name in np.atleast_1d(array_of(held, NAMES, path)))
    positions = array_of(held, POSITIONS, path)
    if positions.dtype.kind not in "fiu":
        raise TrajectoryError(
            f"{path.name}: q holds {positions.dtype}; it must hold numbers"
        )
    q = np.asarray(positions, dtype=np.float64)
    if q.ndim != 2 or q.shape[1] != len(names):
        hint = "; it is (k, n), turn it" if q.shape[:1] == (len(names),) else ""
        raise TrajectoryError(
            f"{path.name}: q has shape {q.shape}; it must be (n, {len(names)}){hint}"
        )
    stamps = next((held[key] for key in TIMES if key in held), None)
    if stamps is not None and stamps.shape != (len(q),):
        raise TrajectoryError(
            f"{path.name}: t has shape {stamps.shape}; it must be ({len(q)},)"
        )
    if stamps is not None:
        stamps = np.asarray(stamps, dtype=np.float64)
    return Trajectory(names, q, stamps, path.name)


def array_of(
    held: dict[str, np.ndarray], keys: tuple[str, ...], path: Path
) -> np.ndarray:
    """The array that goes by one of these names."""
    for key in keys:
        if key in held:
            return held[key]
    there = ", ".join(f"'{key}'" for key in held) or "nothing"
    raise TrajectoryError(
        f"{path.name}: there is no array '{keys[0]}', only {there}; an NPZ holds "
        "`names`, `q` and perhaps `t`"
    )
