"""The same states, asked of guard, checker, plans, maps, tables, trees and Coal."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from math import inf, nan
from typing import Any

import numpy as np

import armguard as ag
from armguard.guard import Level
from armguard.guard.answer import Answer
from armguard.guard.world_at_home import world_at_home
from armguard.index import JointTable
from armguard.maps.cell_plan import CellPlan
from armguard.maps.coordination import Coordinator
from armguard.motion.joint_links import fixed_primitives, joint_links
from armguard.plans.coal_world import CoalWorld
from armguard.plans.verify import RESOLUTION
from armguard.prove.paving import TOLERANCE, Paver
from armguard.prove.tile_search import DEEP, ROUNDING
from armguard.scene import Scene, SceneTables
from arrays import Bools, Floats, Ints
from episodes.records import Figures, merged
from verifying.states import ROBOTS, SCENES, random_states

# States of an episode.
STATES = 1000

# Guard and checker measure alike to this, and Coal to the other [m].
SAME, ACCURACY = 1e-9, 1e-6

# A line leads through each state: its joints move this far in all, in a second, and
# this share of it is before the state [rad or m, -].
WAY, SHARE = 1e-2, 0.4

# Tiles of maps are not divided further [s].
FINEST = 0.005

# Edge of a cell of the region octrees [m], and cells along an edge of their cube.
CELL, SIZE = 0.01, 512

# Figures that are no sums of those of episodes.
KEPT = ("off", "tolerance", "below", "may_be_below", "above", "may_be_above")
EXTREME = dict.fromkeys(KEPT, max)

Pair = tuple[str, str]
Tallies = dict[str, dict[str, float]]


@dataclass(frozen=True, slots=True)
class Ways:
    """Ways to ask how near links are in a state of a scene.

    Attributes:
        scene: The scene.
        guard: Judges a state in each cycle.
        checker: Judges many.
        paver: Proves plans.
        coordinator: Makes maps of two robots' plans.
        table: Knows which objects a link may be near, by joint positions.
        trees: Objects as region octrees.
        coal: Coal on Pinocchio's kinematics.
    """

    scene: Scene
    guard: ag.Guard
    checker: ag.Checker
    paver: Paver
    coordinator: Coordinator
    table: JointTable
    trees: ag.RegionTrees
    coal: CoalWorld

    @property
    def tables(self) -> SceneTables:
        """The compiled scene."""
        return self.guard.tables


@cache
def ways_of(name: str) -> Ways:
    """All ways, for a scene by its name in `SCENES`."""
    make, centre = SCENES[name]
    scene = make()
    guard = ag.Guard(scene, self_test=False)
    t = guard.tables
    world = world_at_home(t, np.zeros((len(t.parent), 12)))
    links, columns = joint_links(t), fixed_primitives(t)
    return Ways(
        scene=scene,
        guard=guard,
        checker=ag.Checker(scene),
        paver=Paver(ag.Checker(scene)),
        coordinator=Coordinator(scene, ROBOTS),
        table=JointTable(world, links, columns, reach=t.margin),
        trees=ag.RegionTrees(scene, centre, CELL, SIZE),
        coal=CoalWorld(t, exact=True),
    )


@dataclass(frozen=True, slots=True)
class Judged:
    """Answers of the guard; a near pair has an entry in the arrays of shape (p,).

    Attributes:
        clear: Whether it lets each state pass, shape (k,).
        row: State of each near pair.
        ends: Primitives of each, lower first, shape (p, 2).
        outer: Distance of the primitives [m].
        exact: Distance of the exact shapes; infinite if not measured [m].
        distance: Distance that counts [m].
        buffer: Distance to keep [m].
    """

    clear: Bools
    row: Ints
    ends: Ints
    outer: Floats
    exact: Floats
    distance: Floats
    buffer: Floats

    def least(self, values: Floats, chosen: Bools | None = None) -> Floats:
        """Least value of each state's near pairs, or some of them; infinite if none."""
        found = np.full(len(self.clear), np.inf)
        own = slice(None) if chosen is None else chosen
        np.minimum.at(found, self.row[own], values[own])
        return found


def judged_states(guard: ag.Guard, rows: Floats) -> Judged:
    """Judge states one after another."""
    clear, near = [], []
    for q in rows:
        verdict = guard.step(q)
        clear.append(verdict.level < Level.STOP)
        near.append(Answer(verdict.numbers, guard.names).near.copy())
    every = np.concatenate(near)
    ends = np.column_stack((every["first"], every["second"])).astype(np.int64)
    fields = ("outer", "exact", "distance", "buffer")
    return Judged(
        np.array(clear),
        np.repeat(np.arange(len(rows)), [len(one) for one in near]),
        ends,
        *(np.array(every[name]) for name in fields),
    )


def differences(found: Floats, tolerance: float) -> dict[str, float]:
    """Tally of distances that were measured twice [m]."""
    return {
        "compared": len(found),
        "off": float(found.max(initial=0.0)),
        "tolerance": tolerance,
        "disagree": int((~(found <= tolerance)).sum()),
    }


