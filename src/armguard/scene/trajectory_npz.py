"""Motion as NumPy's arrays."""

from io import BytesIO
from math import prod
from pathlib import Path
from zipfile import ZipFile, is_zipfile

import numpy as np

from armguard.bounded import read_bytes, shown
from armguard.errors import TrajectoryError
from armguard.scene.trajectory import Trajectory

# Largest file, and what it may unpack to [byte].
MOST_NPZ_BYTES = 256_000_000
MOST_UNPACKED = 256_000_000

# What others call the arrays, ours first.
NAMES = ("names", "joint_names", "joints")
POSITIONS = ("q", "qpos", "positions", "joint_positions")
TIMES = ("t", "time", "times", "stamps", "timestamps")


def read_npz(path: Path) -> Trajectory:
    """NPZ with `names`, `q` and perhaps `t`, or under what others call these."""
    try:
        data = read_bytes(path, MOST_NPZ_BYTES)
        held = read_members(data) if is_zipfile(BytesIO(data)) else None
    except OSError:
        raise
    except Exception as error:  # zip files, their compression and NumPy have their own
        why = shown(str(error) or type(error).__name__)
        if isinstance(error, TrajectoryError):
            why = str(error)
        raise TrajectoryError(f"'{path.name}' is no NPZ file: {why}") from None
    if held is None:
        raise TrajectoryError(
            f"'{path.name}' is no NPZ file: it was not written by np.savez"
        )
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


def read_members(data: bytes) -> dict[str, np.ndarray]:
    """Arrays of an NPZ archive, after their sizes and headers were looked at.

    Raises:
        TrajectoryError: An array is larger than is accepted or its header is wrong.
    """
    held = {}
    with ZipFile(BytesIO(data)) as archive:
        total = sum(member.file_size for member in archive.infolist())
        if total > MOST_UNPACKED:
            raise TrajectoryError(
                f"it unpacks to {total / 1e6:.0f} MB; the limit is "
                f"{MOST_UNPACKED / 1e6:g} MB"
            )
        for name in archive.namelist():
            with archive.open(name) as member:
                array = BytesIO(member.read())
            held[name.removesuffix(".npy")] = read_array(name, array)
    return held


def read_array(name: str, data: BytesIO) -> np.ndarray:
    """An array in NumPy's own format.

    Raises:
        TrajectoryError: It holds Python objects, or its header and its size disagree.
    """
    version = np.lib.format.read_magic(data)
    headers = {
        (1, 0): np.lib.format.read_array_header_1_0,
        (2, 0): np.lib.format.read_array_header_2_0,
    }
    if version not in headers:
        raise TrajectoryError(f"'{shown(name)}' has an unknown form {version}")
    shape, _, dtype = headers[version](data)
    if dtype.hasobject:
        raise TrajectoryError(
            "an array holds Python objects; write names as np.array(names)"
        )
    size = len(data.getbuffer()) - data.tell()
    if prod(shape) * dtype.itemsize != size:
        raise TrajectoryError(
            f"'{shown(name)}' has {size} bytes, its header says {dtype} of shape "
            f"{shape}"
        )
    data.seek(0)
    return np.asarray(np.lib.format.read_array(data, allow_pickle=False))


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
