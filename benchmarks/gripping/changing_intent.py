"""An operator among things that stand side by side changes his mind, again and again.

At any time he turns to another thing, or to another way of driving: slowly from above,
as one who wants to grip; at speed, straight at it; with the back of the hand; or with
closed fingers. Now and then he drives with the stick at random: what that leads slowly
to he cannot but mean.
"""

from dataclasses import dataclass
from time import process_time
from typing import Any

import numpy as np

from armguard.respond import Guard
from arrays import Floats
from gripping.gantry import BELOW
from gripping.judge import FINGERS, Judge
from gripping.plant import Plant
from gripping.workplace import GANTRY, PERIOD, box, gaps, side_by_side

# How long he is of one mind, and how long an episode is [s].
OF_ONE_MIND, DURATION = (0.1, 5.0), 15.0

# Height above things at which he goes from one to another [m].
OVER = 0.06

# How near above a thing he has to be before he goes down to it [m].
ALIGNED = 0.003

# Who turned to another thing still means the one he was at until his fingers have been
# this far from it [m].
CLEAR = 0.008

# How far fingers are open that he has closed [m].
NARROW = 0.006

# A stick at random means what the straight way of the middle between the fingers leads
# to, this near to it and within this length, if it is no faster than that: what the
# scene declares [m, m, m/s].
AIM, AHEAD, SLOW = 0.01, 0.1, 0.1

# He lets go of an arm that was stopped for this long [s].
STOPPED = 0.2

# Share of his minds by way of driving [-].
WAYS = {"grip": 0.6, "speed": 0.15, "hand": 0.1, "closed": 0.1, "random": 0.05}


@dataclass
class Mind:
    """What an operator wants.

    Attributes:
        target: The thing.
        way: How he drives, a key of `WAYS`.
        speed: How fast [m/s].
        until: Cycle in which he changes it.
        stick: Velocity of the hand where he drives at random, shape (3,) [m/s].
    """

    target: str
    way: str
    speed: float
    until: int
    stick: Floats


class Fickle:
    """The operator.

    Args:
        guard: The guard he drives through.
        judge: What he sees: where things are.
        rng: Draws what he wants.
    """

    def __init__(self, guard: Guard, judge: Judge, rng: np.random.Generator) -> None:
        self.plant = Plant(guard, rng)
        self.judge = judge
        self.rng = rng
        self.names = [n for n in judge.solids if n != "table"]
        self.mind = self.another(0)
        # Things his fingers may touch: what he wants, and what he has not left yet.
        self.intended = {self.mind.target}
        self.changes = 0

    def another(self, cycle: int) -> Mind:
        """Another thing, or another way of driving."""
        rng = self.rng
        way = str(rng.choice(list(WAYS), p=list(WAYS.values())))
        slow = way in ("grip", "closed") or rng.random() < 0.3
        speed = rng.uniform(0.04, 0.09) if slow else rng.uniform(0.1, 0.8)
        for_cycles = rng.uniform(*OF_ONE_MIND) / PERIOD
        stick = speed * rng.uniform(-1.0, 1.0, 3)
        target = str(rng.choice(self.names))
        return Mind(target, way, speed, cycle + int(for_cycles), stick)

    def cycle(self) -> None:
        """One cycle; before it he may change his mind."""
        k = len(self.plant.rows)
        if k >= self.mind.until:
            self.look()
            self.mind = self.another(k)
            if self.mind.way != "random":
                self.intended.add(self.mind.target)
            self.changes += 1
        desired = self.desired()
        if self.mind.way == "random":
            # From now on he may touch these as well.
            if not (names := self.headed_for(desired[:3])) <= self.intended:
                self.look()
                self.intended |= names
        self.plant.cycle(desired)
        if self.plant.stopped_for > STOPPED:
            self.plant.leave(fingers=True)
        self.forget()

    def is_at(self, q: Floats, name: str) -> bool:
        """Whether a finger is at a thing."""
        return any(self.judge.gap(q, finger, name) <= CLEAR for finger in FINGERS)

    def headed_for(self, stick: Floats) -> set[str]:
        """Things he is at and that a stick leads slowly to."""
        q = self.plant.q
        speed = float(np.sqrt(stick @ stick))
        near = {name for name in self.names if self.is_at(q, name)}
        if not near or speed > SLOW:
            return set()
        middle = q[:3] + np.array([0.0, 0.5 * (q[3] - q[4]), -BELOW])
        way = np.linspace(0.0, AHEAD, 51)[:, None] * (stick / speed)
        points = box(np.zeros(3), middle + way)
        solids = self.judge.solids
        return {n for n in near if float(gaps(points, solids[n]).min()) <= AIM}

    def forget(self) -> None:
        """Forget what he turned away from, once he has left it."""
        q = self.plant.q
        kept = set() if self.mind.way == "random" else {self.mind.target}
        left = {name for name in self.intended - kept if not self.is_at(q, name)}
        if left:
            self.look()
            self.intended -= left

    def look(self) -> None:
        """Have what happened judged by what is intended now."""
        may = {(finger, name) for finger in FINGERS for name in self.intended}
        self.judge.look(self.plant.rows, may)

    def desired(self) -> Floats:
        """The velocities he asks for, shape (5,) [m/s]."""
        mind, seen = self.mind, self.plant.seen
        desired = np.zeros(5)
        if mind.way == "random":
            desired[:3] = mind.stick
            return desired
        solid = self.judge.solids[mind.target]
        low = GANTRY.height_over(solid)
        wide = GANTRY.opening(solid) if mind.way != "closed" else NARROW
        goal = np.array([solid.at[0], solid.at[1], low])
        if mind.way == "hand":
            goal[2] -= 0.1
        beside = max(abs(goal[0] - seen[0]), abs(goal[1] - seen[1]))
        if mind.way in ("grip", "closed", "hand") and beside > ALIGNED:
            above = low + 2.0 * float(solid.half[2]) + OVER
            goal[2] = above
            if seen[2] < above - 0.02:
                goal[:2] = seen[:2]
        way = goal - seen[:3]
        desired[:3] = 8.0 * way
        size = float(np.sqrt(desired[:3] @ desired[:3]))
        slow = mind.speed if way[2] < 0.0 and beside <= ALIGNED else 4.0 * mind.speed
        most = mind.speed if mind.way == "speed" else min(slow, 0.8)
        if size > most:
            desired[:3] *= most / size
        down = abs(seen[2] - low) < 0.004 and beside <= ALIGNED
        if mind.way == "grip" and down:
            desired[3:] = -0.04
        else:
            desired[3:] = np.clip(8.0 * (wide - seen[3:]), -0.05, 0.05)
        return desired


def run_episode(seed: int) -> dict[str, Any]:
    """One episode: what the judge found."""
    begin = process_time()
    rng = np.random.default_rng([seed, 1])
    place = side_by_side(rng)
    guard = Guard(place.scene(), self_test=False)
    judge = Judge(place, PERIOD)
    operator = Fickle(guard, judge, rng)
    while len(operator.plant.rows) * PERIOD < DURATION:
        operator.cycle()
    operator.look()
    found = judge.findings
    return {
        "seed": seed,
        "changes": operator.changes,
        "meant": len({name for _, name in found.intended}),
        "simulated_s": len(operator.plant.rows) * PERIOD,
        "worked_s": process_time() - begin,
        "stops": operator.plant.stops,
        **found.figures(),
        "response": place.response,
    }
