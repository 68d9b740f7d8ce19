"""The joint-space table: no near pair is omitted, wherever the joints are."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from armguard.errors import OctreeError
from armguard.geometry import (
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Pose,
    ShapeKind,
    Sphere,
)
from armguard.guard.world_at_home import world_at_home
from armguard.index import JointTable
from armguard.index.joint_cells import BITS
from armguard.motion.joint_links import fixed_primitives, joint_links
from armguard.respond import Guard
from armguard.robot.model import (
    CollisionElement,
    Joint,
    JointKind,
    Link,
    Mimic,
    RobotModel,
)
from armguard.scene import Scene, bay_scene
from armguard.scene.compile import compile_scene
from armguard.scene.settings import IndexSettings
from arms import simple_arm

# Points along the axis of a capsule at which the oracle measures.
SAMPLES = np.linspace(0.0, 1.0, 9)

KINDS = ("joint_table", "octree", "brute_force")


def table_of(tables, **settings):
    """The table of a scene, with the robots at home."""
    world = world_at_home(tables, np.zeros((len(tables.parent), 12)))
    columns = fixed_primitives(tables)
    settings = {"reach": tables.margin, **settings}
    return JointTable(world, joint_links(tables), columns, **settings)


@pytest.fixture(scope="module")
def bay():
    return compile_scene(bay_scene())


@pytest.fixture(scope="module")
def bay_table(bay):
    return table_of(bay)


def poses_of(tables, q):
    """Poses of all bodies, by SciPy's rotations: (k, b, 3, 3) and (k, b, 3)."""
    R = np.zeros((len(q), len(tables.parent), 3, 3))
    p = np.zeros((len(q), len(tables.parent), 3))
    for body, up in enumerate(tables.parent):
        F = tables.T_parent_joint[body].reshape(3, 4)
        R[:, body], p[:, body] = F[:, :3], F[:, 3]
        if up < 0:
            continue
        p[:, body] = p[:, up] + R[:, up] @ F[:, 3]
        x = q[:, tables.q_index[body]] * tables.gain[body, 0] + tables.gain[body, 1]
        turn = Rotation.from_rotvec(x[:, None] * tables.axis[body]).as_matrix()
        R[:, body] = R[:, up] @ F[:, :3] @ turn
    return R, p


def upper_distances(tables, q, links):
    """Distances of capsules of links to the fixed primitives, never too small.

    By points on the axes: shape (k, links, fixed) [m].
    """
    R, p = poses_of(tables, q)
    m = tables.moving_count
    out = np.zeros((len(q), len(links), len(tables.kinds) - m))
    for place, i in enumerate(links):
        row, body = tables.local_rows[i], tables.bodies[i]
        local = row[1:4] + SAMPLES[:, None] * (row[4:7] - row[1:4])
        points = local @ R[:, body].transpose(0, 2, 1) + p[:, body, None]
        for k in range(m, len(tables.kinds)):
            away = point_distances(tables.kinds[k], tables.local_rows[k], points)
            out[:, place, k - m] = away.min(axis=1) - row[0]
    return out


def point_distances(kind, row, points):
    """Distances of points to a sphere, a capsule or a box [m]."""
    if kind == ShapeKind.BOX:
        local = (points - row[1:4]) @ row[7:16].reshape(3, 3)
        outside = np.maximum(np.abs(local) - row[4:7], 0.0)
        return np.linalg.norm(outside, axis=-1) - row[0]
    end = row[4:7] if kind == ShapeKind.CAPSULE else row[1:4]
    axis = end - row[1:4]
    share = (points - row[1:4]) @ axis / max(float(axis @ axis), 1e-30)
    nearest = row[1:4] + np.clip(share, 0.0, 1.0)[..., None] * axis
    return np.linalg.norm(points - nearest, axis=-1) - row[0]


