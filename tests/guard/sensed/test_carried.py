"""A block that a gripper takes away claims its cells where it is, in each cycle."""

import numpy as np
import pytest

from armguard.cells.deltas import Delta
from armguard.guard import Level
from armguard.record import records
from grippers import BLOCK, Loop, guard_of, pick_scene
from sensed import changes, feed, grid

CELL, SIZE, CENTRE = 0.02, 256, (0.0, 0.0, 0.5)
LOW = np.array(CENTRE) - 0.5 * SIZE * CELL
NONE = records(0, Delta)


class SensedLoop(Loop):
    """A loop whose map is confirmed in each cycle."""

    def cycle(self, desired):
        self.guard.update_cells(NONE, self.t)
        return super().cycle(desired)


def cells_of(middle):
    """Cells that the block meets where its middle is."""
    first = np.floor((middle - BLOCK - LOW) / CELL).astype(int)
    end = np.ceil((middle + BLOCK - LOW) / CELL).astype(int)
    found = grid(SIZE)
    found[tuple(slice(*ends) for ends in zip(first, end, strict=True))] = True
    return found


def sensed_pairs(verdict):
    return [pair for pair in verdict.near if pair.b == "something sensed"]


@pytest.fixture(scope="module")
def loop():
    scene = pick_scene()
    scene.set_sensing(
        region={"centre": CENTRE, "size": SIZE},
        cell=CELL,
        unknown="free",
        reason="a test",
        intruder={"speed": 0.0, "size": 0.05},
    )
    return SensedLoop(guard_of(scene))


def test_a_block_is_gripped_and_carried_among_its_own_cells(loop):
    guard = loop.guard
    on_table = np.array([0.0, 0.0, BLOCK[2]])
    feed(guard, changes(cells_of(on_table), grid(SIZE), 0.0), 0.0)
    assert loop.go({"arm/z": 0.1}, speed=0.08)
    assert loop.go({"arm/open_left": 0.02, "arm/open_right": 0.02}, speed=0.02)
    assert not sensed_pairs(loop.commands[-1].verdict)
    guard.grasp("arm", "block")
    assert loop.go({"arm/z": 0.4})
    # Its cells are where it is now; those on the table were seen to be free.
    rows = guard._workspace.world.rows
    middle = rows[guard.tables.holds.places["block"][0], 1:4].copy()
    assert middle[2] > 0.25
    feed(guard, changes(cells_of(middle), grid(SIZE), loop.t), loop.t)
    still = np.zeros(len(loop.q))
    verdict = loop.cycle(still).verdict
    assert not sensed_pairs(verdict)
    assert verdict.level < Level.STOP
    # The same cells beside the block are an obstacle.
    aside = middle + np.array([0.0, 0.0, -0.09])
    feed(guard, changes(cells_of(aside), grid(SIZE), loop.t), loop.t)
    assert sensed_pairs(loop.cycle(still).verdict)
