"""Cells in cycles: their kinds, ages, errors and faults, and what objects claim."""

import numpy as np
import pytest

from armguard.cells.deltas import Delta
from armguard.cells.grid import packed
from armguard.errors import CellMapError, SceneError
from armguard.geometry import Box, Pose
from armguard.guard import Level, Reason
from armguard.guard.checkpoint import CheckpointError
from armguard.guard.sensed_words import take_claims
from armguard.record import records
from armguard.recording.calls import CALLS, call_of
from armguard.respond import Guard
from armguard.scene.sensing import SceneZone
from sensed import PERIOD, SIZE, changes, feed, grid, sensed_guard, sensed_scene

NONE = records(0, Delta)

# A cell 0.2 m before the hand of a Panda at home; it is alone in its word.
CELL_AT = (45, 32, 33)
OTHER_AT = (44, 32, 32)


def seen_guard(*args, **settings):
    """A guard that reports what is near from afar."""
    return sensed_guard(*args, margin=0.3, **settings)


def one_cell(at=CELL_AT):
    occupied = grid()
    occupied[at] = True
    return occupied


def fed(guard, occupied=None, unknown=None, t=0.0, **of):
    """The guard after a map was taken over at a time."""
    occupied = grid() if occupied is None else occupied
    unknown = grid() if unknown is None else unknown
    feed(guard, changes(occupied, unknown, t, **of), t)
    return guard


def cycle(guard, t):
    """Verdict of a cycle of an arm at rest at home."""
    still = np.zeros(len(guard.home))
    return guard.step(guard.home, t, velocity=still)


def rested(guard, t):
    """Verdict of a cycle after others of the last 0.08 s: speeds are well known."""
    guard.reset()
    for k in range(20, 0, -1):
        cycle(guard, t - k * PERIOD)
    return cycle(guard, t)


def nearest(guard, t, name="something sensed"):
    """The pair with the least headroom with sensed cells; None without one."""
    found = [p for p in rested(guard, t).near if p.b == name]
    return min(found, key=lambda pair: pair.headroom, default=None)


@pytest.fixture(scope="module")
def free():
    return seen_guard()


@pytest.fixture
def guard(free):
    """A guard whose cells are forgotten."""
    fresh(free)
    return free


def fresh(guard):
    guard.reset()
    take_claims(changes(grid(), ~grid(), -np.inf), guard._sensed.ledger.lines)
    about = guard._sensed.table.about
    about.stamp = about.newest = -np.inf
    about.error = 0.0


@pytest.mark.parametrize("unknown", ["free", "still", "moving"])
def test_a_map_that_was_never_fed_frees_nothing(unknown):
    guard = seen_guard(unknown)
    desired = np.full(len(guard.home), 0.01)
    for k in range(50):
        t = k * PERIOD
        command = guard.filter(guard.home, desired, t, velocity=0.0 * desired)
        assert not command.velocity.any()
        assert command.verdict.reason in (Reason.CELLS_STALE, Reason.RESTING)
    # A map that has seen nothing is no permission where unknown space is not free.
    feed(guard, changes(grid(), ~grid(), -np.inf), t)
    moved = 0.0
    for k in range(50, 100):
        t = k * PERIOD
        guard.update_cells(NONE, t)
        command = guard.filter(guard.home, desired, t, velocity=0.0 * desired)
        moved = max(moved, np.abs(command.velocity).max())
    assert (moved > 0.0) == (unknown == "free")


def test_old_cells_stop_the_arm(guard):
    fed(guard, t=0.0)
    for k in range(1, 300):
        t = k * PERIOD
        verdict = cycle(guard, t)
        old = verdict.reason is Reason.CELLS_STALE
        assert old == (t > 1.0 + 1e-9) or verdict.reason is Reason.RESTING
        if t <= 1.0:
            assert verdict.level < Level.STOP
    assert verdict.level >= Level.STOP
    why = cycle(guard, t + PERIOD).why
    assert why.endswith("check the map's process and its sensors (1.2 s)")


def test_before_the_first_cells_no_age_is_named(guard):
    assert rested(guard, 1.0).why.endswith("check the map's process and its sensors")


def test_cells_later_than_the_cycle_stop_the_arm(guard):
    fed(guard, t=5.0)
    assert rested(guard, 1.0).reason is Reason.CELLS_AHEAD


@pytest.mark.parametrize(
    ("stamp", "says"),
    [
        (np.nan, "stamp is nan; it must be finite"),
        (np.inf, "stamp is inf; it must be finite"),
        (None, "stamp is None"),
        (0.9, "stamp is 0.900000 s, older than the last one, 1.000000 s"),
    ],
)
def test_a_stamp_that_cannot_be_is_refused(guard, stamp, says):
    fed(guard, t=1.0)
    before = guard.checkpoint()
    with pytest.raises(CellMapError, match=says):
        guard.update_cells(NONE, stamp)
    assert guard.checkpoint() == before


