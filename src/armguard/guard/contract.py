"""Contact contracts: permitted contacts between two bodies."""

import logging
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import inf, isfinite

import numpy as np
from numpy.typing import NDArray

from armguard.errors import GraspError, UnknownNameError, did_you_mean
from armguard.geometry.pose import Pose
from armguard.guard.grippers import Grippers
from armguard.guard.grips import (
    ANYWHERE,
    SPARE_CONTRACTS,
    WORLD,
    ContractKind,
    ContractRow,
    ContractState,
)
from armguard.guard.watch import Watch
from armguard.scene.gripping import Grasp
from armguard.scene.objects import length_remark
from armguard.scene.schema import MOST_CREEP, MOST_OVERLAP, in_other_units

Floats = NDArray[np.float64]

log = logging.getLogger("armguard")

# A permission that lasts longer has probably its expiry on another clock [s].
DAY = 86400.0

# Defaults of contracts that `allow` requests.
GRASP = Grasp()

# How much nearer two bodies that are too near already may get: deviation of an arm from
# its path [m].
ROOM = 2e-3

# Names of the kinds of contracts.
KINDS: dict[int, str] = {
    ContractKind.INTENT: "intent",
    ContractKind.SUPPORT: "standing",
    ContractKind.NEIGHBOUR: "beside",
    ContractKind.RELEASED: "let go",
    ContractKind.REQUESTED: "asked",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Region:
    """A box in which a contact may take place.

    Attributes:
        size: Its full size along x, y, z [m].
        pose: Its frame in the world, or in `frame`.
        frame: Body that it moves with: 'robot/link' or a graspable object; None for
            the world.
    """

    size: tuple[float, float, float]
    pose: Pose = field(default_factory=Pose)
    frame: str | None = None

    def __post_init__(self) -> None:
        sizes = np.asarray(self.size, dtype=np.float64)
        if sizes.shape != (3,) or not (np.isfinite(sizes).all() and (sizes > 0).all()):
            raise GraspError(
                f"Region size is {self.size}; it must be 3 finite numbers > 0 [m]"
            )
        if remark := length_remark("Region size", float(sizes.max())):
            raise GraspError(remark)


@dataclass(frozen=True, slots=True, kw_only=True)
class Contract:
    """Permission of a contact between two bodies, which otherwise keep their buffer.

    Attributes:
        a: One body: 'robot/link' or an object's name.
        b: The other body.
        kind: "held": not checked, since a gripper holds the object; "intent": fingers
            approach a grasp target; "standing": a held object rests on or beside its
            support, or is put down there; "beside": nearer than permitted, and must
            not get nearer; "let go": fingers around a released object; "asked":
            requested by `allow`.
        depth: Permitted overlap; negative for a distance they must keep [m].
        speed: Greatest closing speed at contact [m/s].
        gain: Increase of the permitted closing speed per metre of distance [1/s].
        until: Time of expiry, on the clock of `step` [s]; None if it does not expire.
        rearmed_at: Distance beyond which it ends [m]; None if no distance ends it.
        ending: Whether it ends as soon as the pair keeps its buffer without it.
        region: Whether it holds in a region only.
    """

    a: str
    b: str
    kind: str
    depth: float
    speed: float
    gain: float
    until: float | None
    rearmed_at: float | None
    ending: bool
    region: bool


def contract_of_row(row: ContractRow, a: str, b: str) -> Contract:
    """A contract from its row of numbers."""
    until, rearm = float(row.until), float(row.end_distance)
    return Contract(
        a=a,
        b=b,
        kind=KINDS[int(row.kind)],
        depth=float(row.depth),
        speed=float(row.creep),
        gain=float(row.gain),
        until=until if isfinite(until) else None,
        rearmed_at=rearm if isfinite(rearm) else None,
        ending=bool(row.state in (ContractState.ENDING, ContractState.EXPIRED)),
        region=bool(row.region != ANYWHERE),
    )


@dataclass(frozen=True, slots=True)
class ContractTable:
    """The contracts between bodies.

    Attributes:
        grippers: The grippers of the scene.
        watch: Watch.
    """

    grippers: Grippers
    watch: Watch

    def allow(
        self,
        a: str,
        b: str,
        *,
        region: Region | None = None,
        depth: float = 0.002,
        speed: float = 0.02,
        until: float | None = None,
    ) -> None:
        """Allow two bodies to touch for a limited time: opens a contract.

        It replaces an earlier one of this kind between the two.

        Args:
            a: 'robot/link' or an object, held or not.
            b: The other body.
            region: Where they may touch; anywhere if None.
            depth: Permitted overlap [m].
            speed: Greatest closing speed at contact [m/s].
            until: Time of expiry, on the clock of `step` [s]; 30 s from now if None.

        Raises:
            UnknownNameError: A body or the frame of the region does not exist.
            GraspError: Both are one body, the pair is not checked, a number is out of
                range, or there is no room for another contract.
        """
        self._check_bodies(a, b)
        check_contact(a, b, depth, speed)
        now = float(self.watch.last.now)
        until = now + GRASP.expiry if until is None else until
        if not (np.isfinite(until) and until > now):
            raise GraspError(
                f"'{a}' may touch '{b}' until {until} s; give a time on the clock of "
                f"the stamps that is later than the last cycle's, {now} s"
            )
        if remark := expiry_remark(a, b, until, now):
            log.warning(remark)
        self.grippers.check_modes()
        frame = None if region is None else self._frame(region)
        steady = max(GRASP.intent_speed, speed)
        with self.grippers.transaction():
            row = self.row(a, b, ContractKind.REQUESTED)
            if row is None:
                raise GraspError(
                    f"{SPARE_CONTRACTS} contracts are in force, and there is no "
                    f"room for one of '{a}' and '{b}'; let some expire"
                )
            row.depth, row.creep = depth, speed
            row.gain = (steady - speed) / GRASP.near
            row.until = until
            if region is not None and frame is not None:
                row.region, T = frame
                row.half = np.array(region.size) / 2.0
                row.T_region = T[:3].reshape(12)
            row.state = ContractState.IN_FORCE
            self.write_groups()

    def _check_bodies(self, a: str, b: str) -> None:
        """Refuse two names that are not those of two bodies checked as a pair."""
        holds = self.grippers.tables.holds
        for name in (a, b):
            if name not in holds.places:
                raise UnknownNameError(
                    f"no body is named '{name}'; "
                    f"{did_you_mean(str(name), holds.places)}"
                )
        if a == b:
            raise GraspError(f"'{a}' is allowed to touch itself; name two bodies")
        if not holds.rules[holds.group_of[a], holds.group_of[b]]:
            raise GraspError(
                f"'{a}' and '{b}' are not checked against each other; a contract "
                "would change nothing"
            )

    def in_force(self) -> Iterator[Contract]:
        """All contracts between bodies, except dormant ones."""
        names = self.grippers.tables.body_names
        rows = self.grippers.grips.contracts
        # Most rows are unused, and a look at each takes longer than a cycle.
        idle = np.isin(rows["state"], (ContractState.NONE, ContractState.DORMANT))
        for k in np.flatnonzero(~idle).tolist():
            row = rows[k]
            yield contract_of_row(row, names[int(row.first_a)], names[int(row.first_b)])

    def row(self, a: str, b: str, kind: int) -> ContractRow | None:
        """A cleared row for a contract of two bodies; replaces one of the same kind.

        None if there is no room: then the pair has no contract.
        """
        rows, holds = self.grippers.grips.contracts, self.grippers.tables.holds
        spare = len(rows) - SPARE_CONTRACTS
        key = (kind, *holds.places[a], *holds.places[b])
        free = -1
        for k in range(len(rows) - 1, spare - 1, -1):
            row = rows[k]
            if row.state == ContractState.NONE:
                free = k
            elif (row.kind, row.first_a, row.end_a, row.first_b, row.end_b) == key:
                free = k
                break
        if free < 0:
            return None
        rows[free] = 0
        row = rows[free]
        row.kind, row.first_a, row.end_a, row.first_b, row.end_b = key
        row.group_a, row.group_b = holds.group_of[a], holds.group_of[b]
        row.until = row.end_distance = inf
        row.region, row.gripper = ANYWHERE, -1
        return row

    def keep_apart(
        self, name: str, other: str, distance: float, grasp: Grasp
    ) -> ContractRow | None:
        """Let two bodies be as near as they are now, until they keep their buffer."""
        row = self.row(name, other, ContractKind.NEIGHBOUR)
        if row is None:
            return None
        row.depth = ROOM - distance
        row.creep, row.gain = grasp.creep, gain_of(grasp)
        row.state = ContractState.ENDING
        return row

    def close(self, name: str, kinds: tuple[int, ...]) -> None:
        """End all contracts of these kinds of an object that is released."""
        first, _ = self.grippers.tables.holds.places[name]
        for row in self.grippers.grips.contracts:
            if row.kind in kinds and row.first_a == first:
                row.state = ContractState.NONE

    def forget_intent(self, g: int) -> None:
        """End a gripper's contracts by intent."""
        own = self.grippers.grips.grippers[g]
        own.target = -1
        states = self.grippers.grips.contracts["state"]
        states[own.first_finger : own.end_finger] = ContractState.NONE

    def write_groups(self) -> None:
        """Write which pairs of groups have a contract."""
        may, rows = self.grippers.grips.may, self.grippers.grips.contracts
        there = rows["state"] != ContractState.NONE
        a, b = rows["group_a"][there], rows["group_b"][there]
        may[:] = 0
        may[a, b] = may[b, a] = 1

    def _frame(self, region: Region) -> tuple[int, Floats]:
        """Body that a region moves with, and the region's frame in it, (4, 4)."""
        body, T = WORLD, region.pose.matrix()
        tables = self.grippers.tables
        if region.frame in tables.holds.objects:
            body = tables.holds.objects[str(region.frame)].body
        elif region.frame is not None:
            if region.frame not in tables.links:
                known = (*tables.links, *tables.holds.objects)
                raise UnknownNameError(
                    f"no frame is named '{region.frame}'; "
                    f"{did_you_mean(region.frame, known)}"
                )
            frame = tables.links[region.frame]
            body, T = frame.body, frame.T_body_link @ T
        return body, T


def gain_of(grasp: Grasp) -> float:
    """Increase of the permitted closing speed per metre of distance [1/s]."""
    return (grasp.intent_speed - grasp.creep) / grasp.near


def check_contact(a: str, b: str, depth: float, speed: float) -> None:
    """Refuse a depth [m] or closing speed [m/s] that no contract can have.

    Raises:
        GraspError: A number is not finite, out of range, or in other units.
    """
    if not (np.isfinite(depth) and depth >= 0.0):
        raise GraspError(
            f"'{a}' may touch '{b}': depth is {depth} m; it must be finite and >= 0"
        )
    if not (np.isfinite(speed) and speed > 0.0):
        raise GraspError(
            f"'{a}' may touch '{b}': speed is {speed} m/s; it must be finite and > 0"
        )
    for what, value, greatest, unit in (
        ("depth", depth, MOST_OVERLAP, "m"),
        ("speed", speed, MOST_CREEP, "m/s"),
    ):
        if value > greatest:
            raise GraspError(
                f"'{a}' may touch '{b}': {what} {in_other_units(value, unit)}"
            )


def expiry_remark(a: str, b: str, until: float, now: float) -> str:
    """Sentence that a permission seems to expire by another clock or unit, else "".

    Args:
        a: One body.
        b: The other body.
        until: Time of expiry [s].
        now: Time of now, on the clock of the stamps [s].
    """
    if until - now <= DAY:
        return ""
    return (
        f"'{a}' may touch '{b}' for {until - now:.0f} s, more than a day; give until "
        "in seconds, of the clock of the stamps"
    )
