"""An operator picks something up among clutter, and puts it down where it is free."""

from dataclasses import asdict, dataclass
from itertools import pairwise
from math import sqrt
from time import process_time
from typing import Any

import numpy as np

from armguard.errors import GraspError
from armguard.geometry import Pose
from armguard.guard import Reason
from armguard.respond import Action, Command, Guard
from arrays import Floats
from gripping.judge import FINGERS, HELD, Judge, Pair
from gripping.plant import Plant
from gripping.workplace import GANTRY, PERIOD, ROOM, Tool, Workplace, cluttered, gaps

# How the operator leads: speed by what is left of the way [1/s], how near is near
# enough [m], and how little in what time is no progress [m, s].
GAIN, WITHIN = 8.0, 0.001
PROGRESS, STALLED = 2e-4, 0.6

# Longest time for which the operator pushes [s], and how many tries there are in all.
LONGEST, TRIES = 6.0, 4

# Height above where it grips from which on the operator is slow, and how slow [m, m/s].
SLOW_FROM, SLOW = 0.1, (0.05, 0.09)

# What is gripped is first lifted by this, and what was let go is left by this [m].
LIFTED, AWAY = 0.03, 0.15

# At which end of the way the gripper closes.
GRIPPED = 2

# How fast the hand goes back to its start, to try again [m/s].
BACK = 0.1

# Speed at which fingers are asked to close and to open [m/s].
CLOSING, OPENING = (0.02, 0.06), 0.05

# A placement counts that is as near to its goal as this, in the plane and above [m].
PLACED, ABOVE_TABLE = 0.006, 0.002


@dataclass
class Outcome:
    """What a pick-and-place episode came to."""

    seed: int
    certified: bool = False
    grasped: bool = False
    placed: bool = False
    failed: str | None = None
    tries_again: int = 0
    simulated_s: float = 0.0
    worked_s: float = 0.0


# Words for a failure whose reason the guard does not name.
UNNAMED = "no reason is named"


class Picker:
    """The operator.

    Args:
        plant: The robot.
        judge: What the operator sees, and what judges the episode.
        tool: Sizes of the hand and its fingers.
        rng: Draws speeds and hurry.
    """

    def __init__(
        self, plant: Plant, judge: Judge, tool: Tool, rng: np.random.Generator
    ) -> None:
        self.guard = plant.guard
        self.plant = plant
        self.judge = judge
        self.tool = tool
        self.fast = rng.uniform(0.2, 0.8)
        self.slow = rng.uniform(*SLOW)
        self.closing = rng.uniform(*CLOSING)
        # An operator in a hurry goes sideways before the hand is at its travel height.
        self.hurry = 0.06 if rng.random() < 0.5 else np.inf
        self.tries = 0
        # What blocked the hand at the last try.
        self.blocked_by = ""

    def lead(self, goal: Floats, speed: float, *, open_to: float | None = None) -> bool:
        """Lead the hand to a place, and the fingers; whether it got there."""
        target = np.array([*goal, open_to or 0.0, open_to or 0.0])
        best, last = np.inf, len(self.plant.rows)
        while len(self.plant.rows) - last < STALLED / PERIOD:
            way = target - self.plant.seen
            if open_to is None:
                way[3:] = 0.0
            left = max(way.max(), -way.min())
            if left <= WITHIN:
                return True
            if left < best - PROGRESS:
                best, last = left, len(self.plant.rows)
            desired = GAIN * way
            size = sqrt(desired[0] ** 2 + desired[1] ** 2 + desired[2] ** 2)
            if size > speed:
                desired[:3] *= speed / size
            most = max(desired[3:].max(), -desired[3:].min())
            if most > OPENING:
                desired[3:] *= OPENING / most
            self.plant.cycle(desired)
        return False

    def push(self, desired: Floats, part_of: tuple[str, ...], other: str) -> bool:
        """Desire the same until all these parts are felt to touch; whether they do."""
        for _ in range(int(LONGEST / PERIOD)):
            q = self.plant.q
            if all(self.judge.gap(q, part, other) <= 0.0 for part in part_of):
                return True
            if self.plant.cycle(desired).action >= Action.STOP:
                return False
        return False

    def look(self, may_touch: set[Pair] | None = None) -> None:
        """Have what happened since the last time judged."""
        self.judge.look(self.plant.rows, may_touch or set())

    def over(self, xy: Floats, travel: float, low: float, opened: float | None) -> bool:
        """Go above a place: up, across and down to where the operator becomes slow.

        Another try begins from over the start: something may hang over the place that
        the hand has reached in a hurry.
        """
        begin = self.plant.seen[:2].copy()
        for again in range(TRIES):
            if again and not self.lead(np.array([*begin, self.plant.seen[2]]), BACK):
                self.again(fingers=opened is not None)
                continue
            height = self.plant.seen[2]
            first = max(min(travel, height + self.hurry), height)
            if (
                self.lead(np.array([*begin, first]), self.fast)
                and self.lead(np.array([*xy, travel]), self.fast, open_to=opened)
                and self.lead(np.array([*xy, min(low + SLOW_FROM, travel)]), self.fast)
            ):
                return True
            self.again(fingers=opened is not None)
        return False

    def again(self, *, fingers: bool) -> None:
        """Leave what is in the way, to try again without hurry."""
        self.blocked_by = what_blocks(self.plant.command) or self.blocked_by
        self.tries += 1
        self.hurry = np.inf
        self.plant.leave(fingers=fingers)