def cells_with_corners(table, tables, link, count, rng):
    """Configurations in cells of a link, and all corners of these cells.

    At a corner a link is farthest from where it was measured, and in one of them all
    joints have moved it towards an object.

    Returns:
        Shapes (count, n) and (count, corners, n).
    """
    places, counts = table.links.joints[link], table.cells.counts[link]
    divided = np.flatnonzero((places >= 0) & (counts > 1))
    joints = places[divided]
    low, high = table.links.lower[link, divided], table.links.upper[link, divided]
    step = (high - low) / counts[divided]
    q = rng.uniform(tables.lower, tables.upper, (count, len(tables.lower)))
    q[:, joints] = (
        low + (rng.integers(0, counts[divided], (count, len(joints))) + 0.5) * step
    )
    signs = np.array(list(product((-1.0, 1.0), repeat=len(joints))))
    corners = np.repeat(q[:, None], len(signs), axis=1)
    corners[:, :, joints] += 0.5 * step * signs
    return q, corners


def omitted(table, tables, q):
    """Near pairs that the candidates lack, and the number of near pairs."""
    m = tables.moving_count
    near = upper_distances(tables, q, range(m)) <= tables.margin
    missing = []
    for row, of_links in zip(q, near, strict=True):
        table.locate(row)
        assert (table.cells.row >= 0).all()
        for i in np.flatnonzero(of_links.any(axis=1)):
            lost = set(m + np.flatnonzero(of_links[i])) - set(table.candidates(i))
            missing += [(row, i, k) for k in lost]
    return missing, int(near.sum())


def test_ten_thousand_random_configurations_omit_no_near_pair(bay, bay_table):
    q = np.random.default_rng(0).uniform(bay.lower, bay.upper, (10_000, 14))
    missing, near = omitted(bay_table, bay, q)
    assert missing == []
    assert near > 20_000


@pytest.mark.parametrize("cells", [300, 7168, 65536])
def test_corners_of_cells_omit_no_near_pair(bay, cells):
    table = table_of(bay, cells=cells)
    rng, m, count = np.random.default_rng(1), bay.moving_count, 0
    for i in range(m):
        q, corners = cells_with_corners(table, bay, table.cells.link_of[i], 200, rng)
        flat = corners.reshape(-1, q.shape[1])
        near = upper_distances(bay, flat, [i])[:, 0] <= bay.margin
        near = near.reshape(*corners.shape[:2], -1).any(axis=1)
        count += near.sum()
        for row, objects in zip(q, near, strict=True):
            table.locate(row)
            lost = set(m + np.flatnonzero(objects)) - set(table.candidates(i))
            assert not lost, (i, row, lost)
    assert count > 500


def test_the_displacement_by_a_single_joint_is_not_underestimated():
    """Cells are wide and objects small: a lever is needed in full."""
    scene = Scene(mode="fixed", margin=0.01, buffer=0.01)
    scene.add_robot(simple_arm(joints=1), name="arm")
    angles = np.linspace(-1.9, 1.9, 60)
    for k, angle in enumerate(angles):
        at = (0.35 * np.cos(angle), 0.35 * np.sin(angle), 0.2)
        scene.add(Sphere(radius=0.002), name=f"dot{k}", pose=Pose(xyz=at))
    tables = compile_scene(scene)
    for cells in (8, 20, 45, 99):
        table = table_of(tables, cells=cells)
        lost = 0
        for q in np.linspace(-2.0, 2.0, 1500):
            table.locate(np.array([q]))
            # The capsule ends at 0.4 m, beyond the dots.
            away = 0.35 * np.abs(np.sin(angles - q)) - 0.04 - 0.002
            near = 1 + np.flatnonzero((away <= 0.01) & (np.abs(angles - q) < 0.5))
            lost += len(set(near) - set(table.candidates(0)))
        assert lost == 0


