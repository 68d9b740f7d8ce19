"""Words about cells, and how far space is known free."""

import numpy as np
import pytest

from armguard.cells.deltas import Delta
from armguard.errors import CellMapError, UnknownNameError
from armguard.record import records
from armguard.respond import Guard
from sensed import CELL, LOW, changes, feed, grid, sensed_guard, sensed_scene

CELL_AT = (45, 32, 33)


def judged(unknown, occupied, hidden, **of):
    guard = sensed_guard(unknown, margin=0.4)
    feed(guard, changes(occupied, hidden, 0.0, **of), 0.0)
    still = np.zeros(len(guard.home))
    guard.step(guard.home, 0.01, velocity=still)
    return guard, guard.step(guard.home, 0.014, velocity=still)


def one(at=CELL_AT):
    cells = grid()
    cells[at] = True
    return cells


def test_a_sentence_names_what_was_sensed_its_age_and_its_place():
    _, verdict = judged("free", one(), grid())
    pair = min((p for p in verdict.near if p.sensed), key=lambda p: p.distance)
    x, y, z = pair.point_b
    assert pair.b == "something sensed"
    assert pair.sensed.age == pytest.approx(0.014, abs=1e-12)
    says = f"from something sensed 14 ms ago at ({x:.2f}, {y:.2f}, {z:.2f}): headroom"
    assert says in pair.why
    assert abs(x - (LOW[0] + CELL * CELL_AT[0])) < 1e-9


def test_a_sentence_names_the_sensor():
    scene = sensed_scene("free", margin=0.4)
    for name in ("top", "side"):
        scene.add_sensor(name, kind="tof")
    guard = Guard(scene, self_test=False)
    still = np.zeros(len(guard.home))
    for source, by in ((0, ""), (1, " by top"), (2, " by side"), (255, "")):
        guard.reset()
        found = changes(one(), grid(), 0.01 * source)
        found["source"] = source
        feed(guard, found, 0.01 * source)
        guard.step(guard.home, 0.01 * source + 0.01, velocity=still)
        verdict = guard.step(guard.home, 0.01 * source + 0.014, velocity=still)
        pair = min((p for p in verdict.near if p.sensed), key=lambda p: p.distance)
        assert pair.sensed.sensor == (by[4:] or None)
        assert f"from something sensed{by} 14 ms ago at (" in pair.why


def test_a_sentence_names_space_that_is_not_known_free():
    guard, verdict = judged("moving", grid(), one())
    pair = min((p for p in verdict.near if p.sensed), key=lambda p: p.distance)
    assert "mm from space not known free at (" in pair.why
    # Its way since the map's stamp is a term of its own, and the terms add up.
    nearest = verdict.nearest
    if nearest.sensed:
        budget = verdict.budget
        assert budget.object >= 1.6 * 0.014
        assert budget.needed == pytest.approx(nearest.needed, abs=1e-9)
    else:
        assert guard.tables.sensing.intruder.speed == 1.6


def test_the_way_known_free_ends_at_a_cell():
    wall = grid()
    wall[50] = True
    guard, _ = judged("free", wall, grid())
    rows = guard._workspace.world.boxes[: guard.tables.moving_count]
    names = np.array(guard.tables.body_names[: guard.tables.moving_count])
    face = LOW[0] + 50 * CELL
    reach = rows[names == "arm/panda_hand", 3].max()
    known = guard.knowledge("arm/panda_hand", (2.0, 0.0, 0.0))
    assert (known.ends_at, known.stamp) == ("something sensed", 0.0)
    assert face - reach - 0.02 < known.distance <= face - reach + 1e-3
    back = guard.knowledge("arm/panda_hand", (-1.0, 0.0, 0.0))
    assert (back.distance, back.ends_at) == (5.0, None)


def test_unknown_space_and_the_border_of_the_region_end_it():
    hidden = grid()
    hidden[:, :, 55:] = True
    guard, _ = judged("still", grid(), hidden)
    up = guard.knowledge("arm/panda_hand", (0.0, 0.0, 1.0))
    assert up.ends_at == "space not known free"
    boxes = guard._workspace.world.boxes[: guard.tables.moving_count]
    names = np.array(guard.tables.body_names[: guard.tables.moving_count])
    top = boxes[names == "arm/panda_hand", 5].max()
    assert up.distance <= LOW[2] + 55 * CELL - top + 1e-3
    side = guard.knowledge("arm/panda_hand", (0.0, 1.0, 0.0))
    assert side.ends_at == "space not known free"
    far = boxes[names == "arm/panda_hand", 4].max()
    assert side.distance == pytest.approx(LOW[1] + 64 * CELL - far, abs=1e-9)
    guard.update_cells(records(0, Delta), 0.02)
    assert guard.knowledge("arm/panda_hand", (0.0, 1.0, 0.0)).stamp == 0.02


def test_what_is_no_way_is_refused():
    guard, _ = judged("free", grid(), grid())
    with pytest.raises(CellMapError, match="not all 0"):
        guard.knowledge("arm/panda_hand", (0.0, 0.0, 0.0))
    with pytest.raises(CellMapError, match="three numbers"):
        guard.knowledge("arm/panda_hand", (1.0, np.nan, 0.0))
    with pytest.raises(UnknownNameError, match="did you mean 'arm/panda_hand'"):
        guard.knowledge("arm/panda_hnd", (1.0, 0.0, 0.0))