def run_episode(seed: int) -> dict[str, Any]:
    """One episode: its outcome, and what the judge found."""
    begin = process_time()
    rng = np.random.default_rng([seed, 0])
    place, name, goal = cluttered(rng)
    guard = Guard(place.scene(), self_test=False)
    outcome = Outcome(seed)
    outcome.certified = is_certified(guard, place, name, goal)
    judge = Judge(place, PERIOD)
    picker = Picker(Plant(guard, rng), judge, GANTRY, rng)
    pick_and_place(picker, place, name, goal, outcome)
    outcome.worked_s = process_time() - begin
    return figures_of(picker, place, outcome)


def pick_and_place(
    picker: Picker, place: Workplace, name: str, goal: Floats, outcome: Outcome
) -> None:
    """Have something gripped and put down elsewhere; what came of it."""
    travel = place.travel(picker.tool)
    outcome.failed = pick(picker, place, name, travel)
    outcome.grasped = outcome.failed is None
    if outcome.grasped:
        outcome.failed = put_down(picker, place, name, goal, travel)
        outcome.placed = outcome.failed is None
    picker.look()
    outcome.tries_again = picker.tries
    outcome.simulated_s = len(picker.plant.rows) * PERIOD


def figures_of(picker: Picker, place: Workplace, outcome: Outcome) -> dict[str, Any]:
    """Figures of an episode."""
    found = picker.judge.findings
    return {
        **asdict(outcome),
        "stops": picker.plant.stops,
        **found.figures("slipped"),
        "response": place.response,
    }


def ends_of_way(place: Workplace, name: str, goal: Floats, tool: Tool) -> Floats:
    """Where hand and fingers go from one to the other, shape (7, 5) [m]."""
    target = place.objects[name]
    xy, opened = target.at[:2], tool.opening(target)
    low, travel = tool.height_over(target), place.travel(tool)
    ends = [(*xy, travel), (*xy, low), (*xy, travel)]
    ends += [(*goal, travel), (*goal, low), (*goal, travel)]
    return np.array([place.home, *([*end, opened, opened] for end in ends)])


def is_certified(guard: Guard, place: Workplace, name: str, goal: Floats) -> bool:
    """Whether the way there is proven, and free for what is to be carried on."""
    target = place.objects[name]
    rows = ends_of_way(place, name, goal, GANTRY)
    guard.remove(name)
    clear = guard.check_path(rows).clear and carries_clear(place, name, rows)
    guard.place(name, Pose(xyz=tuple(target.at.tolist())))
    return clear


def carries_clear(place: Workplace, name: str, ends: Floats) -> bool:
    """Whether what is carried keeps its room to all but what it is put down on.

    By closed forms, along the straight pieces from where it is gripped on.
    """
    item = place.objects[name]
    offset = item.at - ends[GRIPPED, :3]
    others = {**place.fixtures, **place.objects}
    share = np.linspace(0.0, 1.0, 501)[:, None]
    for begin, end in pairwise(ends[GRIPPED:, :3]):
        carried = item.moved_to(begin + share * (end - begin) + offset)
        for other, solid in others.items():
            near = float(gaps(carried, solid).min())
            if other not in (name, "table") and near < ROOM:
                return False
    return True


