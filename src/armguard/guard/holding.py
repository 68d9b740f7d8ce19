"""Who holds what: transactions between two cycles.

What a gripper holds rides on it: its body hangs on the gripper's, its primitives have
that one's joints above them, and everything that moves with a robot is checked against
them. Each transaction writes all tables at once; the next cycle judges with them.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.errors import GraspError, UnknownNameError, did_you_mean
from armguard.geometry.witness import WITNESS_WIDTH
from armguard.guard import grips as at
from armguard.guard.body_distance import body_distance
from armguard.guard.contract import Contract, Region, contract_of_row
from armguard.guard.grips import Grips
from armguard.guard.watch import LAST_NOW, Watch, base_error
from armguard.index import BruteForce, Octree
from armguard.index.octree_state import ABSENT, STATUS
from armguard.motion.chains import anchor, primitive_levers, strokes
from armguard.motion.outermost import true_limits
from armguard.motion.state import Motion
from armguard.robot.kinematics import FIXED, PRISMATIC
from armguard.scene.gripping import Grasp
from armguard.scene.hold_tables import Graspable, GripperPart
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]
Longs = NDArray[np.int64]

# What is not said of a contract somebody asks for.
GRASP = Grasp()

# What lies below: its direction has at least this much of straight down [-].
BELOW = 0.5

# How much nearer than they are two bodies may come that are too near already: what an
# arm may miss its way by [m].
ROOM = 2e-3

# What a pair needs at rest beyond its buffer, for errors that depend on the pose [m].
AT_REST = 3e-3


class Holding:
    """What is held, what stands free, and the contracts between bodies.

    Args:
        tables: The scene; what depends on who holds what is written.
        watch: Watch.
        motion: Motion.
        index: The index, with the world.
        T_world: Poses of all bodies, shape (b, 12).
        grips: Contracts and grippers.
    """

    def __init__(
        self,
        tables: SceneTables,
        watch: Watch,
        motion: Motion,
        index: Octree | BruteForce,
        T_world: Floats,
        grips: Grips,
    ) -> None:
        self.tables = tables
        self.watch = watch
        self.motion = motion
        self.index = index
        self.T_world = T_world
        self.grips = grips
        self.holders: dict[str, list[str]] = {}
        self._grippers = {part.name: g for g, part in enumerate(tables.holds.grippers)}
        self._numbers = {name: o for o, name in enumerate(tables.holds.objects)}

    def warm_up(self, lines: Longs) -> None:
        """Compile or load what a transaction needs, where there can be one."""
        if self.grips.objects.size:
            body_distance(0, 0, 0, 0, lines, np.zeros(WITNESS_WIDTH))

    def grasp(self, robot: str, name: str, lines: Longs) -> None:
        """Make an object part of a robot; see `Monitor.grasp`."""
        g, part = self._gripper(robot)
        thing = self._object(name)
        holders = self.holders.get(name, [])
        if robot in holders:
            raise GraspError(f"'{robot}' holds '{name}' already")
        if len(holders) == 2:
            raise GraspError(
                f"'{name}' is held by '{holders[0]}' and '{holders[1]}'; release it "
                "from one of them first"
            )
        if self.watch.last[LAST_NOW] == -inf:
            raise GraspError(
                f"'{robot}' cannot grasp '{name}' before the first cycle: nobody knows "
                "where it is"
            )
        if not self._is_there(name):
            raise GraspError(f"'{name}' is not there; `place` it first")
        self._check_touch(part, thing, lines)
        self._check_slow(part, thing)
        self._forget_intent(g)
        self.holders[name] = [*holders, robot]
        row = self.grips.objects[self._numbers[name]]
        row[at.SECOND if holders else at.HOLDER] = g
        self.grips.grippers[g, at.HOLDS] += 1
        if not holders:
            self._carry(thing, part)
        self._check_groups()
        if not holders:
            self._stand(thing, lines)
        self._tell_groups()

    def release(self, robot: str, name: str, lines: Longs) -> None:
        """Leave an object where it is; see `Monitor.release`."""
        g, part = self._gripper(robot)
        thing = self._object(name)
        holders = self.holders.get(name, [])
        if robot not in holders:
            who = f"'{holders[0]}' does" if holders else "nobody does"
            raise GraspError(f"'{robot}' does not hold '{name}'; {who}")
        left = [other for other in holders if other != robot]
        row = self.grips.objects[self._numbers[name]]
        self.grips.grippers[g, at.HOLDS] -= 1
        row[at.HOLDER] = self._grippers[left[0]] if left else -1.0
        row[at.SECOND] = -1.0
        if left:
            self.holders[name] = left
            self._carry(thing, self._gripper(left[0])[1])
        else:
            del self.holders[name]
            self._close(thing, (at.STANDING, at.BESIDE))
            self._set_down(thing)
        self._check_groups()
        self._let_go(part, thing, lines)
        self._tell_groups()

    def allow(
        self,
        a: str,
        b: str,
        *,
        depth: float,
        speed: float,
        until: float | None,
        region: Region | None,
    ) -> None:
        """Put a contract between two bodies into force; see `Monitor.allow`."""
        holds = self.tables.holds
        for name in (a, b):
            self._known_body(name)
        if a == b:
            raise GraspError(f"'{a}' is allowed to touch itself; name two bodies")
        if not (np.isfinite(depth) and depth >= 0.0):
            raise GraspError(
                f"'{a}' may touch '{b}': depth is {depth} m; it must be finite and >= 0"
            )
        if not (np.isfinite(speed) and speed > 0.0):
            raise GraspError(
                f"'{a}' may touch '{b}': speed is {speed} m/s; it must be finite and "
                "> 0"
            )
        now = float(self.watch.last[LAST_NOW])
        until = now + GRASP.expiry if until is None else until
        if not (np.isfinite(until) and until > now):
            raise GraspError(
                f"'{a}' may touch '{b}' until {until} s; give a time on the clock of "
                f"the stamps that is later than the last cycle's, {now} s"
            )
        if not holds.rules[holds.group_of[a], holds.group_of[b]]:
            raise GraspError(
                f"'{a}' and '{b}' are not checked against each other; a contract "
                "would change nothing"
            )
        self._check_modes()
        frame = None if region is None else self._frame(region)
        steady = max(GRASP.intent_speed, speed)
        row = self._row(a, b, at.ASKED)
        if row is None:
            raise GraspError(
                f"{at.SPARE_CONTRACTS} contracts are in force, and there is no room "
                f"for one of '{a}' and '{b}'; let some expire"
            )
        row[at.DEPTH], row[at.CREEP] = depth, speed
        row[at.GAIN] = (steady - speed) / GRASP.near
        row[at.UNTIL] = until
        if region is not None and frame is not None:
            row[at.REGION], T = frame
            row[at.HALF : at.HALF + 3] = region.half_extents
            row[at.T_REGION : at.GRIPPER] = T[:3].reshape(12)
        row[at.STATE] = at.IN_FORCE
        self._tell_groups()

    def swap_model(self, robot: str, model: str) -> None:
        """Choose a gripper's model; see `Monitor.swap_model`."""
        models = {"auto": at.AUTO, "coarse": at.COARSE, "detailed": at.DETAILED}
        g, part = self._gripper(robot)
        if model not in models:
            raise GraspError(f"model is {model!r}; {did_you_mean(str(model), models)}")
        if part.coarse is None and model == "coarse":
            raise GraspError(
                f"the gripper of '{robot}' has no coarse model; leave out "
                "`coarse: false` in the scene"
            )
        self.grips.grippers[g, at.MODEL] = models[model]

    @property
    def contracts(self) -> tuple[Contract, ...]:
        """Every allowance in force."""
        names = self.tables.body_names
        found = [
            Contract(
                a=name,
                b=other,
                kind="held",
                depth=inf,
                speed=inf,
                gain=0.0,
                until=None,
                rearmed_at=None,
                ending=False,
                region=False,
            )
            for name, holders in self.holders.items()
            for robot in holders
            for other in self._mates(self._gripper(robot)[1])
        ]
        for row in self.grips.contracts:
            if row[at.STATE] not in (at.NONE, at.DORMANT):
                a, b = names[int(row[at.FIRST_A])], names[int(row[at.FIRST_B])]
                found.append(contract_of_row(row, a, b))
        return tuple(found)

    def forget(self) -> None:
        """End contracts by intent, and let the detailed models stand for grippers."""
        for g, own in enumerate(self.grips.grippers):
            self._forget_intent(g)
            own[at.SPENT_ON] = -1
        self._tell_groups()
        self.show_detailed()

    def show_detailed(self) -> list[int]:
        """Let its links' own primitives stand for every gripper.

        Returns:
            Those whose box stood for them.
        """
        swapped = []
        for g, own in enumerate(self.grips.grippers):
            if own[at.BOX] < 0 or not self._is_there_at(int(own[at.BOX])):
                continue
            swapped += [g] if own[at.COARSE_NOW] else []
            for first, end in self._members(g):
                for i in range(first, end):
                    self.index.insert(i)
            self.index.remove(int(own[at.BOX]))
            own[at.COARSE_NOW] = 0
        return swapped

    def show_coarse(self, g: int) -> None:
        """Let its box stand for a gripper."""
        own = self.grips.grippers[g]
        self.index.insert(int(own[at.BOX]))
        for first, end in self._members(g):
            for i in range(first, end):
                self.index.remove(i)
        own[at.COARSE_NOW] = 1

    def show_those_coarse(self) -> None:
        """Let their boxes stand for those grippers that are said to have them."""
        for g, own in enumerate(self.grips.grippers):
            if own[at.COARSE_NOW]:
                self.show_coarse(g)

    def check_free(self, name: str) -> None:
        """An object that is to be placed or removed is not held.

        Raises:
            GraspError: It is.
        """
        if name in self.holders:
            raise GraspError(
                f"'{name}' is held by '{self.holders[name][0]}'; release it first"
            )

    def as_held(self, holders: Mapping[str, Sequence[str]]) -> dict[str, NDArray[Any]]:
        """What the tables say while these robots hold these objects, by 'ledger.name'.

        Only what is a place or a count; nothing is written.

        Args:
            holders: Robots that have a gripper, by object; who carries it first.
        """
        tables, motion, holds = self.tables, self.motion, self.tables.holds
        parent, length = tables.parent.copy(), motion.length.copy()
        robot_of = tables.robot_of_primitive.copy()
        joints = motion.joints.copy()
        grippers, objects = self.grips.grippers.copy(), self.grips.objects.copy()
        grippers[:, at.HOLDS] = 0
        carrier = np.arange(len(parent))
        free = []
        for name, thing in holds.objects.items():
            numbers = [self._grippers[robot] for robot in holders.get(name, ())]
            body, own = thing.body, slice(*holds.places[name])
            grippers[numbers, at.HOLDS] += 1
            objects[self._numbers[name], [at.HOLDER, at.SECOND]] = [*numbers, -1, -1][
                :2
            ]
            if numbers:
                part = holds.grippers[numbers[0]]
                carrier[body], parent[body] = part.body, part.body
                robot_of[own] = part.robot
            else:
                free.append(body)
                parent[body] = robot_of[own] = -1
        joints, length = joints[carrier], length[carrier]
        shared = motion.shared[np.ix_(carrier, carrier)]
        joints[free], length[free] = -1, 0
        shared[free], shared[:, free] = 0, 0
        return {
            "tables.parent": parent,
            "tables.checked": holds.checked(holders, self._exempt(holders)),
            "tables.robot_of_primitive": robot_of,
            "motion.joints": joints,
            "motion.length": length,
            "motion.shared": shared,
            "grips.grippers": grippers,
            "grips.objects": objects,
        }

    def put(self, name: str, T: Floats) -> None:
        """Let a free object's body stand at T, shape (4, 4)."""
        body = self.tables.holds.objects[name].body
        self.tables.T_parent_joint[body] = T[:3].reshape(12)
        self.T_world[body] = T[:3].reshape(12)

    def _carry(self, thing: Graspable, part: GripperPart) -> None:
        """Hang an object's body on a gripper's, with all its joints above it."""
        tables, motion, watch = self.tables, self.motion, self.watch
        body, carrier = thing.body, part.body
        T = np.linalg.inv(as_matrix(self.T_world[carrier])) @ as_matrix(
            self.T_world[body]
        )
        tables.parent[body] = carrier
        tables.T_parent_joint[body] = T[:3].reshape(12)
        motion.joints[body], motion.length[body] = (
            motion.joints[carrier],
            motion.length[carrier],
        )
        motion.shared[body], motion.shared[:, body] = (
            motion.shared[carrier],
            motion.shared[:, carrier],
        )
        motion.shared[body, body] = motion.shared[carrier, carrier]
        chain = motion.joints[carrier, : motion.length[carrier]].tolist()
        ways = strokes(
            chain,
            tables.joint_kind,
            tables.gain,
            tables.q_index,
            *true_limits(tables),
        )
        first, end = tables.holds.places[thing.name]
        rows = tables.standing[thing.name].rows(T)
        errors, pushes = (
            np.abs(tables.gain[chain, 0])
            * motion.joint_figures[figure][tables.q_index[chain]]
            for figure in ("position_error", "acceleration")
        )
        reach = self._reach(carrier)
        for i, row in zip(range(first, end), rows, strict=True):
            round_it = anchor(int(tables.kinds[i]), row)
            levers = primitive_levers(
                round_it, chain, tables.joint_kind, tables.T_parent_joint, tables.axis,
                ways,
            )  # fmt: skip
            motion.levers[i] = 0.0
            motion.levers[i, : len(levers)] = levers
            motion.blur[i], motion.push[i] = levers @ errors, levers @ pushes
            far = np.linalg.norm(round_it[:6].reshape(2, 3), axis=1).max()
            tables.base_reach[i] = reach + float(far + round_it[6])
            tables.robot_of_primitive[i] = part.robot
            watch.base[i] = base_error(part.robot, float(tables.base_reach[i]), tables)
        figures = tables.robots[part.robot].stopping
        watch.model[first:end] = 0.0 if figures is None else figures.model_error

    def _set_down(self, thing: Graspable) -> None:
        """Let an object's body stand in the world where it is."""
        tables, motion, body = self.tables, self.motion, thing.body
        tables.parent[body] = -1
        tables.T_parent_joint[body] = self.T_world[body]
        motion.joints[body] = -1
        motion.length[body] = 0
        motion.shared[body] = motion.shared[:, body] = 0
        own = slice(*tables.holds.places[thing.name])
        motion.levers[own] = 0.0
        motion.blur[own] = motion.push[own] = motion.rate[own] = 0.0
        motion.reach[:, own] = 0.0
        tables.base_reach[own] = 0.0
        tables.robot_of_primitive[own] = -1
        self.watch.base[own] = self.watch.model[own] = 0.0

    def _check_groups(self) -> None:
        """Write who is checked against whom now."""
        exempt = self._exempt(self.holders)
        self.tables.checked[:] = self.tables.holds.checked(self.holders, exempt)

    def _exempt(
        self, all_holders: Mapping[str, Sequence[str]]
    ) -> list[tuple[int, int]]:
        """Groups that touch each other where these robots hold these objects."""
        holds = self.tables.holds
        exempt = []
        for name, holders in all_holders.items():
            own = holds.group_of[name]
            for robot in holders:
                mates = self._mates(self._gripper(robot)[1])
                exempt += [(own, holds.group_of[mate]) for mate in mates]
                exempt += [
                    (own, holds.group_of[other])
                    for other, others in all_holders.items()
                    if other != name and others[0] == holders[0]
                ]
        return exempt

    def _mates(self, part: GripperPart) -> list[str]:
        """Bodies of a gripper, and those that do not move against what it holds."""
        holds = self.tables.holds
        rigid = [
            name
            for name, (first, _) in holds.places.items()
            if self.tables.bodies[first] == part.body
        ]
        return list(dict.fromkeys([*rigid, *part.members]))

    def _stand(self, thing: Graspable, lines: Longs) -> None:
        """Allow an object that was gripped to be as near to things as it is.

        What it stands on it may touch until it has lifted clear, and when it is put
        down there again; to all else it must not come nearer.
        """
        grasp = thing.grasp
        near = dict(self._neighbours(thing, lines))
        supports = thing.rests_on
        if supports is None:
            supports = tuple(
                other
                for other, witness in near.items()
                if witness[0] <= grasp.touch and -witness[9] >= BELOW
            )
        for other in supports:
            if not self._are_checked(thing.name, other):
                continue
            row = self._row(thing.name, other, at.STANDING)
            if row is None:
                continue
            distance = near[other][0] if other in near else inf
            row[at.DEPTH] = max(grasp.depth, ROOM - distance)
            row[at.CREEP], row[at.GAIN] = grasp.creep, gain_of(grasp)
            row[at.NEAR], row[at.SPEED] = grasp.near, grasp.intent_speed
            row[at.REARM] = row[at.LIFT] = grasp.lift
            stands = distance <= grasp.lift
            row[at.STATE] = at.IN_FORCE if stands else at.DORMANT
        for other, witness in near.items():
            if other not in supports:
                self._keep_apart(thing.name, other, float(witness[0]), grasp)

    def _let_go(self, part: GripperPart, thing: Graspable, lines: Longs) -> None:
        """Let a gripper leave what it released, and come no nearer."""
        mates, grasp = set(self._mates(part)), thing.grasp
        for other, witness in self._neighbours(thing, lines):
            if other not in mates:
                continue
            row = self._keep_apart(thing.name, other, float(witness[0]), grasp)
            if row is None:
                continue
            row[at.KIND] = at.LET_GO
            if other in part.fingers:
                row[at.DEPTH] = max(grasp.depth, row[at.DEPTH])

    def _keep_apart(
        self, name: str, other: str, distance: float, grasp: Grasp
    ) -> Floats | None:
        """Let two bodies be as near as they are until they are far enough apart."""
        row = self._row(name, other, at.BESIDE)
        if row is None:
            return None
        row[at.DEPTH] = ROOM - distance
        row[at.CREEP], row[at.GAIN] = grasp.creep, gain_of(grasp)
        row[at.STATE] = at.ENDING
        return row

    def _neighbours(
        self, thing: Graspable, lines: Longs
    ) -> Iterator[tuple[str, Floats]]:
        """Bodies that are nearer to an object than they may be, with their witness.

        Only those it is checked against.
        """
        tables, boxes, watch = self.tables, self.index.world.boxes, self.watch
        first, end = tables.holds.places[thing.name]
        own = boxes[first:end]
        low, high = own[:, :3].min(axis=0), own[:, 3:].max(axis=0)
        errors = np.pad(watch.model + watch.base, (0, len(boxes) - len(watch.model)))
        most = float(tables.buffers[thing.group].max() + 2.0 * errors.max()) + AT_REST
        most = max(most, thing.grasp.lift)
        near = (boxes[:, :3] <= high + most) & (boxes[:, 3:] >= low - most)
        seen: set[str] = set()
        witness = np.zeros(WITNESS_WIDTH)
        for j in np.flatnonzero(near.all(axis=1)).tolist():
            other = tables.body_names[j]
            if other in seen or not self._is_there(other):
                continue
            seen.add(other)
            if self._are_checked(thing.name, other):
                where = tables.holds.places[other]
                body_distance(first, end, *where, lines, witness)
                need = tables.buffers[thing.group, tables.holds.group_of[other]]
                need += errors[first:end].max() + errors[slice(*where)].max()
                if not witness[0] > max(need + AT_REST, thing.grasp.lift):
                    yield other, witness.copy()

    def _check_touch(self, part: GripperPart, thing: Graspable, lines: Longs) -> None:
        """A finger touches what is to be gripped."""
        holds = self.tables.holds
        nearest, witness = inf, np.zeros(WITNESS_WIDTH)
        for finger in part.fingers:
            where = holds.places[thing.name]
            body_distance(*holds.places[finger], *where, lines, witness)
            nearest = min(nearest, float(witness[0]))
        if not nearest <= thing.grasp.touch:
            raise GraspError(
                f"'{part.name}' does not touch '{thing.name}': its nearest finger is "
                f"{nearest * 1e3:.1f} mm away; it must be within "
                f"{thing.grasp.touch * 1e3:.1f} mm"
            )

    def _check_slow(self, part: GripperPart, thing: Graspable) -> None:
        """A gripper is slow enough for what it grips to be part of it at once."""
        m = self.motion
        p = self.T_world[thing.body, [3, 7, 11]]
        chain = m.joints[part.body, : m.length[part.body]]
        q, axes, origins = m.q_index[chain], m.axes[chain, :3], m.axes[chain, 3:]
        slides = m.joint_kind[chain, None] == PRISMATIC
        ways = np.where(slides, axes, np.cross(axes, p - origins))
        speeds = m.gain[chain, 0] * 0.5 * (m.v_low[q] + m.v_high[q])
        speed = float(np.linalg.norm(speeds @ ways))
        if not speed <= thing.grasp.intent_speed:
            raise GraspError(
                f"'{part.name}' moves '{thing.name}' at {speed:.3f} m/s; to grasp it "
                f"it must be no faster than {thing.grasp.intent_speed} m/s"
            )

    def _check_modes(self) -> None:
        """Contracts are proven, and proofs predict stops."""
        for part in self.tables.robots:
            if part.mode == "fixed":
                raise GraspError(
                    f"robot '{part.name}' has the mode 'fixed', which predicts no "
                    "stops; contracts need 'path' or 'speed'"
                )

    def _row(self, a: str, b: str, kind: int) -> Floats | None:
        """A contract between two bodies, in place of one of its kind they have.

        None if there is no room: then the pair is allowed nothing.
        """
        rows, holds = self.grips.contracts, self.tables.holds
        spare = len(rows) - at.SPARE_CONTRACTS
        key = [kind, *holds.places[a], *holds.places[b]]
        free = -1
        for k in range(len(rows) - 1, spare - 1, -1):
            if rows[k, at.STATE] == at.NONE:
                free = k
            elif rows[k, at.KIND : at.END_B + 1].tolist() == key:
                free = k
                break
        if free < 0:
            return None
        row: Floats = rows[free]
        row[:] = 0.0
        row[at.KIND : at.END_B + 1] = key
        row[at.GROUP_A], row[at.GROUP_B] = holds.group_of[a], holds.group_of[b]
        row[at.UNTIL] = row[at.REARM] = inf
        row[at.REGION], row[at.GRIPPER] = at.NOWHERE, -1.0
        return row

    def _frame(self, region: Region) -> tuple[int, Floats]:
        """Body a region moves with, and its frame there."""
        body, T = at.WORLD, region.pose.matrix()
        tables = self.tables
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

    def _close(self, thing: Graspable, kinds: tuple[int, ...]) -> None:
        """End contracts of an object that is let go."""
        first, _ = self.tables.holds.places[thing.name]
        for row in self.grips.contracts:
            if row[at.KIND] in kinds and row[at.FIRST_A] == first:
                row[at.STATE] = at.NONE

    def _forget_intent(self, g: int) -> None:
        """End a gripper's contracts by intent."""
        own = self.grips.grippers[g]
        own[at.MEANT] = -1
        count = own[at.END_FINGER] - own[at.FIRST_FINGER]
        self.grips.contracts[own[at.SLOT] :][:count, at.STATE] = at.NONE

    def _tell_groups(self) -> None:
        """Write between which groups there are contracts."""
        may, rows = self.grips.may, self.grips.contracts
        rows = rows[rows[:, at.STATE] != at.NONE]
        a, b = rows[:, [at.GROUP_A, at.GROUP_B]].T.astype(np.int64)
        may[:] = 0
        may[a, b] = may[b, a] = 1

    def _reach(self, body: int) -> float:
        """Radius about its robot's root that a body's frame never leaves [m]."""
        tables, radius = self.tables, 0.0
        while tables.parent[body] >= 0:
            if tables.joint_kind[body] != FIXED:
                way = strokes(
                    [body],
                    tables.joint_kind,
                    tables.gain,
                    tables.q_index,
                    *true_limits(tables),
                )
                radius += way[0]
            radius += float(np.linalg.norm(tables.T_parent_joint[body, [3, 7, 11]]))
            body = int(tables.parent[body])
        return radius

    def _are_checked(self, a: str, b: str) -> bool:
        """Whether two bodies are checked against each other."""
        group_of = self.tables.holds.group_of
        return bool(self.tables.checked[group_of[a], group_of[b]])

    def _is_there(self, name: str) -> bool:
        """Whether a body is in the index."""
        return self._is_there_at(self.tables.holds.places[name][0])

    def _is_there_at(self, i: int) -> bool:
        """Whether a primitive is in the index."""
        return bool(self.index.state.residency[i, STATUS] != ABSENT)

    def _members(self, g: int) -> list[tuple[int, int]]:
        """First primitive of each link of a gripper, and the one after its last."""
        part = self.tables.holds.grippers[g]
        return [self.tables.holds.places[member] for member in part.members]

    def _gripper(self, robot: str) -> tuple[int, GripperPart]:
        """Number and part of a robot's gripper."""
        robots = [part.name for part in self.tables.robots]
        if robot not in robots:
            raise UnknownNameError(
                f"no robot is named '{robot}'; {did_you_mean(str(robot), robots)}"
            )
        if robot not in self._grippers:
            raise GraspError(
                f"robot '{robot}' has no gripper; give it `gripper: {{link: ..., "
                "fingers: [...]}}` in the scene"
            )
        self._check_modes()
        g = self._grippers[robot]
        return g, self.tables.holds.grippers[g]

    def _object(self, name: str) -> Graspable:
        """An object that may be gripped."""
        known = self.tables.holds.objects
        if name in known:
            return known[name]
        if name in self.tables.standing:
            raise GraspError(
                f"'{name}' is not graspable; mark it with `graspable: true` in the "
                "scene"
            )
        raise UnknownNameError(
            f"no object is named '{name}'; {did_you_mean(str(name), known)}"
        )

    def _known_body(self, name: str) -> None:
        """A body with primitives has that name."""
        known = self.tables.holds.places
        if name not in known:
            raise UnknownNameError(
                f"no body is named '{name}'; {did_you_mean(str(name), known)}"
            )


def gain_of(grasp: Grasp) -> float:
    """How much the speed of an approach may rise with the distance [1/s]."""
    return (grasp.intent_speed - grasp.creep) / grasp.near


def as_matrix(T: Floats) -> Floats:
    """A pose of twelve numbers as a matrix of shape (4, 4)."""
    out = np.eye(4)
    out[:3] = T.reshape(3, 4)
    return out


def snapshot(tables: SceneTables) -> SceneTables:
    """Tables for verdicts, which must not change when somebody lets go."""
    return replace(tables, robot_of_primitive=tables.robot_of_primitive.copy())
