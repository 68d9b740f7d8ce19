"""A sample of `make motion`: lines past thin bodies, and times to contact."""

import numpy as np
import pytest

from armguard.respond import Guard
from closed_loop.scenes import build_scene
from motions.clocks import FAULTS, SETTING, noticed
from motions.contact_time import Bay, state_rows, summed_up
from motions.thin import GRAIN, ThinWorld, check_lines


@pytest.mark.parametrize("needle", [False, True])
def test_no_line_past_a_thin_body_is_called_clear_that_touches_it(needle):
    world, rng = ThinWorld(0.0, needle), np.random.default_rng(11)
    found = check_lines(world, [world.draw(rng) for _ in range(100)])
    touching = found.touching(0.0)
    assert 20 < touching.sum() < 90
    assert not (touching & found.clear).any()
    assert (found.clear | (found.least <= world.resolution)).all()


def least_at(world, q):
    world.judge.place(q)
    return world.judge.gaps().min()


def test_the_judge_of_lines_finds_what_dense_samples_find():
    world, rng = ThinWorld(0.0, True), np.random.default_rng(2)
    for _ in range(6):
        line = world.draw(rng)
        world.stand(line.frames)
        least = world.judge.least_on_line(line.start, line.end, 0.0, GRAIN)
        rows = np.linspace(line.start, line.end, 200)
        dense = min(least_at(world, q) for q in rows)
        apart = float(world.judge.reach @ np.abs(rows[1] - rows[0]))
        assert (least < 0.0) == (dense < 0.0) or abs(dense) < apart
        if least > 0.0:
            assert dense - apart <= least <= dense + GRAIN


def test_no_time_to_contact_is_reported_too_long():
    bay, rng = Bay(), np.random.default_rng(5)
    rows = [row for _ in range(4) for row in state_rows(bay, rng)]
    found = summed_up(rows)
    assert found["motions"] >= 400
    assert found["told_too_long"] == 0
    assert found["share_p95"] <= 1.0


def test_a_fault_of_time_is_answered_in_the_cycle_that_breaks_a_figure():
    guard = Guard(build_scene(SETTING), self_test=False)
    for fault in FAULTS[:4]:
        cycles, _ = noticed(guard, fault)
        assert cycles == fault.breaks, fault.name
