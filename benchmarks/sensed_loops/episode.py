"""An episode: an operator tries to hit foreign bodies that sensors alone know."""

from collections import deque
from collections.abc import Iterator
from time import process_time
from typing import Any

import numpy as np

import armguard as ag
from armguard.guard import Level
from armguard.scene.compile import compile_scene
from armguard.simulation.sensed import TRANSPORT
from armguard.simulation.sensors import Rig
from arrays import Floats
from closed_loop.judge import Judge
from closed_loop.judge_model import SIGHT
from evading.episode import Plant
from evading.sensed import CENTRES, walls
from freedom.worlds import World, modelled
from sensed_loops.scenes import CELL, Setting, sensing_scene, world_of

# When an operator begins, and how long an episode is [s].
BEGIN, SECONDS = 0.4, 2.0

# Greatest share of distances of arrays that are invalid [-]. Distance about links that
# is taken for free where that is to be shown to be wrong [m].
INVALID, CUT_OUT = 0.2, 0.08

# Cycles after which an operator looks again, and aims at another body; the share of
# aims at the nearest one [-].
LOOKS, AIMS, NEAREST = 2, 60, 0.7


class Sensing:
    """Sensors that see true bodies and links, and a guard that knows what they see.

    Attributes:
        tables: Tables of the guard.

    Args:
        setting: The kind of episodes.
        world: The foreign bodies.
        seed: Seed of noise, delays and mountings.
    """

    def __init__(self, setting: Setting, world: World, seed: int) -> None:
        self._setting, self._world = setting, world
        scene, truth = (sensing_scene(setting, true=true) for true in (False, True))
        self._sensors, self._rng = truth.sensors, np.random.default_rng([seed, 5])
        self._guard = ag.Guard(scene, self_test=False)
        self._sense = ag.Sense(scene, self._guard)
        self._update = self._guard.update_cells
        self._guard.update_cells = self._take_cells  # type: ignore[method-assign]
        self.tables, self.engage = self._guard.tables, self._guard.engage
        bodies = [ag.Box(size=tuple(edges)) for edges in world.edges.tolist()]
        # Without a room, cameras on all sides would look into nothing.
        room = walls(np.array(CENTRES[setting.place])) if setting.moves else []
        self._rig = Rig(truth, [*bodies, *(shape for shape, _ in room)], seed)
        for k, (_, pose) in enumerate(room, start=len(bodies)):
            self._rig.place(k, pose)
        self._rig.invalid = self._rng.uniform(0.0, INVALID)
        self._due, self._sent = dict[str, float](), list[tuple[Any, ...]]()
        for name, sensor in self._sensors.items():
            aside = self._rng.normal(size=3)
            T = sensor.pose.matrix()
            T[:3, 3] += sensor.error * aside / np.linalg.norm(aside)
            self._rig.truth[name] = T
            self._due[name] = sensor.period * self._rng.random()
        self._past: deque[tuple[float, Floats]] = deque(maxlen=60)

    def look(self, plant: Plant) -> None:
        """Measure what is due, and take the frames that are there before a cycle."""
        time, lag = plant.time, plant.clock(plant.time) - plant.time
        self._past.append((time, plant.q))
        for name, measured in self._due.items():
            sensor = self._sensors[name]
            if measured > time:
                continue
            self._due[name] += sensor.period
            late = sensor.delay + sensor.jitter * self._rng.uniform(-1.0, 1.0)
            stamp = measured + late + lag
            found = self._rig_at(measured).read(name, self._positions(measured))
            self._sent.append((measured + late + TRANSPORT, name, *found, stamp))
        self._sent.sort(key=lambda sent: sent[0])
        while self._sent and self._sent[0][0] <= time:
            self._sense.frame(*self._sent.pop(0)[1:])
            if self._setting.left_out == "shell":
                self._sense._filling.clear(CUT_OUT, self._sense._history)

    def filter(
        self, q: Floats, v_desired: Floats, stamp: float, *, velocity: Floats,
        now: float,
    ) -> Any:  # fmt: skip
        """See `Guard.filter`."""
        self._sense.joints(q, stamp)
        return self._guard.filter(q, v_desired, stamp, velocity=velocity, now=now)

    def _rig_at(self, time: float) -> Rig:
        """The simulated sensors, with all bodies where they are at a time."""
        moved = self._world.velocities * max(time, 0.0)
        for k, pose in enumerate(self._world.poses):
            T = pose.matrix()
            T[:3, 3] += moved[k]
            self._rig.place(k, ag.Pose.from_matrix(T))
        return self._rig

    def _positions(self, time: float) -> Floats:
        """True joint positions at a time of the last cycles, shape (n,) [rad or m]."""
        return min(self._past, key=lambda past: abs(past[0] - time))[1]

    def _take_cells(self, deltas: Any, stamp: float) -> None:
        """Let the guard take changes, without what it is not to know."""
        self._update(deltas, stamp)
        table, left_out = self._guard._sensed.table, self._setting.left_out
        claims, about, now = table.claims, table.about, self._past[-1][0]
        if left_out == "error":
            claims.error[:] = 0.0
        elif left_out == "cell":
            claims.error[:] = -0.5 * CELL
        elif left_out == "age":
            claims.stamp[claims.stamp > -np.inf] = now
            about.oldest = now if np.isfinite(about.oldest) else about.oldest