def sides(
    clear: Bools, headroom: Floats, below: float = SAME, above: float = SAME
) -> dict[str, float]:
    """Tally of answers "clear" or not, by the guard's headroom.

    Args:
        clear: The answers.
        headroom: Least distance beyond the buffer, by the guard [m].
        below: What is called clear may be so much nearer than its buffer [m].
        above: What is not called clear may be so much farther [m].
    """
    lacks, spare = -headroom[clear], headroom[~clear]
    return {
        "clear": len(lacks),
        "below": float(lacks.max(initial=0.0)),
        "may_be_below": below,
        "near": len(spare),
        "above": float(spare.max(initial=0.0)),
        "may_be_above": above,
        "disagree": int((~(lacks <= below)).sum() + (~(spare <= above)).sum()),
    }


def compared(ways: Ways, rows: Floats, rng: np.random.Generator) -> dict[str, Any]:
    """Compare the answers of all ways with those of the guard.

    Args:
        ways: The ways.
        rows: States, shape (k, n) [rad or m].
        rng: Source of the random lines through them.
    """
    judged = judged_states(ways.guard, rows)
    headroom = judged.least(judged.distance - judged.buffer)
    distances: Tallies = {
        "checker, near pairs": near_pairs(ways, rows, judged),
        "checker, nearest": nearest(ways, rows, judged),
        "joint-space table": omitted(ways, rows, judged),
        **coal_distances(ways, rows, judged),
    }
    answers: Tallies = {
        "guard, level": sides(judged.clear, headroom),
        "checker": sides(ways.checker.clear(rows), headroom),
        "region octrees": in_trees(ways, rows, judged),
        "map": on_maps(ways, rows, headroom, rng),
    }
    answers["plan, by pair"], least = on_plans(ways, rows, judged, rng)
    if least["compared"]:
        distances["plan, nearest"] = least
    return {
        "states": len(rows),
        "border": int((np.abs(headroom) <= 1e-3).sum()),
        "distances": distances,
        "answers": answers,
    }


def near_pairs(ways: Ways, rows: Floats, judged: Judged) -> dict[str, float]:
    """Distances of all near pairs of primitives; one that lacks is off by its rest."""
    margin, count = ways.tables.margin, len(ways.tables.kinds)
    found = ways.checker.near(rows, margin)
    known: dict[int, list[float]] = {}
    theirs = np.column_stack((found.a, found.b))
    for row, ends, distance in (
        (judged.row, judged.ends, judged.outer),
        (found.row, theirs, found.distance),
    ):
        code = (row * count + ends.min(axis=1)) * count + ends.max(axis=1)
        for key, value in zip(code.tolist(), distance.tolist(), strict=True):
            known.setdefault(key, []).append(value)
    off = [abs(v[0] - (v[1] if len(v) > 1 else margin)) for v in known.values()]
    return differences(np.array(off), SAME)


def nearest(ways: Ways, rows: Floats, judged: Judged) -> dict[str, float]:
    """Least distances within the margin."""
    margin = ways.tables.margin
    theirs = ways.checker.distances(rows, margin).distance
    mine = judged.least(judged.outer)
    off = np.abs(np.minimum(mine, margin) - np.minimum(theirs, margin))
    return differences(off, SAME)


def omitted(ways: Ways, rows: Floats, judged: Judged) -> dict[str, float]:
    """Near pairs of a link and an object; one that the table omits is off."""
    still = np.isin(judged.ends[:, 1], ways.table.cells.columns)
    off = []
    for k, q in enumerate(rows):
        ways.table.locate(q)
        own = np.flatnonzero(still & (judged.row == k))
        for i in np.unique(judged.ends[own, 0]).tolist():
            pairs = own[judged.ends[own, 0] == i]
            kept = np.isin(judged.ends[pairs, 1], ways.table.candidates(i))
            left = ways.tables.margin - judged.outer[pairs]
            off += np.where(kept, 0.0, left).tolist()
    return differences(np.array(off), SAME)


def coal_distances(ways: Ways, rows: Floats, judged: Judged) -> Tallies:
    """Distances of near pairs by Coal: of primitives, and of exact shapes."""
    coal, first = ways.coal, len(ways.tables.kinds)
    of, off = ways.tables.exact.of_primitive, []
    exact_off, last = [], -1

    def shapes(i: int) -> Iterable[int]:
        start, count = of[i].tolist()
        return range(first + start, first + start + count) if count else (i,)

    for k, row in enumerate(judged.row.tolist()):
        if row != last:
            coal.move(rows[row])
            last = row
        i, j = judged.ends[k].tolist()
        off.append(abs(coal.distance(i, j) - judged.outer[k]))
        if judged.exact[k] < inf:
            every = (coal.distance(a, b) for a in shapes(i) for b in shapes(j))
            exact_off.append(abs(min(every) - judged.exact[k]))
    found = {"Coal, primitives": differences(np.array(off), ACCURACY)}
    if exact_off:
        found["Coal, exact shapes"] = differences(np.array(exact_off), ACCURACY)
    return found


