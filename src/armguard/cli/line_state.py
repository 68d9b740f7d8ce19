"""State of a coordination for the live view: robots, items, and what was decided."""

from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.maps.job import LineJob
from armguard.maps.lane import Lane
from armguard.maps.line_cell import GRIP, LinePlan
from armguard.maps.line_run import LineRun
from armguard.maps.online import Line
from armguard.maps.right_of_way import STEP
from armguard.respond.tool import Tool, tool_of
from armguard.scene import compile_scene
from armguard.scene.poses import body_poses

Floats = NDArray[np.float64]

# Kind of program of the link, see `link_path`.
LINK = "line"

# Decisions that are shown.
DECISIONS = 5

# Time between two looks at the height of a tool [s].
LOOKS = 0.1


@dataclass(frozen=True, slots=True)
class Pick:
    """A plan that picks an item, from the start of the plan.

    Attributes:
        begins: When its tool begins to follow the item [s].
        ends: When the item is gripped [s].
        puts: When the tool is lowest after that, where the item is put down [s].
        at: Place of the item on the belt when it is gripped [m].
        gripped: Where the tool is then, shape (3,) [m].
        along: Motion of the item per motion of the belt, shape (3,) [-].
        put: Where the tool is when it puts the item down, shape (3,) [m].
    """

    begins: float
    ends: float
    puts: float
    at: float
    gripped: Floats
    along: Floats
    put: Floats

    @classmethod
    def of(cls, one: LinePlan, tool: Tool) -> "Pick | None":
        """That of a plan; None of one without an item."""
        track, tube = one.track, one.plan.plan.tube
        if track is None:
            return None
        times = np.arange(track.end, tube.times[-1] + LOOKS, LOOKS)
        places = np.array(
            [
                tool.point(body_poses(tool.tables, q))
                for q in tube.at(np.concatenate(([track.end - GRIP], times)))
            ]
        )
        lowest = int(np.argmin(places[2:, 2])) + 1
        return cls(
            track.start - one.begin,
            track.end - one.begin,
            float(times[lowest]) - one.begin,
            track.at + track.speed * (track.end - track.start),
            places[1],
            # Only where it grips the item the tool surely moves as the item does.
            (places[1] - places[0]) / (track.speed * GRIP),
            places[1 + lowest],
        )


class LineState:
    """Makes the state, as often as it is requested.

    Attributes:
        decisions: The last decisions: time [s] and sentence.

    Args:
        job: The cell job.
        run: What is executed.
    """

    def __init__(self, job: LineJob, run: LineRun) -> None:
        self._run, self._conveyor = run, job.cell.conveyor
        self.decisions: deque[tuple[float, str]] = deque(maxlen=DECISIONS)
        tables = compile_scene(job.scene)
        tools = {robot: tool_of(tables, robot) for robot in job.cell.robots}
        self._picks = {
            name: Pick.of(one, tools[one.robot]) for name, one in job.cell.plans.items()
        }

    def state(
        self, now: float, travel: float, speed: float, before: str
    ) -> dict[str, Any]:
        """State now, ready for JSON.

        Args:
            now: Time since the start [s].
            travel: How far the belt has moved, as measured [m].
            speed: Its speed, as measured [m/s].
            before: Why no job has begun yet, in words; empty if one may.
        """
        line, belt = self._run.line, self._conveyor
        lost = set(line.missed)
        found: dict[str, Any] = {
            "now": round(now, 1),
            "robots": [self._robot(lane, before) for lane in line.lanes],
            "items": self._items(travel, speed),
            "waiting": len(line.queue),
            "done": len(set(line.finished) - lost),
            "missed": len(lost),
            "fault": line.fault,
            "decisions": [[round(t, 1), sentence] for t, sentence in self.decisions],
        }
        if belt is not None:
            found["belt"] = [round(speed, 3), belt.slowest, belt.fastest]
        return found

    def _robot(self, lane: Lane, before: str) -> dict[str, Any]:
        """State of a robot: its job, how much of it is done, and a sentence."""
        line = self._run.line
        share = lane.place / line.plans[lane.plan].plan.plan.duration
        does = before or does_in_words(lane, self._picks[lane.plan])
        if line.fault and not before:
            does = "slows down and stops" if lane.pace else "stopped"
        elif lane.yields_to:
            left = waits_for(line, lane)
            until = f", {left:.1f} s more" if left > 0.0 else ""
            does += f" – yields: {lane.yields_to} passes first{until}"
        return {
            "name": lane.robot,
            "job": None if lane.job is None else lane.job.number,
            "share": 0.0 if lane.job is None else round(share, 3),
            "yields": bool(lane.yields_to),
            "does": does,
        }

    def _items(self, travel: float, speed: float) -> list[dict[str, Any]]:
        """Items on the belt or with a robot: where, how fast, and whose they are."""
        line, found = self._run.line, []
        own = [(lane.job, lane.plan, lane) for lane in line.lanes if lane.job]
        waiting = [(job, job.plans[0], None) for job in line.queue]
        for job, plan, lane in (*own, *waiting):
            pick = self._picks[plan]
            if pick is None:
                continue
            on_belt = job.offset + travel - job.travel
            xyz = pick.gripped + (on_belt - pick.at) * pick.along
            moves, held = speed * pick.along, False
            if lane is not None and not lane.lost and lane.place >= pick.ends:
                xyz, moves = pick.put, np.zeros(3)
                held = lane.place < pick.puts
            found.append(
                {
                    "job": job.number,
                    "xyz": xyz.round(4).tolist(),
                    "moves": moves.round(4).tolist(),
                    "robot": "" if lane is None else lane.robot,
                    "held": held,
                }
            )
        return found


def does_in_words(lane: Lane, pick: Pick | None) -> str:
    """What a robot does, without the others."""
    if lane.job is None:
        return "rests until it can begin a job"
    number = lane.job.number
    if pick is None:
        return f"executes job {number}, {lane.plan}"
    if lane.lost:
        return f"has missed item {number}"
    if lane.place == 0.0:
        return f"waits for item {number}, which it will pick"
    if lane.place < pick.begins:
        return f"goes to item {number}"
    if lane.place < pick.ends:
        grips = lane.place >= pick.ends - GRIP
        return f"grips item {number}" if grips else f"follows item {number}"
    if lane.place < pick.puts:
        return f"puts item {number} down"
    return "goes back"


def waits_for(line: Line, lane: Lane) -> float:
    """Least time after which the robot passes that one yields to [s]; 0 if it has.

    Args:
        line: The coordination.
        lane: The robot that waits.
    """
    k, other = (line.cell.robots.index(one) for one in (lane.robot, lane.yields_to))
    gate = line.right_of_way.gate(k, other, line.seen(other))
    return max(STEP * gate[1] - line.lanes[other].place, 0.0) if gate else 0.0
