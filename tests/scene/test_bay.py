"""The bay's files: what they hold, and what is claimed of them.

The judge is `benchmarks/bay_oracle.py`: pinocchio for poses, coal for distances.
"""

from importlib import import_module
from itertools import product
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from armguard.errors import UnknownNameError
from armguard.geometry.shapes import Capsule, ShapeKind
from armguard.scene.bay import TASKS, bay_path, bay_scene, bay_task
from armguard.scene.compile import compile_scene

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"

# coal's distance of capsules and boxes against ours [m].
COAL_ATOL = 1e-6


@pytest.fixture(scope="module")
def maker() -> Any:
    """The script that makes the tasks."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(BENCHMARKS))
        yield import_module("make_bay_tasks")


@pytest.fixture(scope="module")
def oracle(maker: ModuleType) -> Any:
    """The bay as pinocchio and coal see it."""
    return maker.BayOracle()


def test_35_primitives_14_of_them_moving() -> None:
    tables = compile_scene(bay_scene())
    assert len(tables.kinds) == 35
    assert tables.moving_count == 14
    kinds = [ShapeKind(kind) for kind in tables.kinds]
    assert kinds[:14] == [ShapeKind.CAPSULE] * 14
    assert {kind: kinds[14:].count(kind) for kind in set(kinds[14:])} == {
        ShapeKind.SPHERE: 1,
        ShapeKind.CAPSULE: 9,
        ShapeKind.BOX: 11,
    }


def test_595_pairs_less_static_adjacent_and_allowed_are_checked(oracle: Any) -> None:
    tables = compile_scene(bay_scene())
    assert (oracle.adjacent, oracle.allowed) == (12, 2)
    assert tables.checkable_pairs == len(oracle.pairs) == 595 - 210 - 12 - 2


def test_every_moving_link_is_exactly_one_capsule() -> None:
    for robot in bay_scene().robots.values():
        assert list(robot.fits) == [f"link{k}" for k in range(1, 8)]
        for fit in robot.fits.values():
            (placed,) = fit.shapes
            assert isinstance(placed.shape, Capsule)
            assert placed.model_error == 0.0


def test_index_cube_is_the_closed_bay_and_holds_all_of_it(oracle: Any) -> None:
    tables = compile_scene(bay_scene())
    assert tables.cube_edge == 2.56
    low, high = oracle.bounds(oracle.home)
    assert (low >= tables.cube_centre - 1.28).all()
    assert (high <= tables.cube_centre + 1.28).all()


def test_nothing_is_within_80_mm_at_home(oracle: Any) -> None:
    assert oracle.nearest(oracle.home).distance >= 0.080
    np.testing.assert_array_equal(bay_scene().home, oracle.home)


@pytest.mark.parametrize("joint", [2, 4, 6])
def test_links_two_apart_keep_80_mm_within_the_limits(oracle: Any, joint: int) -> None:
    """The URDF says so; only the pitch joint between them can change it."""
    lower = oracle.model.lowerPositionLimit[joint - 1]
    upper = oracle.model.upperPositionLimit[joint - 1]
    ends = {f"left/link{joint - 1}", f"left/link{joint + 1}"}
    for position in np.linspace(lower, upper, 41):
        q = oracle.home.copy()
        q[joint - 1] = position
        (pair,) = (p for p in oracle.measure(q) if {p.a, p.b} == ends)
        assert pair.distance >= 0.080


@pytest.mark.parametrize("cycles", TASKS)
def test_task_is_made_of_its_keyframes_to_the_last_byte(
    maker: ModuleType, oracle: Any, cycles: int
) -> None:
    q = maker.configurations(oracle.home, maker.TASKS[cycles])
    text = maker.csv_text(oracle.joint_names, q)
    assert bay_path().with_name(f"task_{cycles}.csv").read_bytes() == text.encode()


@pytest.mark.parametrize("cycles", TASKS)
def test_task_fits_the_scene(cycles: int) -> None:
    scene, task = bay_scene(), bay_task(cycles)
    q = task.for_scene(scene)
    assert q.shape == (cycles, 14)
    np.testing.assert_array_equal(q[0], scene.home)
    assert task.stamps is not None
    np.testing.assert_allclose(np.diff(task.stamps), 0.030, atol=1e-12)


@pytest.mark.parametrize("cycles", [150, 700])
def test_claims_of_a_task_hold(maker: ModuleType, oracle: Any, cycles: int) -> None:
    """Limits, speeds, approaches; `make_bay_tasks.py --check` adds the long task."""
    findings = maker.Findings(oracle, bay_task(cycles).q)
    assert findings.wrong == []


def test_profile_goes_from_rest_to_rest(maker: ModuleType) -> None:
    u = np.linspace(0.0, 1.0, 1001)
    way = np.array([maker.trapezoid(v) for v in u])
    assert way[0] == 0.0
    assert way[-1] == 1.0
    speed = np.diff(way) / np.diff(u)
    assert speed.min() >= 0.0
    assert speed.max() == pytest.approx(1.0 / (1.0 - maker.RAMP))
    assert speed[0] == pytest.approx(0.0, abs=0.01)
    assert speed[-1] == pytest.approx(0.0, abs=0.01)


def test_a_length_without_a_task_is_refused() -> None:
    with pytest.raises(UnknownNameError, match="there are 150, 700, 2000"):
        bay_task(151)


def test_guard_sees_the_near_pairs_the_oracle_sees(oracle: Any) -> None:
    from armguard import Guard

    scene = bay_scene()
    guard = Guard(scene)
    seen = 0
    for cycles, start in product(TASKS, (0, 7)):
        for q in bay_task(cycles).q[start::31]:
            near = guard.step(q).near
            expected = sorted(
                p.distance for p in oracle.measure(q) if p.distance <= scene.margin
            )
            np.testing.assert_allclose(
                sorted(p.distance for p in near), expected, atol=COAL_ATOL
            )
            seen += len(near)
    assert seen > 0