def in_trees(ways: Ways, rows: Floats, judged: Judged) -> dict[str, float]:
    """States clear of all objects by region octrees: primitives against cells."""
    still = judged.ends[:, 1] >= ways.tables.moving_count
    headroom = judged.least(judged.outer - judged.buffer, still)
    diagonal = np.sqrt(3.0) * CELL
    return sides(ways.trees.compare(rows).clear, headroom, SAME, diagonal + ACCURACY)


def line_through(q: Floats, rng: np.random.Generator) -> Floats:
    """Two rows of a line on which a state is at SHARE, shape (2, n) [rad or m]."""
    way = rng.normal(size=len(q))
    way *= WAY / np.abs(way).sum()
    return np.stack((q - SHARE * way, q + (1.0 - SHARE) * way))


def plan_of(ways: Ways, rows: Floats) -> ag.Plan:
    """A plan of a second along a line."""
    times, names = np.array([0.0, 1.0]), ways.scene.q_names
    return ag.Plan.of(ag.Trajectory(names, rows, times, "a line"), ways.scene)


def on_plans(
    ways: Ways, rows: Floats, judged: Judged, rng: np.random.Generator
) -> tuple[dict[str, float], dict[str, float]]:
    """Proofs of lines: links that are too near at the state, and least distances."""
    names = np.array(ways.tables.body_names)
    per_link: list[dict[Pair, float]] = [{} for _ in rows]
    for row, ends, spare in zip(
        judged.row, judged.ends, judged.distance - judged.buffer, strict=True
    ):
        pair = pair_of(*names[ends].tolist())
        per_link[row][pair] = min(per_link[row].get(pair, inf), float(spare))
    reach = WAY * float(ways.coal.levers.max())
    least = judged.least(judged.outer)
    by_primitives = not ways.tables.exact.of_primitive[:, 1].any()
    clear, spares, off = [], [], []
    for k, q in enumerate(rows):
        tube = plan_of(ways, line_through(q, rng)).tube
        paving = ways.paver.pave(tube, RESOLUTION)
        near = {
            pair_of(one.nearest.a, one.nearest.b)
            for one in ways.paver.intervals(paving, tube, RESOLUTION)
            if one.start <= SHARE <= one.end
        }
        for pair in near | per_link[k].keys():
            clear.append(pair not in near)
            spares.append(per_link[k].get(pair, inf))
        # With exact shapes the least distance of two links is another one.
        if by_primitives and least[k] < inf:
            place, exact = ways.paver.least(tube), float(least[k])
            found = nan if place is None else place.distance
            loose = DEEP * max(-exact, 0.0)
            off.append(max(found - exact - loose, exact - reach - found, 0.0))
    width = reach * RESOLUTION + ROUNDING
    answers = sides(np.array(clear), np.array(spares), ROUNDING, width)
    return answers, differences(np.array(off), TOLERANCE)


def pair_of(a: str, b: str) -> Pair:
    """Names of two links in their order."""
    return (a, b) if a < b else (b, a)


def on_maps(
    ways: Ways, rows: Floats, headroom: Floats, rng: np.random.Generator
) -> dict[str, float]:
    """Maps of both robots' lines: whether both may be at the state together."""
    own = {
        robot: np.array([n.startswith(f"{robot}/") for n in ways.scene.q_names])
        for robot in ROBOTS
    }
    clear = []
    for q in rows:
        line, plans = line_through(q, rng), {}
        for robot, joints in own.items():
            alone = np.where(joints, line, q)
            plans[robot] = CellPlan(plan_of(ways, alone))
        found = ways.coordinator.map(plans, resolution=FINEST)
        near = [
            one
            for intervals in found.alone.values()
            for one in intervals
            if one.start <= SHARE <= one.end
        ]
        clear.append(found.allowed(SHARE, SHARE) and not near)
    # A tile that is too small to be halved, and the cells of the grid that it meets.
    width = 2.0 * FINEST * WAY * float(ways.coal.levers.max())
    return sides(np.array(clear), headroom, ROUNDING, width)


def asked(name: str, seed: int, count: int = STATES) -> dict[str, Any]:
    """States of a scene, asked in all ways."""
    ways, rng = ways_of(name), np.random.default_rng([seed, 77])
    return compared(ways, random_states(ways.checker, count, rng), rng)


def summed_answers(episodes: list[Figures]) -> Figures:
    """Figures of some episodes."""
    found: Figures = {"episodes": len(episodes)}
    for episode in episodes:
        own = {key: value for key, value in episode.items() if key != "seed"}
        found = merged(found, own, EXTREME)
    return found


def disagreements(figures: Figures) -> int:
    """Answers that differ from those of the guard by more than they may."""
    every = [figures.get(key, {}).values() for key in ("distances", "answers")]
    return sum(int(tally["disagree"]) for part in every for tally in part)
