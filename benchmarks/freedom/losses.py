"""Why motion is lost to cells, and which stops were needless, judged in the true world.

Each loss has the class of the cell that is nearest to the witness point of the pair in
the way; `Sight` says who could have seen it. A stop is needless if the motion under
way, and then a stop at the declared deceleration, would have kept the guard's buffer to
all that is there.
"""

from typing import Any

import numpy as np

import armguard as ag
from armguard.cells.view import CellView
from armguard.scene.compile import compile_scene
from arrays import Bools, Floats, Ints
from closed_loop.judge import Judge
from episodes.follower import Follower
from freedom.sight import Frame, Seen, Sight

# Cells on each side of a witness point among which the nearest one is looked for.
ABOUT = np.stack(np.meshgrid(*[np.arange(-2, 3)] * 3), axis=-1).reshape(-1, 3)

# From a cell to one of its word and of each word beside it [cells].
BESIDE = 4 * np.stack(np.meshgrid(*[np.arange(-1, 2)] * 3), axis=-1).reshape(-1, 3)

# What a box may be off its cell, beside the error of the cell [m].
ROUNDED = 1e-4

# Postures of a stop that are looked at.
STEPS = 24


class Losses:
    """Causes of losses by cells in a run.

    Args:
        scene: The scene with the sensors.
        world: The scene with all that is there.
        cells: The map.
        frames: The frames that come; it grows.
    """

    def __init__(
        self, scene: ag.Scene, world: ag.Scene, cells: CellView, frames: list[Frame]
    ) -> None:
        assert scene.sensing is not None
        self._frames = frames
        self._sight = Sight(scene, world, scene.sensing.intruder.size)
        self._judge = Judge(world, compile_scene(world))
        self._cells, self._buffer = cells, scene.buffer
        self._known: dict[tuple[int, ...], tuple[int, Seen]] = {}

    def of_point(self, point: Floats, occupied: bool) -> str:
        """Class of the cells at the witness point of a pair.

        Args:
            point: The point, world, shape (3,) [m].
            occupied: Whether they are occupied; else they are not known free.
        """
        cells, edge = self._cells, self._cells.cell
        low = cells.centre - 0.5 * edge * cells.size
        places = np.floor((point - low) / edge).astype(np.int64) + ABOUT
        places = places[((places >= 0) & (places < cells.size)).all(axis=1)]
        claims = cells.claims
        bits = claims.occupied.words if occupied else claims.unknown.words
        words, set_ = members(places, bits, cells.size // 64)
        places, errors = places[set_], claims.error[words[set_]]
        if not occupied:
            # Errors of the words beside count, too.
            near = np.clip(places[:, None] + BESIDE, 0, cells.size - 1)
            words, _ = members(near.reshape(-1, 3), bits, cells.size // 64)
            errors = claims.error[words].reshape(-1, len(BESIDE)).max(axis=1)
        middles = cells.middles(places)
        away = np.maximum(np.abs(point - middles) - 0.5 * edge, 0.0)
        gaps = np.linalg.norm(away, axis=1) - errors
        nearest = int(gaps.argmin()) if len(gaps) else -1
        if nearest < 0 or gaps[nearest] > ROUNDED:
            return "coarser than cells"
        cell = middles[nearest]
        if self._sight.fills(cell, edge):
            return "in a foreign object"
        if occupied:
            return "occupied, and nothing is in the cell"
        key = tuple(places[nearest].tolist())
        count, best = self._known.get(key, (0, Seen()))
        found = [self._sight.seen(cell, edge, frame) for frame in self._frames[count:]]
        best = max(best, *found) if found else best
        self._known[key] = len(self._frames), best
        return str(best)

    def is_needless(self, plant: Follower, arm: str) -> bool:
        """Whether an arm could have moved on for a cycle, and stopped then.

        Args:
            plant: The true state.
            arm: The arm.
        """
        own, figures = plant.own[arm], plant.figures[arm]
        late = figures.command + figures.sensing + 2.0 * plant.period
        v = np.zeros_like(plant.v)
        v[own] = plant.v[own]
        brake = plant.joined("deceleration")
        return least_on_way(self._judge, arm, plant.q, v, late, brake) > self._buffer


def least_on_way(
    judge: Judge, arm: str, q: Floats, v: Floats, late: float, brake: Floats
) -> float:
    """Least true distance of an arm while it goes on for a time, and then stops [m].

    Args:
        judge: The true world.
        arm: The arm.
        q: Joint positions, shape (n,) [rad or m].
        v: Joint velocities, shape (n,) [rad/s or m/s].
        late: How long it goes on [s].
        brake: Decelerations, shape (n,) [rad/s² or m/s²].
    """
    until = late + float((np.abs(v) / brake).max())
    least = np.inf
    for t in np.linspace(0.0, until, STEPS):
        braked = np.minimum(np.maximum(t - late, 0.0), np.abs(v) / brake)
        way = v * (min(t, late) + braked) - np.sign(v) * 0.5 * brake * braked**2
        distances, geoms = judge.measure(q + way)
        mine = [
            any(judge.owners[g].startswith(f"{arm}/") for g in pair)
            for pair in geoms.tolist()
        ]
        least = min(least, float(distances[mine].min(initial=np.inf)))
    return least


def members(places: Ints, bits: Any, blocks: int) -> tuple[Ints, Bools]:
    """Words of cells, and whether the cells are set.

    Args:
        places: Places of cells along x, y and z, shape (n, 3).
        bits: Words with cells.
        blocks: Blocks along an edge of the map.
    """
    four, sides = np.array([1, 4, 16]), np.array([1, blocks, blocks**2])
    words = (places // 64) @ sides
    for side in (16, 4):
        words = 64 * words + (places // side % 4) @ four
    bit = (places % 4) @ four
    return words, (bits[words] >> bit.astype(np.uint64) & np.uint64(1)) != 0
