"""Validation of a checkpoint, which is untrusted input.

Compiled code uses integers of these arrays as indices, counts and flags, and checks no
bounds. So each of them has a rule here; a test fails where one has none. Numbers that
are measured or computed may have any value: kernels have an answer to all of them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.place import place_row
from armguard.geometry.pose import ORTHOGONAL_TOLERANCE
from armguard.geometry.shapes.kind import ShapeKind
from armguard.geometry.shapes.row import ROW_WIDTH
from armguard.guard.checkpoint import ADDRESSES, CheckpointError
from armguard.guard.grips import ANYWHERE, ContractKind, ContractState, GripperModel
from armguard.guard.levels import Level, Reason
from armguard.guard.watch import GIVES_UP, HISTORY, RECOVERING
from armguard.index import BruteForce, Octree
from armguard.index.octree_state import DEPTH_LIMIT
from armguard.scene.tables import SceneTables

Arrays = Mapping[str, NDArray[Any]]
Floats = NDArray[np.float64]

# Greatest value of a counter: a year of cycles at 10 kHz is less.
MOST_COUNTED = 1 << 40

# Greatest coordinate or size [m].
FARTHEST = 1e9

# Kinds whose row has no frame.
FRAMELESS = (ShapeKind.SPHERE, ShapeKind.CAPSULE, ShapeKind.TRIANGLE)

# Tolerance between the row of a moving primitive and the pose of its body [m].
PLACED = 1e-6

MOST_REASON = max(Reason)


@dataclass(frozen=True, slots=True)
class Whole:
    """Rule: integers between two bounds.

    Attributes:
        least: Least value.
        most: Greatest value, or its name in `Greatest`.
        columns: Columns, or fields, that the rule applies to; all if None.
    """

    least: int
    most: int | str
    columns: Sequence[Any] | None = None


@dataclass(frozen=True, slots=True)
class Own:
    """Rule: equal to the guard's own numbers, given by the scene and the held objects.

    Attributes:
        columns: Columns, or fields, that the rule applies to; all if None.
    """

    columns: Sequence[Any] | None = None


Rules = Mapping[str, Sequence[Whole | Own]]

# Greatest values by name; an array where they differ between rows.
Greatest = Mapping[str, int | NDArray[np.int64]]

FLAG = Whole(0, 1)

BOUNDS: Rules = {
    "tables.parent": [Own()],
    "tables.checked": [Own()],
    "tables.robot_of_primitive": [Own()],
    "motion.joints": [Own()],
    "motion.length": [Own()],
    "motion.shared": [Own()],
    "motion.clock": [Whole(0, 1, ("braking", "still", "swings"))],
    "motion.span": [Whole(0, 1, ("segment",))],
    "watch.given": [Whole(0, 1, ("has_velocity", "commanded", "judged"))],
    "watch.last": [Whole(0, MOST_REASON, ("forced",))],
    "watch.sample_count": [Whole(0, HISTORY)],
    "watch.phase": [Whole(0, RECOVERING)],
    "watch.must": [FLAG],
    "watch.cause": [Whole(0, MOST_REASON)],
    "watch.rested": [Whole(0, MOST_COUNTED)],
    "watch.lagged": [Whole(0, MOST_COUNTED)],
    "watch.level": [Whole(0, max(Level))],
    "watch.disproved": [FLAG],
    "watch.held": [FLAG],
    "watch.sent_count": [Whole(0, MOST_COUNTED)],
    "watch.relieved": [FLAG],
    "watch.recover": [Whole(0, GIVES_UP)],
    "watch.evades": [FLAG],
    "watch.evaded": [Whole(0, "sets of robots")],
    "watch.clusters": [Whole(0, MOST_COUNTED, ("number",))],
    "watch.cluster_evaded": [Whole(0, "sets of robots")],
    "watch.yields": [FLAG],
    "watch.may_stand": [Own()],
    "watch.doubt": [Whole(0, MOST_REASON)],
    "workspace.planes": [Whole(0, "pairs of primitives")],
    "grips.may": [FLAG],
    "grips.grippers": [
        Own(
            (
                *("robot", "body", "first_finger", "end_finger"),
                *("first_member", "end_member", "box", "held_count"),
            )
        ),
        Whole(0, max(GripperModel), ("model",)),
        Whole(0, 1, ("coarse",)),
        Whole(-1, "objects", ("target", "expired_target")),
    ],
    "grips.objects": [
        Own(("first", "end", "body", "group", "holder", "second_holder"))
    ],
    "grips.contracts": [
        Whole(0, max(ContractState), ("state",)),
        Whole(0, max(ContractKind), ("kind",)),
        Whole(0, "primitives", ("first_a", "first_b")),
        Whole(0, "ends of primitives", ("end_a", "end_b")),
        Whole(0, "groups", ("group_a", "group_b")),
        Whole(0, 1, ("used",)),
        Whole(ANYWHERE, "bodies", ("region",)),
        Whole(-1, "grippers", ("gripper",)),
    ],
}  # fmt: skip


def greatest_of(tables: SceneTables) -> Greatest:
    """Greatest values of a scene that rules refer to by name."""
    count = len(tables.kinds)
    return {
        "sets of robots": (1 << len(tables.robots)) - 1,
        "pairs of primitives": count << 31 | count,
        "objects": len(tables.holds.objects) - 1,
        "primitives": count - 1,
        "ends of primitives": count,
        "groups": len(tables.holds.rules) - 1,
        "bodies": len(tables.parent) - 1,
        "grippers": max(len(tables.holds.grippers) - 1, 0),
    }


def check_bounds(found: Arrays, own: Arrays, rules: Rules, greatest: Greatest) -> None:
    """Refuse integers that break a rule.

    Args:
        found: Arrays of a checkpoint, by name.
        own: The guard's own values of arrays under a rule `Own`, by name.
        rules: Rules of each array.
        greatest: See `greatest_of`.

    Raises:
        CheckpointError: A number breaks a rule.
    """
    for name, array in found.items():
        for rule in rules.get(name, ()):
            numbers = numbers_of(array, rule)
            if isinstance(rule, Own):
                wrong = numbers != numbers_of(own[name], rule)
                refuse_where(wrong, name, numbers, "another number")
                continue
            most = rule.most if isinstance(rule.most, int) else greatest[rule.most]
            whole = (numbers >= rule.least) & (numbers <= most)
            whole &= numbers == np.floor(numbers)
            wanted = f"a whole number from {rule.least} to {np.max(most)}"
            refuse_where(~whole, name, numbers, wanted)


def numbers_of(array: NDArray[Any], rule: Whole | Own) -> NDArray[Any]:
    """The numbers of an array that a rule applies to, its columns or fields last."""
    if array.dtype.names is not None:
        return np.stack([array[str(name)] for name in rule.columns or ()], axis=-1)
    return array if rule.columns is None else array[..., list(rule.columns)]


def refuse_where(
    wrong: NDArray[np.bool_], name: str, numbers: NDArray[Any], wanted: str
) -> None:
    """Refuse a checkpoint with a wrong number; the message names the first one.

    Raises:
        CheckpointError: A number is wrong.
    """
    if wrong.any():
        value = numbers[wrong][0]
        raise CheckpointError(
            f"a checkpoint has {value} in '{name}'; in this scene it would be {wanted}"
        )


def check_contracts(contracts: NDArray[Any], tables: SceneTables) -> None:
    """Refuse contracts whose sides are not bodies of the scene, or without a kind.

    Raises:
        CheckpointError: There is such a contract.
    """
    bodies = {
        (*place, tables.holds.group_of[name])
        for name, place in tables.holds.places.items()
    }
    for row in contracts[contracts["state"] != ContractState.NONE]:
        sides = (
            (row.first_a, row.end_a, row.group_a),
            (row.first_b, row.end_b, row.group_b),
        )
        if not bodies.issuperset(sides) or not row.kind:
            raise CheckpointError(
                "a checkpoint has a contract in 'grips.contracts' between "
                "primitives that are no body of this scene"
            )


def check_poses(name: str, rows: Floats) -> None:
    """Refuse poses that are no rigid transforms.

    Args:
        name: Name of their array.
        rows: Their upper three rows, shape (k, 12).

    Raises:
        CheckpointError: A pose is not rigid.
    """
    T = rows.reshape(-1, 3, 4)
    with np.errstate(all="ignore"):
        R = T[:, :, :3]
        skew = np.abs(R.transpose(0, 2, 1) @ R - np.eye(3)).max(axis=(1, 2), initial=0)
        rigid = (skew <= ORTHOGONAL_TOLERANCE) & (np.linalg.det(R) > 0.0)
    rigid &= np.isfinite(rows).all(axis=1)
    if not rigid.all():
        raise CheckpointError(
            f"a checkpoint has a pose in '{name}' that is no rigid transform"
        )


def check_about(
    about: Mapping[str, Any], tables: SceneTables
) -> tuple[float, list[str], dict[str, list[str]]]:
    """JSON values of a checkpoint: stamp, objects that changed, holders of objects.

    Raises:
        CheckpointError: A value is missing, or not of this scene.
    """
    stamp: Any = about.get("last_stamp")
    changed: Any = about.get("changed")
    holders: Any = about.get("holders")
    grippers = {part.name for part in tables.holds.grippers}
    sound = type(stamp) is float and type(changed) is list and type(holders) is dict
    sound = sound and all(
        type(name) is str and name in tables.standing for name in changed
    )
    sound = sound and len(set(changed)) == len(changed)
    sound = sound and all(
        name in tables.holds.objects
        and type(robots) is list
        and len(robots) in (1, 2)
        and all(type(robot) is str and robot in grippers for robot in robots)
        and len(set(robots)) == len(robots)
        for name, robots in holders.items()
    )
    if not sound:
        raise CheckpointError(
            "a checkpoint names objects or grippers that are none of this scene"
        )
    return stamp, changed, holders


def check_placement(
    found: Arrays,
    places: NDArray[np.int64],
    holders: Mapping[str, Sequence[str]],
    index: Octree | BruteForce,
    tables: SceneTables,
) -> None:
    """Refuse primitives that do not fit the pose of their body, or with wrong sizes.

    Args:
        found: Arrays of the checkpoint, with those of `placement_of`.
        places: Indices of the primitives that these describe, shape (k,).
        holders: Robots that hold each held object.
        index: The index of the guard.
        tables: The scene.

    Raises:
        CheckpointError: A primitive, its presence or the root cube is wrong.
    """
    there = np.zeros(len(tables.kinds), dtype=np.uint8)
    refuse_where(found["there"] > 1, "there", found["there"], "0 or 1")
    there[places] = found["there"]
    moving = tables.moving_count
    free = np.zeros(len(there), dtype=np.bool_)
    for item in tables.standing.values():
        own = slice(item.first, item.first + item.count)
        free[own] = True
        if there[own].any() and not there[own].all():
            raise CheckpointError("in a checkpoint a part of an object is there alone")
    for name in holders:
        free[slice(*tables.holds.places[name])] = False
    wrong = (there != expected_presence(found["grips.grippers"], tables)) & ~free
    refuse_where(wrong[:moving], "there", there[:moving], "the other")
    rows = found["rows"]
    if not np.isfinite(rows).all() or not (np.abs(rows) <= FARTHEST).all():
        raise CheckpointError(
            f"a checkpoint has an object that is more than {FARTHEST:g} m away"
        )
    row = np.zeros(ROW_WIDTH)
    poses = found["workspace.T_world"]
    for place, stored in zip(places.tolist(), rows, strict=True):
        kind = int(tables.kinds[place])
        leads = np.array(ADDRESSES.get(ShapeKind(kind), ()), dtype=np.int64)
        if place < moving:
            place_row(kind, tables.local_rows[place], poses[tables.bodies[place]], row)
            row[leads] = 0.0
            placed = (np.abs(row - stored) <= PLACED).all()
        else:
            placed = is_row(kind, stored, leads)
        if not placed:
            raise CheckpointError(
                f"a checkpoint has '{tables.labels[place]}' where it cannot be, or of "
                "another size"
            )
    if isinstance(index, Octree):
        check_cube(found["cube"], index)


def expected_presence(grippers: NDArray[Any], tables: SceneTables) -> NDArray[np.uint8]:
    """1 for each primitive that is present if nothing is removed or held, shape (p,).

    Args:
        grippers: Rows of the grippers of a checkpoint.
        tables: The scene.

    Raises:
        CheckpointError: A gripper without a coarse model uses one.
    """
    present = np.ones(len(tables.kinds), dtype=np.uint8)
    flags = grippers["coarse"]
    boxless = np.array(
        [part.coarse is None for part in tables.holds.grippers], np.bool_
    )
    refuse_where(boxless & (flags != 0), "grips.grippers", flags, "0")
    for part, coarse in zip(tables.holds.grippers, flags.tolist(), strict=True):
        if part.coarse is not None:
            present[slice(*tables.holds.places[part.coarse])] = coarse
        for member in part.members:
            present[slice(*tables.holds.places[member])] = 1 - coarse
    return present


def is_row(kind: int, row: Floats, leads: NDArray[np.int64]) -> bool:
    """Whether a row is valid: no size below 0, a rigid frame, and no address.

    Args:
        kind: ShapeKind.
        row: The row.
        leads: Columns of addresses, which have to be 0.
    """
    if not row[0] >= 0.0 or row[leads].any():
        return False
    if kind == ShapeKind.HALF_SPACE:
        return bool(abs(np.linalg.norm(row[4:7]) - 1.0) <= ORTHOGONAL_TOLERANCE)
    if kind in FRAMELESS:
        return True
    R = row[7:16].reshape(3, 3)
    skew = np.abs(R.T @ R - np.eye(3)).max()
    return bool((row[4:7] >= 0.0).all() and skew <= ORTHOGONAL_TOLERANCE)


def check_cube(cube: Floats, index: Octree) -> None:
    """Refuse a root cube that this index could not have grown to.

    Raises:
        CheckpointError: The cube or its depth is impossible.
    """
    edges, own = cube[3:6] - cube[:3], float(index.high[0] - index.low[0])
    with np.errstate(all="ignore"):
        times = np.log2(edges / own)
    sound = np.isfinite(cube).all() and np.isfinite(times).all()
    if not (
        sound
        and (np.abs(times - np.round(times[0])) <= PLACED).all()
        and (np.abs(cube[:6]) <= FARTHEST).all()
        and 0 <= cube[6] <= DEPTH_LIMIT
        and cube[6] == np.floor(cube[6])
    ):
        raise CheckpointError("a checkpoint has an index of another cube than its own")