def test_a_link_of_the_bay_has_few_candidates_and_the_table_little_memory(
    bay, bay_table
):
    m, rng = bay.moving_count, np.random.default_rng(2)
    count = 0
    for q in rng.uniform(bay.lower, bay.upper, (500, 14)):
        bay_table.locate(q)
        count += sum((bay_table.candidates(i) >= m).sum() for i in range(m))
    assert count / (500 * m) < 5.0
    assert bay_table.statistics()["bytes"] < 1 << 20
    assert table_of(bay, memory=50_000).statistics()["bytes"] <= 50_000


def odd_robot():
    """An arm with joints and shapes of every kind, and more joints than are divided."""
    tetrahedron = [(0, 0, 0), (0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1)]
    rod = Capsule(start=(0, 0, 0), end=(0.25, 0, 0), radius=0.03)
    hull, egg = Hull(points=tetrahedron), Ellipsoid(semi_axes=(0.1, 0.05, 0.02))
    ball, drum = Sphere(radius=0.05), Cylinder(radius=0.03, height=0.2)
    finger, cart = Box(size=(0.1, 0.02, 0.02)), Box(size=(0.1, 0.1, 0.1))
    parts = [
        ("slide", JointKind.PRISMATIC, (1, 0, 0), (-0.3, 0.3), [cart]),
        ("turn", JointKind.CONTINUOUS, (0, 0, 1), None, [rod, ball]),
        ("lift", JointKind.REVOLUTE, (0, 1, 0), (-1.5, 1.5), [hull]),
        ("same", JointKind.REVOLUTE, (0, 0, 1), (-1.5, 1.5), [rod]),
        ("bend", JointKind.REVOLUTE, (0, 0, 1), (-2.0, 2.0), [rod]),
        ("roll", JointKind.CONTINUOUS, (1, 0, 0), None, [egg]),
        ("tilt", JointKind.REVOLUTE, (0, 1, 0), (-2.0, 2.0), [drum]),
        ("grip", JointKind.PRISMATIC, (0, 1, 0), (0.0, 0.1), [finger]),
    ]
    links, joints, above = {"base": Link(name="base")}, {}, "base"
    for name, kind, axis, limits, shapes in parts:
        links[name] = Link(
            name=name,
            collisions=tuple(
                CollisionElement(geometry=shape, T_link_geometry=np.eye(4))
                for shape in shapes
            ),
        )
        joints[name] = Joint(
            name=name,
            kind=kind,
            parent=above,
            child=name,
            T_parent_joint=Pose(xyz=(0.25, 0, 0.05)).matrix(),
            axis=np.array(axis, dtype=float),
            lower=limits[0] if limits else -np.inf,
            upper=limits[1] if limits else np.inf,
            mimic=Mimic("lift", -0.5, 0.1) if name == "same" else None,
        )
        above = name
    return RobotModel(name="odd", path=None, links=links, joints=joints, root="base")


def odd_scene(kind, **poses):
    """The odd arm between objects of every kind, some of them at other poses."""
    scene = Scene(index=IndexSettings(kind=kind), mode="fixed", margin=0.1)
    scene.add_robot(odd_robot(), name="odd")
    shapes = {
        "cylinder": Cylinder(radius=0.1, height=0.3),
        "cone": Cone(radius=0.1, height=0.3),
        "egg": Ellipsoid(semi_axes=(0.1, 0.2, 0.15)),
        "block": Box(size=(0.2, 0.1, 0.3), rounding=0.02),
        "ball": Sphere(radius=0.1),
        "rod": Capsule(start=(0, 0, -0.2), end=(0, 0, 0.2), radius=0.03),
        "wedge": Hull(points=[(0, 0, 0), (0.2, 0, 0), (0, 0.2, 0), (0, 0, 0.2)]),
    }
    for k, (name, shape) in enumerate(shapes.items()):
        place = (1.1 * np.cos(0.9 * k), 1.1 * np.sin(0.9 * k), 0.15 * k - 0.3)
        scene.add(shape, name=name, pose=poses.get(name, Pose(xyz=place)))
    scene.add(HalfSpace(), name="floor", pose=Pose(xyz=(0, 0, -0.9)))
    return scene


