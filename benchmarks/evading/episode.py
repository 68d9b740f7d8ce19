"""A projectile comes at an arm: what came of it, and what could have."""

from math import inf
from time import process_time
from typing import Any

import numpy as np

from armguard.guard import Level
from armguard.respond import Action, Blocked, Command, Guard
from arrays import Bools, Floats
from episodes.classes import classes
from episodes.follower import Follower
from evading.places import MOVER, PERIOD, Findings, Place
from evading.sensed import Watcher
from evading.throws import BEFORE, SPEEDS, Search, Throw, drawn_projectile, drawn_throw


class Plant(Follower):
    """Arms that follow what a guard makes of their operators' velocities.

    Attributes:
        stops: Time, arm and named reason of all stops, in order.
        began: When each arm that evaded began to [s], and its true state then.
        cycle_times: How long each cycle took [s].

    Args:
        guard: The guard.
        q: Where they begin, shape (n,) [rad or m].
        rng: Draws delays and errors.
    """

    substeps = 4

    def __init__(self, guard: Guard, q: Floats, rng: np.random.Generator) -> None:
        super().__init__(guard, q, rng)
        self.stops: list[tuple[float, str, str]] = []
        self.began: dict[str, tuple[float, Floats, Floats]] = {}
        self.cycle_times: list[float] = []
        self._actions = dict.fromkeys(self.own, Action.FOLLOW)
        self._brake_at = dict.fromkeys(self.own, np.inf)

    def measured_speeds(self, v: Floats) -> Floats:
        """See `Follower`."""
        return v + self.noise("velocity_error")

    def move(self, velocity: Floats, drifts: Bools) -> None:
        """Move the joints on by a substep."""
        aim = velocity + drifts * self._error
        most = self._most["acceleration"] * self.substep
        for name, at in self._brake_at.items():
            if self.time >= at:
                own = self.own[name]
                aim[own] = 0.0
                most[own] = self.figures[name].brake_deceleration * self.substep
        before = self.v
        self.v = before + np.clip(aim - before, -most, most)
        self.q = self.q + 0.5 * (before + self.v) * self.substep

    def kept_error(self, error: Floats) -> Floats:
        """See `Follower`: a stop is as declared, it is not sped up again."""
        for name, action in self._actions.items():
            if action >= Action.STOP:
                error[self.own[name]] = self._error[self.own[name]]
        return error

    def note(self, command: Command) -> None:
        """Remember stops when they begin, and engage arms that may go on."""
        verdict, blocked = command.verdict, command.blocked
        self.cycle_times.append(verdict.cycle_time)
        for name, action in command.actions.items():
            if blocked[name] is Blocked.EVADING:
                self.began.setdefault(name, (self.time, self.q, self.v))
            before, self._actions[name] = self._actions[name], action
            if action < Action.BRAKE:
                self._brake_at[name] = np.inf
            elif self._brake_at[name] == np.inf:
                self._brake_at[name] = self.time + self.figures[name].brake_delay
            if action > before and verdict.levels[name] >= Level.STOP:
                self.stops.append((self.time, name, verdict.reason.name))
            if blocked[name] is Blocked.STOPPED and action is Action.HOLD:
                self.guard.engage(name)


# How many cycles pass until the projectile is seen again, and how old that is, at most.
SEEN_EVERY, SEEN_LATE = 5, 2

# Width of a class of cycle times [us].
CLASS = 10


class Sight:
    """A sensor that sees the projectile now and then, late, and reports to the guard.

    Args:
        guard: The guard.
        throw: What comes.
        rng: Draws when it is seen.
    """

    def __init__(self, guard: Guard, throw: Throw, rng: np.random.Generator) -> None:
        self.guard, self.throw, self.rng = guard, throw, rng
        self._next, self._seen = BEFORE, BEFORE

    def report(self, plant: Plant) -> None:
        """Report to the guard before a cycle what was seen."""
        if plant.time < self._next:
            return
        if self.throw.mover(plant.time) is None:
            self.guard.remove(MOVER)
            self._next = inf
            return
        late = PERIOD * int(self.rng.integers(SEEN_LATE + 1))
        # Sightings arrive in their order.
        time = self._seen = max(plant.time - late, self._seen)
        self.guard.place(
            MOVER,
            self.throw.projectile.at(
                self.throw.begin + (time - BEFORE) * self.throw.velocity
            ),
            plant.clock(time),
            velocity=self.throw.velocity,
        )
        self._next = plant.time + PERIOD * int(self.rng.integers(1, SEEN_EVERY + 1))


