"""An operator among objects side by side changes the grasp target, again and again.

At any time the operator turns to another object, or to another way of driving: slowly
from above, to grip; at speed, straight at it; with the back of the hand; or with closed
fingers. Now and then the stick moves at random: an object to which that leads slowly
counts as intended.
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

# How long an intent lasts, and how long an episode is [s].
INTENT_TIME, DURATION = (0.1, 5.0), 15.0

# Height above objects at which the hand goes from one to another [m].
OVER = 0.06

# How near above an object the hand has to be before it goes down [m].
ALIGNED = 0.003

# A former target stays intended until the fingers have been this far from it [m].
CLEAR = 0.008

# How far closed fingers are open [m].
NARROW = 0.006

# A stick at random intends an object if the straight way of the middle between the
# fingers passes this near to it within this length, no faster than that: figures that
# the scene declares [m, m, m/s].
AIM, AHEAD, SLOW = 0.01, 0.1, 0.1

# The operator lets go of an arm that was stopped for this long [s].
STOPPED = 0.2

# Share of intents by way of driving [-].
WAYS = {"grip": 0.6, "speed": 0.15, "hand": 0.1, "closed": 0.1, "random": 0.05}


@dataclass
class Intent:
    """Intent of an operator.

    Attributes:
        target: The object.
        way: Way of driving, a key of `WAYS`.
        speed: How fast [m/s].
        until: Cycle in which it changes.
        stick: Velocity of the hand where the stick moves at random, shape (3,) [m/s].
    """

    target: str
    way: str
    speed: float
    until: int
    stick: Floats


class ChangingOperator:
    """The operator.

    Args:
        guard: The guard between operator and arm.
        judge: What the operator sees: where objects are.
        rng: Draws the intents.
    """

    def __init__(self, guard: Guard, judge: Judge, rng: np.random.Generator) -> None:
        self.plant = Plant(guard, rng)
        self.judge = judge
        self.rng = rng
        self.names = [n for n in judge.solids if n != "table"]
        self.intent = self.another(0)
        # Objects the fingers may touch: the target, and those they have not left yet.
        self.intended = {self.intent.target}
        self.changes = 0

    def another(self, cycle: int) -> Intent:
        """Another object, or another way of driving."""
        rng = self.rng
        way = str(rng.choice(list(WAYS), p=list(WAYS.values())))
        slow = way in ("grip", "closed") or rng.random() < 0.3
        speed = rng.uniform(0.04, 0.09) if slow else rng.uniform(0.1, 0.8)
        for_cycles = rng.uniform(*INTENT_TIME) / PERIOD
        stick = speed * rng.uniform(-1.0, 1.0, 3)
        target = str(rng.choice(self.names))
        return Intent(target, way, speed, cycle + int(for_cycles), stick)

    def cycle(self) -> None:
        """One cycle; before it the intent may change."""
        k = len(self.plant.rows)
        if k >= self.intent.until:
            self.look()
            self.intent = self.another(k)
            if self.intent.way != "random":
                self.intended.add(self.intent.target)
            self.changes += 1
        desired = self.desired()
        if self.intent.way == "random":
            # From now on the fingers may touch these as well.
            if not (names := self.headed_for(desired[:3])) <= self.intended:
                self.look()
                self.intended |= names
        self.plant.cycle(desired)
        if self.plant.stopped_for > STOPPED:
            self.plant.leave(fingers=True)
        self.forget()

    def is_at(self, q: Floats, name: str) -> bool:
        """Whether a finger is at an object."""
        return any(self.judge.gap(q, finger, name) <= CLEAR for finger in FINGERS)

    def headed_for(self, stick: Floats) -> set[str]:
        """Objects at the fingers to which a stick leads slowly."""
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
        """Forget former targets once the fingers have left them."""
        q = self.plant.q
        kept = set() if self.intent.way == "random" else {self.intent.target}
        left = {name for name in self.intended - kept if not self.is_at(q, name)}
        if left:
            self.look()
            self.intended -= left

    def look(self) -> None:
        """Have what happened judged by what is intended now."""
        may = {(finger, name) for finger in FINGERS for name in self.intended}
        self.judge.look(self.plant.rows, may)

    def desired(self) -> Floats:
        """Desired velocities, shape (5,) [m/s]."""
        intent, seen = self.intent, self.plant.seen
        desired = np.zeros(5)
        if intent.way == "random":
            desired[:3] = intent.stick
            return desired
        solid = self.judge.solids[intent.target]
        low = GANTRY.height_over(solid)
        wide = GANTRY.opening(solid) if intent.way != "closed" else NARROW
        goal = np.array([solid.at[0], solid.at[1], low])
        if intent.way == "hand":
            goal[2] -= 0.1
        beside = max(abs(goal[0] - seen[0]), abs(goal[1] - seen[1]))
        if intent.way in ("grip", "closed", "hand") and beside > ALIGNED:
            above = low + 2.0 * float(solid.half[2]) + OVER
            goal[2] = above
            if seen[2] < above - 0.02:
                goal[:2] = seen[:2]
        way = goal - seen[:3]
        desired[:3] = 8.0 * way
        size = float(np.sqrt(desired[:3] @ desired[:3]))
        slow = (
            intent.speed if way[2] < 0.0 and beside <= ALIGNED else 4.0 * intent.speed
        )
        most = intent.speed if intent.way == "speed" else min(slow, 0.8)
        if size > most:
            desired[:3] *= most / size
        down = abs(seen[2] - low) < 0.004 and beside <= ALIGNED
        if intent.way == "grip" and down:
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
    operator = ChangingOperator(guard, judge, rng)
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