def random_positions(tables, rng):
    """Positions within the limits; up to ten turns of joints without limits."""
    lower = np.where(np.isfinite(tables.lower), tables.lower, -60.0)
    upper = np.where(np.isfinite(tables.upper), tables.upper, 60.0)
    return rng.uniform(lower, upper)


def test_verdicts_are_those_of_the_other_indices_for_all_kinds_of_shapes_and_joints():
    guards = [Guard(odd_scene(kind)) for kind in KINDS]
    tables, rng, near = guards[0].tables, np.random.default_rng(3), 0
    ours = guards[0].index
    for _ in range(1500):
        q = random_positions(tables, rng)
        verdicts = [guard.step(q) for guard in guards]
        assert len({verdict.tobytes() for verdict in verdicts}) == 1
        assert (ours.cells.row >= 0).all()
        near += len(verdicts[0].near)
    assert near > 500
    ours.check()


def test_verdicts_of_the_bay_are_those_of_the_other_indices():
    guards = []
    for kind in KINDS:
        scene = bay_scene()
        scene.index = replace(scene.index, kind=kind)
        guards.append(Guard(scene))
    tables, rng = guards[0].tables, np.random.default_rng(4)
    tested = np.zeros(3)
    for k in range(1500):
        if k % 10 == 0:
            q = rng.uniform(tables.lower, tables.upper)
        q = np.clip(q + rng.uniform(-0.01, 0.01, 14), tables.lower, tables.upper)
        verdicts = [guard.step(q) for guard in guards]
        assert len({verdict.tobytes() for verdict in verdicts}) == 1
        tested += [v.counts.pairs_tested + v.counts.pairs_filtered for v in verdicts]
    assert tested[0] < 0.6 * tested[2]


