"""State of a guard as bytes, from which another guard of the same scene continues.

All state that decisions depend on is saved bit for bit. Left out are arrays that a
cycle writes before it reads, tables of the scene, and addresses of memory: the other
guard has its own. The index is a function of the poses, so it is rebuilt.

A checkpoint is untrusted input: all of it is checked before any of it is restored; see
`checkpoint_bounds`.
"""

import json
from collections.abc import Mapping, Sequence
from hashlib import blake2b
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.errors import ArmguardError
from armguard.geometry.bounds import row_bounds
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.index import BruteForce, Octree
from armguard.index.octree_state import ABSENT, INDEXED
from armguard.scene.standing import Standing
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]
Arrays = Mapping[str, NDArray[Any]]

MAGIC = b"AGSTATE1"

# Sizes of the fields of the header, before the arrays [bytes].
DIGEST = 16
LENGTH = 8

# Arrays of each ledger that are left out, where most of them are saved.
LEFT_OUT: dict[str, frozenset[str]] = {
    "watch": frozenset(
        (
            "timing static_error top_speed robot_of movers pair_blocks block_need "
            "look ahead reserve tight swept row tool_body tool_point judged_pairs "
            "judged_left judged_count judged_stops judged_clock judged_settled grown "
            "object_stale"
        ).split()
    ),
    "grips": frozenset("swap fingers members velocity".split()),
    "response": frozenset(
        (
            "settings twists tool_columns tool_square tool_speeds raw rows limits "
            "eased program solver lead escape"
        ).split()
    ),
    "lead": frozenset("pull push weight".split()),
}

# Tables of the scene that change with the held objects.
TABLES_KEPT = (
    "parent",
    "T_parent_joint",
    "checked",
    "robot_of_primitive",
    "base_reach",
)

# Arrays of each ledger that are saved, where most of them are left out.
KEPT: dict[str, frozenset[str]] = {
    "motion": frozenset(
        (
            "joints length shared levers blur push rate reach speed q v_low v_high "
            "driven clock span swings"
        ).split()
    ),
    "workspace": frozenset("T_world planes normals".split()),
    "escape": frozenset("notes memory way".split()),
}

PLACES = np.arange(ROW_WIDTH)

# Columns of a shape's row that refer to memory: an address, and its count of numbers.
ADDRESSES = {ShapeKind.HULL: (4, 5), ShapeKind.SUPPORT: (4, 5)}


class CheckpointError(ArmguardError):
    """A checkpoint cannot be restored here."""


def chosen(**ledgers: Any) -> dict[str, NDArray[Any]]:
    """Arrays of tables that a checkpoint saves, by 'ledger.name'."""
    return {
        f"{ledger}.{name}": array
        for ledger, table in ledgers.items()
        for name, array in table._asdict().items()
        if name in KEPT.get(ledger, table._fields)
        and name not in LEFT_OUT.get(ledger, ())
    }


def kept_of_tables(tables: SceneTables) -> dict[str, NDArray[Any]]:
    """Tables of a scene that change with the held objects, by 'ledger.name'."""
    return {f"tables.{name}": getattr(tables, name) for name in TABLES_KEPT}


def layout_of(arrays: Arrays, *about: Sequence[Any]) -> bytes:
    """Digest of names, types and shapes that must be equal to restore a checkpoint.

    Args:
        arrays: The arrays that are saved.
        about: Further values that must be equal, ready for JSON.
    """
    shapes = [[name, *form_of(a)] for name, a in arrays.items()]
    text = json.dumps([shapes, *about])
    return blake2b(text.encode(), digest_size=DIGEST).digest()


def form_of(array: NDArray[Any]) -> tuple[str, list[int]]:
    """Type and shape of an array; equal numbers of a record count as columns."""
    kinds = {str(kind) for kind, *_ in (array.dtype.fields or {}).values()}
    if len(kinds) == 1:
        return kinds.pop(), [*array.shape, len(array.dtype.names or ())]
    return str(array.dtype), list(array.shape)


def pack(layout: bytes, about: Mapping[str, Any], arrays: Arrays) -> bytes:
    """A checkpoint: header, digest, JSON for other values, and the bytes of arrays."""
    text = json.dumps(about).encode()
    text += b" " * (-len(text) % 8)
    head = MAGIC + layout + len(text).to_bytes(LENGTH, "little") + text
    return b"".join((head, *(array.tobytes() for array in arrays.values())))


