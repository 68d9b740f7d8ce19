"""One thing is thrown or pushed at an arm: what came of it, and what could have."""

from math import inf
from time import process_time
from typing import Any

import numpy as np

from armguard.respond import Guard
from episodes.classes import classes
from evading.judge import Findings
from evading.places import MOVER, PERIOD, Place
from evading.plant import Plant
from evading.search import Search
from evading.throws import BEFORE, SPEEDS, Throw, drawn_thing, drawn_throw

# How many cycles pass until the thing is seen again, and how old that is, at most.
SEEN_EVERY, SEEN_LATE = 5, 2

# Width of a class of cycle times [us].
CLASS = 10


class Sight:
    """Who sees the thing now and then, late, and tells the guard.

    Args:
        guard: The guard.
        throw: What comes.
        rng: Draws when it is seen.
    """

    def __init__(self, guard: Guard, throw: Throw, rng: np.random.Generator) -> None:
        self.guard, self.throw, self.rng = guard, throw, rng
        self._next, self._seen = BEFORE, BEFORE

    def tell(self, plant: Plant) -> None:
        """Tell the guard before a cycle what was seen."""
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
            self.throw.thing.at(
                self.throw.begin + (time - BEFORE) * self.throw.velocity
            ),
            plant.clock(time),
            velocity=self.throw.velocity,
        )
        self._next = plant.time + PERIOD * int(self.rng.integers(1, SEEN_EVERY + 1))


def run_episode(name: str, seed: int, *, evade: bool = True) -> dict[str, Any]:
    """One episode: what the judge and the search found.

    Args:
        name: Where, "bay" or "pandas".
        seed: Number of the episode.
        evade: Whether the arms get out of the way.
    """
    begin = process_time()
    rng = np.random.default_rng([seed, 3])
    speed = float(rng.uniform(*SPEEDS))
    thing = drawn_thing(rng, speed)
    place = Place(name, thing, evade=evade)
    throw = drawn_throw(rng, place, thing, speed)
    guard = Guard(place.scene, self_test=False)
    plant = Plant(guard, throw.q, rng)
    sight, found = Sight(guard, throw, rng), Findings()
    first = (BEFORE, plant.q, plant.v)
    while plant.time < throw.duration:
        if plant.time <= BEFORE:
            first = (BEFORE, plant.q, plant.v)
        sight.tell(plant)
        plant.drive(throw.wish(plant.time))
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
    """Why the thing was not evaded, and how far what it hit went along with it.

    Returns:
        `why` and `along`, the share of the way of what was hit between when the arm
        began to get out of the way and the hit that is along the thing's [-]; None
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