class Operator:
    """Aims each arm at foreign bodies, at full speed.

    Args:
        plant: The arms.
        judge: Where bodies are.
        rng: Draws what each arm is aimed at.
    """

    def __init__(self, plant: Plant, judge: Judge, rng: np.random.Generator) -> None:
        self._plant, self._judge, self._rng = plant, judge, rng
        owners = enumerate(judge.owners)
        self._foreign = [g for g, owner in owners if is_foreign(owner)]
        self._links = {
            name: np.flatnonzero(judge.arm_of == k).tolist()
            for k, name in enumerate(plant.robots)
        }
        self._top = plant.joined("velocity")
        self._aims = dict.fromkeys(plant.robots, (0, 0))
        self._desired = np.zeros_like(self._top)

    def desired(self) -> Floats:
        """Desired velocities of all joints, shape (n,) [rad/s or m/s]."""
        plant = self._plant
        if plant.time < BEGIN:
            return np.zeros_like(self._top)
        for name, own in plant.own.items():
            if plant.cycles % AIMS == 0 or self._aims[name] == (0, 0):
                self._aims[name] = self._aim(self._links[name])
            if plant.cycles % LOOKS == 0:
                _, slopes = self._judge.apart(self._aims[name])
                way = -slopes[own]
                most = np.abs(way / self._top[own]).max()
                self._desired[own] = way / max(most, 1e-9)
        return self._desired

    def _aim(self, links: list[int]) -> tuple[int, int]:
        """A pair of a link's geom and a body's."""
        pairs = [(g, f) for g in links for f in self._foreign]
        if self._rng.random() < NEAREST:
            return min(pairs, key=self._judge.gap)
        return pairs[int(self._rng.integers(len(pairs)))]


def run_episode(setting: Setting, seed: int) -> dict[str, Any]:
    """One episode, which ends at a contact.

    Args:
        setting: The kind of episodes.
        seed: Number of the episode.

    Returns:
        Link, body and time of a contact with an arm that moves [s]; whether a body has
        met an arm at rest; least distance of moving arms to bodies, at most `SIGHT`
        [m]; cycles, and those that require a stop; the way that is commanded, summed
        over joints [rad or m]; and named reasons of stops.
    """
    begin = process_time()
    world = world_of(setting, seed)
    scene = modelled(world, setting.place)
    judge = Judge(scene, compile_scene(scene))
    rng = np.random.default_rng([seed, 13])
    sensing = Sensing(setting, world, seed)
    plant = Plant(sensing, scene.home, rng)
    judge.place(plant.q)
    operator = Operator(plant, judge, rng)
    contact, met_at_rest, least = None, False, SIGHT
    way, stopped = 0.0, 0
    while plant.time < SECONDS and contact is None and not met_at_rest:
        sensing.look(plant)
        command = plant.drive(operator.desired())
        way += plant.period * float(np.abs(command.velocity).sum())
        stopped += command.verdict.level >= Level.STOP
        for distance, names, moves in gaps(judge, plant, world):
            if moves:
                least = min(least, distance)
            if moves and distance < 0.0:
                contact = [*names, plant.time]
            met_at_rest |= distance < 0.0 and not moves
    return {
        "seed": seed,
        "contact": contact,
        "met_at_rest": met_at_rest,
        "least": least,
        "cycles": plant.cycles,
        "stopped": stopped,
        "way": way,
        "stops": [reason for *_, reason in plant.stops],
        "worked_s": process_time() - begin,
    }


def gaps(
    judge: Judge, plant: Plant, world: World
) -> Iterator[tuple[float, list[str], bool]]:
    """Distances of links to bodies on the true state, within sight.

    Yields:
        Distance [m], names of both, and whether any joint of the arm moves.
    """
    moved = world.velocities * plant.time
    for k in range(len(world.poses)):
        judge.stand_at(f"foreign{k}", moved[k])
    distances, geoms = judge.measure(plant.q)
    for distance, pair in zip(distances.tolist(), geoms.tolist(), strict=True):
        names = sorted((judge.owners[g] for g in pair), key=is_foreign)
        if is_foreign(names[1]):
            own = plant.own[plant.robots[max(judge.arm_of[g] for g in pair)]]
            yield distance, names, bool((plant.v[own] != 0.0).any())


def is_foreign(name: str) -> bool:
    """Whether a name is that of a foreign body."""
    return name.startswith("foreign")
