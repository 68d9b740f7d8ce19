"""Bounds are bounds: no point of a link moves farther than its levers say."""

import numpy as np
import pytest

from armguard import bay_scene
from armguard.address import array_at, stack
from armguard.geometry import HalfSpace
from armguard.geometry.place import place_row
from armguard.geometry.shapes import shape_row
from armguard.kernel import kernel
from armguard.motion import displacement_bounds
from armguard.motion.side_reach import half_space_reach
from armguard.robot.kinematics import forward_kinematics
from armguard.scene import Scene
from armguard.scene.compile import compile_scene

SAMPLES = 20_000


@kernel(entry=True)
def capsule_moves(before, after, tables, kinds, bodies, local, poses, out):
    """Way of two points of each primitive between two positions, shape (k, m, 2)."""
    rows = array_at(stack(32), (2, 16), np.float64)
    T0, T1, a, b = poses[0], poses[1], rows[0], rows[1]
    for s in range(len(before)):
        for T, x in ((T0, before[s]), (T1, after[s])):
            forward_kinematics(
                x, tables[0], tables[1], tables[2], tables[3], tables[4], tables[5], T
            )
        for i in range(len(kinds)):
            place_row(kinds[i], local[i], T0[bodies[i]], a)
            place_row(kinds[i], local[i], T1[bodies[i]], b)
            for end in range(2):
                at = 1 + 3 * end if kinds[i] == 1 else 1
                total = 0.0
                for k in range(3):
                    total += (b[at + k] - a[at + k]) ** 2
                out[s, i, end] = np.sqrt(total)


def moves(scene, seed, largest):
    """Measured ways and bounds of all moving primitives, each shape (k, m)."""
    tables = compile_scene(scene)
    rng = np.random.default_rng(seed)
    low = np.maximum(tables.lower, -np.pi)
    high = np.minimum(tables.upper, np.pi)
    m = tables.moving_count
    count = SAMPLES // 14 * 50
    q = rng.uniform(low, high, (count, len(low)))
    dq = rng.uniform(-1, 1, q.shape) * largest * rng.random((count, 1))
    # Often one joint alone, where a bound is tight.
    dq[rng.random(q.shape) < 0.5] = 0.0
    dq = np.clip(q + dq, low, high) - q
    out = np.zeros((count, m, 2))
    flat = (
        tables.parent, tables.joint_kind, tables.q_index, tables.gain,
        tables.T_parent_joint, tables.axis,
    )  # fmt: skip
    poses = np.zeros((2, len(tables.parent), 12))
    capsule_moves(
        q, q + dq, flat, tables.kinds[:m], tables.bodies[:m], tables.local_rows[:m],
        poses, out,
    )  # fmt: skip
    bounds = displacement_bounds(tables, dq)
    return out.max(axis=2), bounds


@pytest.mark.parametrize("name", ["bay", "panda"])
def test_displacement_never_exceeds_the_bound(name, capsys):
    if name == "bay":
        scene = bay_scene()
    else:
        scene = Scene(mode="fixed")
        scene.add_robot("panda", name="left")
    measured, bounds = moves(scene, 3, 0.4)
    assert measured.size >= 500_000
    assert (measured <= bounds + 1e-12).all()
    moved = measured > 1e-6
    loose = bounds[moved] / measured[moved]
    with capsys.disabled():
        print(
            f"\n{name}: {measured.size} displacements, bound / measured: median "
            f"{np.median(loose):.2f}, 90 % {np.percentile(loose, 90):.2f}"
        )


@kernel(entry=True)
def plane_reach(row, x, y, z):
    return half_space_reach(row, (x, y, z))


def test_a_plane_is_bounded_along_its_own_normal_only_however_far_away():
    """A million metres away an angle of a microradian would be a metre."""
    far = 1e6
    row = np.zeros(16)
    place_half_space(row, far)
    tilt = 0.3
    outward = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    # A point on the plane, far along it: what it has left is nothing.
    along = np.array([np.cos(tilt), 0.0, -np.sin(tilt)])
    point = row[1:4] + far * along
    for angle in (0.0, 1e-12, 1e-9, 1.4e-6, 1e-3):
        n = np.cos(angle) * outward + np.sin(angle) * along
        reach = plane_reach(row, *n)
        # Distance of the point beyond the plane along n: never more than it is.
        gap = n @ point - reach
        assert gap <= 1e-8
    exact = plane_reach(row, *outward)
    assert exact == pytest.approx(outward @ row[1:4], rel=1e-15)
    off = outward + np.array([1e-16, 0.0, -1e-16])
    assert plane_reach(row, *off) == exact


def place_half_space(row, far):
    """A tilted half-space whose surface passes a million metres from the origin."""
    tilt = 0.3
    turn = np.array(
        [
            [np.cos(tilt), 0.0, np.sin(tilt)],
            [0.0, 1.0, 0.0],
            [-np.sin(tilt), 0.0, np.cos(tilt)],
        ]
    )
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = turn, far * turn[:, 2]
    row[:] = shape_row(HalfSpace(), T)