def unpack(data: bytes) -> tuple[bytes, dict[str, Any], bytes]:
    """Digest, JSON values and bytes of the arrays of a checkpoint.

    Raises:
        CheckpointError: This is no checkpoint, or it is damaged.
    """
    start = len(MAGIC) + DIGEST + LENGTH
    if data[: len(MAGIC)] != MAGIC or len(data) < start:
        raise CheckpointError("this is no checkpoint of a guard")
    end = start + int.from_bytes(data[start - LENGTH : start], "little")
    try:
        about = json.loads(data[start:end])
    except (ValueError, RecursionError):
        raise CheckpointError("a checkpoint is cut off or damaged") from None
    if type(about) is not dict:
        raise CheckpointError("a checkpoint does not name its contents")
    return data[len(MAGIC) : start - LENGTH], about, data[end:]


def arrays_in(data: bytes, like: Arrays) -> dict[str, NDArray[Any]]:
    """The arrays in the bytes of a checkpoint, by name; with the shapes of `like`.

    Raises:
        CheckpointError: The number of bytes differs.
    """
    if sum(array.nbytes for array in like.values()) != len(data):
        raise CheckpointError("a checkpoint is cut off or damaged")
    found, at = {}, 0
    for name, array in like.items():
        kind = np.dtype(np.uint8) if array.dtype == np.bool_ else array.dtype
        part = np.frombuffer(data, kind, array.size, at)
        found[name] = part.reshape(array.shape)
        at += array.nbytes
    return found


def placement_of(
    index: Octree | BruteForce, places: NDArray[np.int64]
) -> dict[str, NDArray[Any]]:
    """Placement of primitives in the world, and the extent of the index.

    Args:
        index: The index.
        places: Indices of the primitives, shape (k,).

    Returns:
        Their rows in the world without addresses, (k, 16); 1 for those that are in the
        index, (k,); corners of the root cube [m] and greatest depth, (7,).
    """
    rows = index.world.rows[places]
    kinds = index.world.kinds[places]
    for kind, columns in ADDRESSES.items():
        for column in columns:
            rows[kinds == kind, column] = 0.0
    there = index.state.residency["status"][places] != ABSENT
    cube = np.zeros(7)
    if isinstance(index, Octree):
        cube[:] = *index.low, *index.high, index.max_depth
    return {"rows": rows, "there": there, "cube": cube}


def stand(
    index: Octree | BruteForce,
    places: NDArray[np.int64],
    rows: Floats,
    there: NDArray[Any],
    cube: Floats,
) -> None:
    """Place primitives as their rows specify, or leave them out; rebuild the index.

    Args:
        index: The index; its world is written.
        places: Indices of the primitives, shape (k,).
        rows: See `placement_of`, from here to `cube`.
        there: Whether they are in the index.
        cube: Root cube and greatest depth.
    """
    world = index.world
    for i, row in zip(places.tolist(), rows, strict=True):
        columns = list(ADDRESSES.get(ShapeKind(world.kinds[i]), ()))
        world.rows[i] = np.where(np.isin(PLACES, columns), world.rows[i], row)
        row_bounds(int(world.kinds[i]), world.rows[i], 0.0, world.boxes[i])
    present = index.state.residency["status"] != ABSENT
    present[places] = there
    if isinstance(index, BruteForce):
        index.residency["status"][:] = np.where(present, INDEXED, ABSENT)
        for i in range(len(present)):
            index.update(i)
        return
    index.low, index.high = cube[:3].copy(), cube[3:6].copy()
    index.max_depth = int(cube[6])
    index.state = index._build(present)


def put_back(index: Octree | BruteForce, item: Standing, local_rows: Floats) -> None:
    """Reset an object to its placement in the scene, present or not."""
    own = slice(item.first, item.first + item.count)
    if item.body < 0:
        index.world.rows[own] = local_rows[own]
    for i in range(own.start, own.stop):
        row_bounds(
            int(index.world.kinds[i]), index.world.rows[i], 0.0, index.world.boxes[i]
        )
    status = INDEXED if item.present else ABSENT
    index.state.residency["status"][own] = status