def run_episode(
    name: str, seed: int, *, evade: bool = True, sensed: bool = False
) -> dict[str, Any]:
    """One episode: what the judge and the search found.

    Args:
        name: Where, "bay" or "pandas".
        seed: Number of the episode.
        evade: Whether the arms get out of the way.
        sensed: Whether the guard knows the projectile by cameras alone.
    """
    begin = process_time()
    rng = np.random.default_rng([seed, 3])
    speed = float(rng.uniform(*SPEEDS))
    projectile = drawn_projectile(rng, speed)
    place = Place(name, projectile, evade=evade)
    throw = drawn_throw(rng, place, projectile, speed)
    sight: Sight | Watcher
    if sensed:
        sight = guard = Watcher(name, throw, seed, evade=evade)
    else:
        guard = Guard(place.scene, self_test=False)
        sight = Sight(guard, throw, rng)
    plant, found = Plant(guard, throw.q, rng), Findings()
    first = (BEFORE, plant.q, plant.v)
    while plant.time < throw.duration:
        if plant.time <= BEFORE:
            first = (BEFORE, plant.q, plant.v)
        sight.report(plant)
        plant.drive(throw.desired(plant.time))
        place.judge.look(plant.q, throw.mover(plant.time), plant.time, found)
    search = Search(place, throw, first, rng)
    evadable = search.finds()
    until = inf if found.hit is None else found.hit.time
    return {
        "seed": seed,
        "arm": place.robots[throw.robot],
        "speed": speed,
        "works": throw.works,
        "until_hit": throw.until_hit,
        "evadable": evadable,
        "ways_tried": search.tried,
        "evaded": found.hit is None,
        "hit": found.hit and found.hit.link,
        "hit_at": found.hit and found.hit.time - BEFORE,
        **why_not(place, throw, plant, found, rng),
        "mover_least": found.mover,
        "others_least": found.others,
        "touched": [[*pair, time] for pair, time in found.touched.items()],
        "stops": [reason for time, _, reason in plant.stops if time <= until],
        "cycle_us": classes((1e6 * t for t in plant.cycle_times), CLASS),
        "slowest_cycle_us": 1e6 * max(plant.cycle_times),
        "simulated_s": plant.time,
        "worked_s": process_time() - begin,
    }


def why_not(
    place: Place,
    throw: Throw,
    plant: Plant,
    found: Findings,
    rng: np.random.Generator,
) -> dict[str, Any]:
    """Why the projectile was not evaded, and how far what it hit went along with it.

    Returns:
        `why` and `along`, the share of the way of what was hit between when the arm
        began to get out of the way and the hit that is along the projectile's [-]; None
        where there is none.
    """
    if found.hit is None:
        return {"why": None, "along": None}
    name = place.robots[throw.robot]
    state = plant.began.get(name)
    if found.hit.link.split("/")[0] != name:
        return {"why": "the other arm was hit", "along": None}
    if state is None or state[0] > found.hit.time:
        return {"why": "it never began", "along": None}
    judge = place.judge
    judge.put(state[1], None)
    way = -judge.middle(found.hit.geom)
    judge.put(found.hit.q, None)
    way += judge.middle(found.hit.geom)
    length = float(np.sqrt(way @ way))
    along = float(way @ throw.velocity) / (throw.speed * length) if length else 0.0
    stops = [
        reason
        for time, robot, reason in plant.stops
        if robot == name and state[0] <= time <= found.hit.time
    ]
    if not Search(place, throw, state, rng).finds():
        why = "it began too late"
    elif stops:
        why = f"it was stopped: {stops[0]}"
    else:
        why = "its way did not lead out"
    return {"why": why, "along": along}
