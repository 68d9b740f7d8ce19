"""Goals of fields and retreats: requests from clients, checked before use."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armguard.errors import (
    GoalError,
    NoRetreatError,
    SceneError,
    UnknownNameError,
    known_names,
)
from armguard.geometry.pose import Pose, check_transform
from armguard.guard.continuous import PathCheck
from armguard.guard.given import other_unit
from armguard.guard.levels import Reason
from armguard.guard.watch import Watch
from armguard.respond.engagement import Engagement
from armguard.respond.lead_state import TRAIL, Goal, Lead, Retreat
from armguard.respond.requested import as_vector, reason_of_stop
from armguard.respond.state import Response, RobotNotes
from armguard.respond.tool import Tool, Tools
from armguard.scene.tables import RobotPart, SceneTables

Floats = NDArray[np.float64]

# Greatest number of trail configurations from which a straight path is sought.
LOOKS = 16


@dataclass(slots=True)
class Guidance:
    """Guidance of each robot: by its operator, a goal or a retreat, or held.

    Attributes:
        tables: The scene.
        watch: Watch.
        tools: Tools of the scene.
        check_path: Function that proves a path, see `Monitor.check_path`.
        response: Responses, written; None before the first filtered cycle.
        lead: State of the guidance, written; None before the first filtered cycle.
    """

    tables: SceneTables
    watch: Watch
    tools: Tools
    check_path: Callable[..., PathCheck]
    response: Response | None = None
    lead: Lead | None = None

    def engage(self, name: str | None = None, *, ordered: bool = True) -> None:
        """Engage a robot after a stop, or all robots: their operators lead again.

        Requested velocities are then followed; the robot catches up with positions.

        Args:
            name: Name of a robot; all robots if None.
            ordered: Whether robots after an ordered stop are engaged too, see `stop`. A
                program that engages automatically leaves these to a person: False.

        Raises:
            UnknownNameError: There is no such robot.
        """
        chosen = self._chosen(name)
        if self.response is None or self.lead is None:
            return
        for r in chosen:
            notes = self.response.notes[r]
            if ordered or not notes.ordered_stop:
                notes.ordered_stop = 0
                engage_lead(r, self.lead)
                catch_up(notes)

    @property
    def ordered(self) -> dict[str, Reason]:
        """Reasons of ordered stops, by name of each robot that waits for `engage`."""
        if self.response is None:
            return {}
        notes = self.response.notes
        why = {p.name: notes[r].ordered_stop for r, p in enumerate(self.tables.robots)}
        return {name: Reason(int(reason)) for name, reason in why.items() if reason}

    def hold(self, ordered: Mapping[str, Reason]) -> None:
        """Have robots wait for `engage`, as after an ordered stop.

        Args:
            ordered: Robots and reasons: `ordered` of another guard of these robots.

        Raises:
            UnknownNameError: There is no such robot.
        """
        for name, reason in ordered.items():
            (r,) = self._chosen(name)
            if self.response is not None:
                notes = self.response.notes[r]
                notes.ordered_stop = reason_of_stop(reason)
                notes.engagement = Engagement.WAITING

    def field_goal(
        self,
        name: str,
        *,
        q: ArrayLike | None = None,
        pose: Pose | ArrayLike | None = None,
    ) -> None:
        """Set the goal of a robot's field, in place of any other goal.

        Call it between two cycles. From the next cycle on the field moves the robot
        there while `filter` or `filter_twists` requests no motion of it. A stop
        suspends this until `engage` or another goal. With neither `q` nor `pose` the
        robot has no goal.

        Args:
            name: A robot whose response is "field", or 'robot/link' for the pose of
                a link other than its tool.
            q: Joint positions of the goal, in the robot's order, (k,) [rad or m].
            pose: Pose of the tool in the world, a `Pose` or a transform (4, 4).

        Raises:
            UnknownNameError: There is no such robot or link.
            GoalError: The robot's response is not "field", the positions are outside
                its limits, or both `q` and `pose` are given.
            PoseError: The transform is not rigid, or a number is not finite.
            SceneError: The scene has a robot whose mode is "fixed".
        """
        response, lead = self._parts()
        tool = self.tools.named(name)
        if tool is None:
            raise UnknownNameError(
                f"no robot or link is named '{name}'; {self.tools.near(name)}"
            )
        set_goal(tool, q, pose, lead)
        catch_up(response.notes[tool.robot])

    def retreat(
        self, name: str | None = None, to: Literal["path"] | ArrayLike = "path"
    ) -> None:
        """Have a robot retreat along its trail, or to a safe configuration.

        Call it between two cycles; with positions it takes some milliseconds. The robot
        moves at its `resume_speed` at most. If it is being stopped it begins at rest.
        It waits where its path is blocked. The retreat ends when the robot has arrived,
        when its operator requests zero velocity and then motion, with `engage`, or with
        another stop. Meanwhile requested positions are not followed.

        To a configuration the robot moves straight if `check_path` clears that path
        x
        point from which the straight path is clear.

        Args:
            name: Name of a robot; all robots if None.
            to: "path", or joint positions of that robot, shape (k,) [rad or m].

        Raises:
            UnknownNameError: There is no such robot.
            GoalError: `to` is neither, or outside the limits of the robot.
            NoRetreatError: The trail is empty, or no clear path leads from it to the
                positions.
            SceneError: The scene has a robot whose mode is "fixed".
        """
        chosen = self._chosen(name)
        _, lead = self._parts()
        parts = self.tables.robots
        if isinstance(to, str):
            if to != "path":
                raise GoalError(
                    f"a retreat leads to '{to}'; it must be 'path' or positions"
                )
            for r in chosen:
                if lead.notes[r].count == 0:
                    raise NoRetreatError(
                        "nothing is known of the way that led robot "
                        f"'{parts[r].name}' in; give the positions it is to retreat to"
                    )
            for r in chosen:
                set_out(r, 0, False, lead)
            return
        if len(chosen) != 1:
            raise GoalError("positions are those of one robot; name it")
        r = chosen[0]
        safe = positions_of(parts[r], to, self.tables)
        keep = self._places_to_keep(r, safe, lead)
        own = slice(parts[r].first_joint, parts[r].first_joint + parts[r].joint_count)
        lead.safe[own] = safe
        set_out(r, keep, True, lead)

    def _places_to_keep(self, r: int, safe: Floats, lead: Lead) -> int:
        """Number of the oldest trail configurations that a retreat does not use.

        The next configuration has a clear straight path to the safe positions. If the
        number is the length of the trail, the present configuration has one.

        Raises:
            NoRetreatError: No checked configuration has a clear path.
        """
        part = self.tables.robots[r]
        own = slice(part.first_joint, part.first_joint + part.joint_count)
        watch = self.watch
        if not watch.sample_count.all():
            raise NoRetreatError(
                "where the robots are is not known before the first cycle"
            )
        here = watch.sample_q[:, 0].copy()
        there = here.copy()
        there[own] = safe
        first = self.check_path([here, there], sensed=False)
        count = int(lead.notes[r].count)
        if first.clear:
            return count
        looks = min(LOOKS, count)
        for k in range(looks):
            back = (k + 1) * count // looks - 1
            row = (lead.notes[r].head - 1 - back) % TRAIL
            here[own] = lead.trail[row, own]
            if self.check_path([here, there], sensed=False).clear:
                return count - 1 - back
        raise NoRetreatError(
            f"no free way leads robot '{part.name}' to these positions, neither from "
            f"where it is nor from {looks} places of the way that led in; "
            f"{first.sentence}"
        )

    def _chosen(self, name: str | None) -> list[int]:
        """Indices of the robots of a name; all robots if None.

        Raises:
            UnknownNameError: There is no such robot.
        """
        names = [part.name for part in self.tables.robots]
        if name is None:
            return list(range(len(names)))
        if name not in names:
            raise UnknownNameError(f"no robot is named '{name}'; {known_names(names)}")
        return [names.index(name)]

    def _parts(self) -> tuple[Response, Lead]:
        """Responses and guidance of the guard.

        Raises:
            SceneError: A robot's mode is "fixed".
        """
        check_modes(self.tables)
        assert self.response is not None
        assert self.lead is not None
        return self.response, self.lead


def check_modes(tables: SceneTables) -> None:
    """Refuse to filter commands of robots without a prediction of stops.

    Raises:
        SceneError: A robot's mode is "fixed".
    """
    for part in tables.robots:
        if part.mode == "fixed":
            raise SceneError(
                f"robot '{part.name}' has the mode 'fixed', which predicts no stops; "
                "to filter commands it needs 'path' or 'speed'"
            )


def catch_up(notes: RobotNotes) -> None:
    """Have a robot that waits after a stop catch up with its operator."""
    if notes.engagement == Engagement.WAITING:
        notes.engagement = Engagement.CATCHING_UP


def set_goal(
    tool: Tool, q: ArrayLike | None, pose: Pose | ArrayLike | None, lead: Lead
) -> None:
    """Set or remove the goal of a robot's field.

    Args:
        tool: Tool of the robot, or the link that a pose is for.
        q: Joint positions of the robot, shape (k,) [rad or m].
        pose: Pose of the tool in the world.
        lead: State of the guidance, written.

    Raises:
        GoalError: See `Guard.field_goal`.
        PoseError: See `Guard.field_goal`.
    """
    r = tool.robot
    part = tool.tables.robots[r]
    if part.response.kind != "field":
        raise GoalError(
            f"robot '{part.name}' has the response '{part.response.kind}', which goes "
            "nowhere by itself; a goal needs 'field'"
        )
    if q is not None and pose is not None:
        raise GoalError(f"robot '{part.name}' was given q and a pose; give one of them")
    kind = Goal.NONE
    if q is not None:
        lead.aim[tool.own] = positions_of(part, q, tool.tables)
        kind = Goal.JOINTS
    elif pose is not None:
        T = pose.matrix() if isinstance(pose, Pose) else check_transform("pose", pose)
        # The goal is a pose of the body; the link may be rotated in its body.
        aim = np.column_stack([T[:3, :3] @ tool.R_body.T, T[:3, 3]])
        lead.tool_aim[r].pose[:] = aim.ravel()
        lead.tool_aim[r].origin[:] = tool.p_body
        lead.notes[r].tool_body = tool.body
        kind = Goal.TOOL
    lead.notes[r].goal = kind
    begin_anew(r, lead)


def begin_anew(r: int, lead: Lead) -> None:
    """Restart a robot's field from standstill."""
    notes, memory = lead.notes[r], lead.memory[r]
    notes.suspended = notes.in_minimum = 0
    memory.speed = memory.stalled = memory.at_rest = 0.0
    memory.least_time_left = np.inf


