"""`check_path` among sensed cells, beside the same cells as boxes of the scene."""

import numpy as np
import pytest

from armguard.guard.continuous import RESOLUTION
from sensed import PERIOD, SIZE, at, boxed_guard, changes, feed, grid, sensed_guard

COUNT, LINES = 12, 60

# The arm at home, and the same with its hand 0.2 m elsewhere.
SHIFT = np.array([0.3, 0.2, 0.0, -0.2, 0.0, 0.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def guards():
    return sensed_guard(budget=1 << 20), boxed_guard(COUNT)


def around(rng, guard, line):
    """Places of cells, each in a word that no other one is in, near a line's middle."""
    guard.judge_at_rest(line.mean(axis=0))
    rows = guard._workspace.world.rows[: guard.tables.moving_count]
    found = {}
    while len(found) < COUNT:
        point = rows[rng.integers(2, len(rows)), 1:4] + rng.normal(0.0, 0.5, 3)
        cell = np.floor((point - at((0, 0, 0)).xyz) / 0.05 + 0.5).astype(int)
        if (cell >= 0).all() and (cell < SIZE).all() and at(cell).xyz[2] > 0.3:
            found.setdefault(tuple(cell // 4), tuple(cell))
    return list(found.values())


def test_lines_among_cells_are_judged_as_among_boxes(guards):
    sensed, boxed = guards
    rng, clear = np.random.default_rng(5), 0
    nothing = grid()
    for k in range(LINES):
        start = sensed.home + rng.uniform(-0.5, 0.5, len(sensed.home))
        line = np.clip(
            [start, start + rng.uniform(-0.2, 0.2, len(start))],
            sensed.tables.lower, sensed.tables.upper,
        )  # fmt: skip
        occupied = grid()
        for number, cell in enumerate(around(rng, sensed, line)):
            occupied[cell] = True
            boxed.place(f"cell{number}", at(cell))
        feed(sensed, changes(occupied, nothing, float(k)), float(k))
        ours, theirs = sensed.check_path(line), boxed.check_path(line)
        assert ours.clear == theirs.clear
        assert sensed.check_path(line, sensed=False).clear or not ours.clear
        clear += ours.clear
        if not ours.clear and theirs.breach.certain:
            longest = np.abs(line[1] - line[0]).max()
            late = (ours.breach.share - theirs.breach.share) * longest
            assert abs(late) <= RESOLUTION
    assert 0.2 * LINES < clear < 0.8 * LINES


def test_a_line_through_space_not_known_free_is_not_clear():
    guard = sensed_guard(unknown="still")
    line = [guard.home, guard.home + SHIFT]
    assert guard.check_path(line, sensed=False).clear
    found = guard.check_path(line)
    assert not found.clear
    assert "not known free" in found.sentence
    nothing = grid()
    feed(guard, changes(nothing, nothing, 1.0), 1.0)
    assert guard.check_path(line).clear


def test_a_path_among_cells_leaves_the_loop_as_it_was():
    guard = sensed_guard()
    occupied = np.random.default_rng(2).random((SIZE,) * 3) < 0.02
    feed(guard, changes(occupied, grid(), 1.0), 1.0)
    line = [guard.home, guard.home + SHIFT]
    assert not guard.check_path(line).clear
    answers = []
    for paths in (0, 2):
        guard.reset()
        answers.append([])
        for k in range(3):
            for _ in range(paths):
                guard.check_path(line)
                guard.check_path(line, sensed=False)
            q, v = guard.home + 0.002 * k * SHIFT, 0.002 / PERIOD * SHIFT
            verdict = guard.step(q, 1.0 + k * PERIOD, velocity=v)
            answers[-1].append(verdict.tobytes())
    assert any(pair.b == "something sensed" for pair in verdict.near), verdict.why
    assert answers[0] == answers[1]