def pick(picker: Picker, place: Workplace, name: str, travel: float) -> str | None:
    """Grip something; why not if it fails."""
    target = place.objects[name]
    xy, low = target.at[:2], picker.tool.height_over(target)
    if not picker.over(xy, travel, low, picker.tool.opening(target)):
        return why(picker, "above it")
    picker.look()
    closing = np.array([0.0, 0.0, 0.0, -picker.closing, -picker.closing])
    for _ in range(TRIES):
        arrived = picker.lead(
            np.array([*xy, low]), picker.slow, open_to=picker.tool.opening(target)
        )
        closed = arrived and picker.push(closing, FINGERS, name)
        if closed:
            break
        stuck = why(picker, "closing on it" if arrived else "going down to it")
        picker.again(fingers=True)
    else:
        picker.look({(finger, name) for finger in FINGERS})
        return stuck
    rest(picker)
    picker.look({(finger, name) for finger in FINGERS})
    try:
        picker.guard.grasp("arm", name)
    except GraspError as error:
        return f"grasp: {error}"
    picker.judge.grasp(picker.plant.q, name)
    picker.plant.grip(grips=True)
    return None


def put_down(
    picker: Picker, place: Workplace, name: str, goal: Floats, travel: float
) -> str | None:
    """Carry what is gripped to a place and let go of it there; why not if it fails."""
    target = place.objects[name]
    standing = {(HELD, "table")}
    lifted = picker.lead(np.add(picker.plant.seen[:3], (0.0, 0.0, LIFTED)), picker.slow)
    picker.look(standing)
    if not lifted:
        return why(picker, "lifting it")
    lowering = np.array([0.0, 0.0, -picker.slow, 0.0, 0.0])
    for _ in range(TRIES):
        above = picker.over(goal, travel, picker.tool.height_over(target), None)
        picker.look()
        down = above and picker.push(lowering, (HELD,), "table")
        if down:
            break
        stuck = why(picker, "putting it down" if above else "carrying it")
        picker.again(fingers=False)
        picker.look(standing)
    else:
        return stuck
    rest(picker)
    picker.look(standing)
    try:
        picker.guard.release("arm", name)
    except GraspError as error:
        return f"release: {error}"
    picker.judge.release(picker.plant.q)
    picker.plant.grip(grips=False)
    here = picker.plant.seen[:3]
    opened = picker.lead(here, picker.slow, open_to=picker.tool.opening(target))
    away = opened and picker.lead(np.add(here, (0.0, 0.0, AWAY)), picker.slow)
    picker.look({(finger, name) for finger in FINGERS})
    if not away:
        return why(picker, "letting go" if not opened else "leaving it")
    return misplaced(picker, name, goal)


def rest(picker: Picker) -> None:
    """Desire no motion for a while."""
    for _ in range(25):
        picker.plant.cycle(np.zeros(5))


def misplaced(picker: Picker, name: str, goal: Floats) -> str | None:
    """What is wrong with where something is; None if nothing is."""
    solid = picker.judge.solids[name]
    off = float(np.abs(solid.at[:2] - goal).max())
    above = float(solid.at[2] - solid.half[2])
    if off <= PLACED and abs(above) <= ABOVE_TABLE:
        return None
    return f"misplaced by {off * 1e3:.1f} mm, {above * 1e3:.1f} mm above the table"


def why(picker: Picker, when: str) -> str:
    """Why the arm did not get on, as the guard says it, or said it the last time."""
    reason = what_blocks(picker.plant.command) or picker.blocked_by
    return f"{when}: {reason or UNNAMED}"


def what_blocks(command: Command | None) -> str:
    """What keeps an arm from going on, as the guard says it; "" if nothing does."""
    if command is None:
        return ""
    blocked = command.blocked["arm"]
    reason = command.verdict.reason
    named = blocked.name if blocked else ""
    if reason is not Reason.OK:
        named += f" {reason.name}"
    near = [p for p in command.verdict.near if p.headroom < 0.005]
    pairs = "; ".join(f"{p.a}, {p.b} {p.headroom * 1e3:.1f} mm left" for p in near)
    return f"{named} {pairs}".strip()