def engage_lead(r: int, lead: Lead) -> None:
    """End a robot's retreat and the suspension of its field."""
    notes = lead.notes[r]
    if notes.retreat != Retreat.NONE or notes.suspended or notes.in_minimum:
        notes.retreat = Retreat.NONE
        begin_anew(r, lead)


def positions_of(part: RobotPart, q: ArrayLike, tables: SceneTables) -> Floats:
    """Joint positions of a robot, checked against its limits, shape (k,) [rad or m].

    Raises:
        GoalError: They are no vector of finite numbers, or outside the limits.
    """
    found, fault = as_vector(f"robot '{part.name}': q", q, part.joints)
    if found is None:
        raise GoalError(fault)
    own = slice(part.first_joint, part.first_joint + part.joint_count)
    for name, place, lower, upper in zip(
        part.joints, found, tables.lower[own], tables.upper[own], strict=True
    ):
        if not lower <= place <= upper:
            goal = np.full(len(tables.q_names), np.nan)
            goal[own] = found
            hint = other_unit(goal, tables)[0]
            raise GoalError(
                f"joint '{part.name}/{name}' is to go to {place:.4f}; its limits are "
                f"[{lower:.4f}, {upper:.4f}]" + (hint and f"; {hint}")
            )
    return found


def set_out(r: int, keep: int, then_safe: bool, lead: Lead) -> None:
    """Begin a retreat in the next cycle in which the robot is not being stopped."""
    notes = lead.notes[r]
    straight = then_safe and keep >= notes.count
    notes.retreat = Retreat.STRAIGHT if straight else Retreat.ALONG_TRAIL
    notes.unused, notes.to_safe = keep, then_safe
    notes.begun = notes.released = 0