@pytest.mark.parametrize(
    ("field", "value", "says"),
    [
        ("stamp", np.nan, "change 1 has stamp nan"),
        ("stamp", np.inf, "change 1 has stamp inf"),
        ("error", np.nan, "error nan"),
        ("error", -1e-9, "error -1e-09"),
        ("error", np.inf, "error inf"),
        ("motion", 2, "motion 2"),
        ("motion", -1, "motion -1"),
        ("word", -1, "is of a word beyond"),
        ("word", (SIZE // 4) ** 3, "is of a word beyond"),
    ],
)
def test_a_change_that_cannot_be_is_refused(guard, field, value, says):
    before = guard.checkpoint()
    found = changes(one_cell(), grid(), 0.0)[:2].copy()
    found[field][1] = value
    with pytest.raises(CellMapError, match=says):
        guard.update_cells(found, 0.0)
    assert guard.checkpoint() == before


@pytest.mark.parametrize("deltas", [None, np.zeros(3), [], "x", records(4097, Delta)])
def test_other_arguments_are_refused(guard, deltas):
    with pytest.raises(CellMapError, match=r"take_deltas|at most 4096"):
        guard.update_cells(deltas, 0.0)


def test_a_scene_without_sensed_space_takes_no_cells():
    scene = sensed_scene()
    scene.sensing = None
    guard = Guard(scene, self_test=False)
    with pytest.raises(CellMapError, match="no `sensing`"):
        guard.update_cells(NONE, 0.0)
    assert guard._sensed.kept() == {}


def test_a_robot_that_reads_no_cells_is_refused():
    scene = sensed_scene()
    scene.set_mode("fixed")
    with pytest.raises(SceneError, match="mode 'fixed', which reads no cells"):
        Guard(scene, self_test=False)


def test_still_cells_do_not_grow_and_moving_ones_grow_with_their_age(guard):
    speed = guard.tables.sensing.intruder.speed
    fed(guard, one_cell(), t=0.0, motion=0)
    first = nearest(guard, 0.1)
    guard.update_cells(NONE, 0.1)
    assert nearest(guard, 0.2).headroom == first.headroom
    fresh(guard)
    fed(guard, one_cell(), t=0.0, motion=1)
    before = nearest(guard, 0.1)
    guard.update_cells(NONE, 0.1)
    after = nearest(guard, 0.2)
    assert before.headroom < first.headroom
    # The stamp of the map changes nothing: the cell was seen at its own stamp.
    assert before.headroom - after.headroom == pytest.approx(speed * 0.1, abs=1e-9)
    # Seen again it is as near as at first.
    feed(guard, changes(one_cell(), grid(), 0.3, motion=1), 0.3)
    assert nearest(guard, 0.4).headroom == pytest.approx(before.headroom, abs=1e-9)


def test_the_error_of_a_cell_is_kept(guard):
    fed(guard, one_cell(), t=0.0)
    before = nearest(guard, 0.1)
    fresh(guard)
    fed(guard, one_cell(), t=0.0, error=np.float32(0.02))
    after = nearest(guard, 0.1)
    assert before.distance - after.distance == pytest.approx(0.02, abs=1e-6)
    assert before.headroom - after.headroom >= 0.02 - 1e-6


def test_space_not_known_free_is_an_obstacle_as_declared():
    hidden = one_cell()
    least = {}
    for unknown in ("free", "still", "moving"):
        guard = fed(seen_guard(unknown), unknown=hidden)
        now = nearest(guard, 0.1, "space not known free")
        guard.update_cells(NONE, 0.2)
        fresh_map = nearest(guard, 0.3, "space not known free")
        aged = nearest(guard, 0.4, "space not known free")
        if unknown == "free":
            assert now is None and aged is None
            continue
        least[unknown] = now.headroom
        assert fresh_map.headroom == pytest.approx(now.headroom, abs=1e-9)
        grown = 1.6 * 0.1 if unknown == "moving" else 0.0
        assert now.headroom - aged.headroom == pytest.approx(grown, abs=1e-9)
    occupied = fed(seen_guard("free"), hidden)
    assert nearest(occupied, 0.1).headroom == least["still"]
    assert least["moving"] < least["still"]


def test_space_not_known_free_reaches_into_words_freed_beside_it():
    # A whole word that no frame has touched, and words before it towards the hand.
    hidden = grid()
    hidden[44:48, 32:36, 32:36] = True
    least = []
    for x, error in ((43, 0.0), (43, 0.02), (39, 0.02)):
        freed = grid()
        freed[x, 32, 32] = True
        errors = np.where(packed(freed) != 0, np.float32(error), np.float32(0.0))
        guard = fed(seen_guard("still"), unknown=hidden, error=errors)
        least.append(nearest(guard, 0.1, "space not known free").distance)
    assert least[0] - least[1] == pytest.approx(0.02, abs=1e-6)
    assert least[2] == pytest.approx(least[0], abs=1e-9)


def test_space_outside_the_region_is_not_known_free():
    # The face of this region is 0.95 m before the base, and the hand 0.55 m.
    scene = sensed_scene("still", margin=0.3)
    scene.set_sensing(
        region={"centre": (-0.3, 0, 0.5), "size": 64},
        cell=0.04,
        unknown="still",
        intruder={"speed": 0.0, "size": 0.05},
    )
    guard = fed(Guard(scene, self_test=False))
    reach = guard.home.copy()
    reach[1], reach[3], reach[5] = 1.2, -0.6, 1.8
    pairs = guard.step(reach, 0.01, velocity=0.0 * reach).near
    outside = [p for p in pairs if p.b == "space not known free"]
    assert outside
    for pair in outside:
        assert pair.point_b[0] == pytest.approx(-0.3 + 32 * 0.04, abs=1e-9)
        assert pair.normal[0] == pytest.approx(1.0, abs=1e-9)


def test_a_zone_counts_as_it_declares():
    at = Pose(xyz=(0.68, 0.03, 0.58))
    for unknown, there in (("free", False), ("still", True)):
        zone = SceneZone(box=(0.2, 0.2, 0.2), pose=at, unknown=unknown, reason="a test")
        other = "still" if unknown == "free" else "free"
        guard = fed(seen_guard(other, zones={"front": zone}), unknown=one_cell())
        found = nearest(guard, 0.1, "space not known free")
        assert (found is not None) == there


def test_objects_claim_the_cells_inside_them_and_give_them_back():
    scene = sensed_scene(margin=0.3)
    scene.add(Box(size=(0.06, 0.06, 0.06)), "block", present=False)
    guard = fed(Guard(scene, self_test=False), one_cell() | one_cell(OTHER_AT))
    where = guard._sensed.view.middles(CELL_AT)
    both = nearest(guard, 0.1)
    assert both is not None
    guard.place("block", Pose(xyz=where.tolist()))
    names = {p.b for p in rested(guard, 0.2).near}
    assert "block" in names
    beside = [p for p in rested(guard, 0.3).near if p.b == "something sensed"]
    assert not beside
    guard.place("block", Pose(xyz=(where + np.array([0.0, 0.0, 0.4])).tolist()))
    assert nearest(guard, 0.4).headroom == both.headroom
    guard.place("block", Pose(xyz=where.tolist()))
    other = Guard(scene, self_test=False)
    other.restore(guard.checkpoint())
    for name in ("claimed", "still"):
        own, its = (getattr(g._sensed.table, name) for g in (guard, other))
        ours, theirs = (one if name == "claimed" else one.words for one in (own, its))
        np.testing.assert_array_equal(ours, theirs)
    guard.remove("block")
    assert nearest(guard, 0.5).headroom == both.headroom


def test_a_restored_guard_goes_on_with_the_same_bits():
    rng = np.random.default_rng(3)
    occupied, unknown = rng.random(grid().shape) < 0.002, rng.random(grid().shape) < 0.1
    one, other = seen_guard("moving"), seen_guard("moving")
    fed(one, occupied, unknown & ~occupied, motion=1)
    fed(other, one_cell(), t=0.5)
    cycle(one, 0.004)
    other.restore(one.checkpoint())
    for k in range(2, 40):
        t = k * PERIOD
        for each in (one, other):
            if k % 3 == 0:
                found = changes(occupied, unknown & ~occupied, t)[k : 50 * k]
                each.update_cells(found, t)
        desired = 0.1 * np.sin(k + np.arange(len(one.home)))
        both = [
            g.filter(one.home, desired, t, velocity=0 * desired) for g in (one, other)
        ]
        assert both[0].verdict.numbers.tobytes() == both[1].verdict.numbers.tobytes()
        assert both[0].velocity.tobytes() == both[1].velocity.tobytes()
    assert one.checkpoint() == other.checkpoint()


def test_a_checkpoint_of_another_region_is_refused():
    with pytest.raises(CheckpointError, match="another scene"):
        seen_guard(cell=0.06, size=128).restore(fed(seen_guard()).checkpoint())


def test_a_recorded_call_is_replayed_to_the_bit(guard):
    found = changes(one_cell(), grid(), 0.0)
    event = CALLS["update_cells"](deltas=found[-4000:], stamp=0.0).event
    guard.update_cells(found[-4000:], 0.0)
    again = seen_guard()
    call_of(event).apply(again)
    assert again._sensed.table.still.words.tobytes() == (
        guard._sensed.table.still.words.tobytes()
    )
    assert nearest(again, 0.1).headroom == nearest(guard, 0.1).headroom


def test_crowded_space_stops_the_arm():
    rng = np.random.default_rng(5)
    guard = fed(seen_guard(speed=3.0), rng.random(grid().shape) < 0.3, motion=1)
    guard.update_cells(NONE, 0.4)
    verdict = rested(guard, 0.41)
    assert verdict.level >= Level.STOP
    desired = np.full(len(guard.home), 0.05)
    command = guard.filter(guard.home, desired, 0.414, velocity=0.0 * desired)
    assert not command.velocity.any()