def test_predicted_stops_are_those_of_the_other_indices():
    """With more primitives than are listed, and margins beyond that of the table."""
    guards = []
    for kind in KINDS:
        scene = bay_scene("path")
        for k in range(230):
            at = (3.0 + 0.1 * (k % 20), 0.1 * (k // 20), 1.0)
            scene.add(Sphere(radius=0.02), name=f"far{k}", pose=Pose(xyz=at))
        scene.index = replace(scene.index, kind=kind, cube=None)
        guards.append(Guard(scene, self_test=False))
    rng, q = np.random.default_rng(5), guards[0].home
    for k in range(150):
        q = q + rng.uniform(-0.004, 0.004, 14)
        bytes_of = {guard.step(q, stamp=0.01 * k).tobytes() for guard in guards}
        assert len(bytes_of) == 1


def test_an_object_that_moved_is_a_candidate_until_the_table_is_refreshed():
    guard, brute = Guard(odd_scene("joint_table")), Guard(odd_scene("brute_force"))
    table, rng = guard.index, np.random.default_rng(6)
    (ball,) = [k for k, name in enumerate(guard.tables.labels) if name == "ball"]
    before = table.cells.bits.copy()
    for refreshed in (False, True):
        for _ in range(10):
            pose = Pose(xyz=tuple(rng.uniform((-0.5, -0.5, 0), (1, 0.5, 0.8))))
            for one in (guard, brute):
                one.place("ball", pose)
            if refreshed:
                table.refresh()
                table.check()
                assert not table.cells.stale.any()
            for _ in range(100):
                q = random_positions(guard.tables, rng)
                assert guard.step(q).tobytes() == brute.step(q).tobytes()
                assert refreshed or ball in table.candidates(0)
    assert not np.array_equal(table.cells.bits, before)


def test_a_refreshed_table_is_that_of_a_fresh_start():
    poses = [Pose(xyz=(0.6, 0.1, 0.2)), Pose(xyz=(0.3, -0.5, 0.4), rpy=(1, 2, 3))]
    scenes = [odd_scene("joint_table", block=pose) for pose in poses]
    table, fresh = (table_of(compile_scene(scene)) for scene in scenes)
    k = compile_scene(scenes[0]).labels.index("block")
    assert not np.array_equal(table.cells.bits, fresh.cells.bits)
    table.remove(k)
    table.world.rows[k], table.world.boxes[k] = (
        fresh.world.rows[k],
        fresh.world.boxes[k],
    )
    table.insert(k)
    assert table.cells.stale.any()
    table.refresh()
    table.check()
    assert not table.cells.stale.any()
    assert np.array_equal(table.cells.bits, fresh.cells.bits)


def test_an_object_that_comes_back_to_its_place_needs_no_refresh(bay):
    table = table_of(bay)
    k = bay.moving_count
    row = table.world.rows[k].copy()
    table.world.rows[k, 1] += 0.1
    table.update(k)
    assert table.cells.stale[0] == 1
    table.world.rows[k] = row
    table.update(k)
    assert table.cells.stale[0] == 0


def test_a_removed_object_is_no_candidate(bay):
    table = table_of(bay)
    table.locate(bay.home)
    found = table.candidates(1)
    k = int(found[found >= bay.moving_count][0])
    table.remove(k)
    assert k not in table.candidates(1)
    table.insert(k)
    assert np.array_equal(table.candidates(1), found)


def test_positions_without_a_cell_have_all_candidates(bay, bay_table):
    everyone = set(range(len(bay.kinds)))
    for wrong in (np.nan, np.inf, -np.inf, 4.0, -4.0):
        q = bay.home.copy()
        q[1] = wrong
        bay_table.locate(q)
        for i in range(1, 7):
            assert set(bay_table.candidates(i).tolist()) == everyone - {i}
    for q in (bay.lower, bay.upper):
        bay_table.locate(q)
        assert (bay_table.cells.row >= 0).all()


def test_a_place_that_is_no_number_is_near_everywhere(bay):
    table = table_of(bay, cells=300)
    k = bay.moving_count
    table.world.rows[k, 1] = np.nan
    table.update(k)
    table.refresh()
    assert (table.cells.bits[:, 0] & 1 == 1).all()


def test_joints_without_limits_have_the_same_cells_after_whole_turns():
    tables = compile_scene(odd_scene("joint_table"))
    table, rng = table_of(tables), np.random.default_rng(7)
    turning = ~np.isfinite(tables.lower)
    assert turning.sum() == 2
    for _ in range(200):
        q = np.where(turning, rng.uniform(-3.1, 3.1), random_positions(tables, rng))
        table.locate(q)
        rows = table.cells.row.copy()
        table.locate(np.where(turning, q + 2.0 * np.pi * rng.integers(-9, 9), q))
        assert np.array_equal(table.cells.row, rows)
    table.locate(np.where(turning, 1e9, q))
    assert (table.cells.row[2:] == -1).all()


def test_more_primitives_than_a_word_has_bits(bay):
    scene = bay_scene()
    rng = np.random.default_rng(8)
    for k in range(2 * BITS):
        at = tuple(rng.uniform((-1, -1, 0), (1, 1, 2)))
        scene.add(Sphere(radius=0.05), name=f"ball{k}", pose=Pose(xyz=at))
    tables = compile_scene(scene)
    table = table_of(tables, cells=1000)
    assert table.cells.bits.shape[1] == 3
    q = rng.uniform(tables.lower, tables.upper, (300, 14))
    missing, near = omitted(table, tables, q)
    assert missing == []
    assert near > 2000


def test_the_check_finds_a_wrong_bit(bay):
    table = table_of(bay, cells=300)
    table.check()
    table.cells.bits[7, 0] ^= 4
    with pytest.raises(OctreeError, match="table"):
        table.check()
