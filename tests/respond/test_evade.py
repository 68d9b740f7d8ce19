"""Getting out of the way of what comes, where there is a way."""

from itertools import pairwise

import numpy as np
import pytest

from approach import FIGURES, PERIOD
from armguard.cells.deltas import Delta
from armguard.errors import SceneError
from armguard.geometry import Box, Capsule, Pose, Sphere
from armguard.guard import Level
from armguard.guard.watch import (
    BRAKING,
    FEW,
    RECOVERING,
    RESTING,
    RUNNING,
    STOPPING,
)
from armguard.guard.workspace import open_workspace
from armguard.kernel import kernel
from armguard.record import records
from armguard.respond import Blocked, Guard
from armguard.respond.escape_path import POSTURES, STEPS
from armguard.respond.evasion import LINGERS, look_for_threats
from armguard.respond.leaving import only_out
from armguard.respond.state import open_response
from armguard.scene import Scene
from armguard.scene.settings import ResponseSettings
from arms import simple_arm
from sensed import CELL, CENTRE, LOW, SIZE, changes, feed, grid

SPEED = 0.3
ARM, CART = 0.04, 0.1
NO_CHANGES = records(0, Delta)


def cart_guard(evade=True, behind=None):
    """An arm of a metre along x, a cart that may come, and a ball behind the arm."""
    scene = Scene(mode="path")
    scene.add_robot(
        simple_arm(joints=1, length=1.0),
        name="arm",
        stopping=FIGURES,
        response=ResponseSettings(evade=evade),
        home={"joint1": 0.0},
    )
    scene.add(
        Sphere(radius=CART),
        name="cart",
        pose=Pose(xyz=(0.7, 0.6, 0.2)),
        top_speed=0.5,
    )
    if behind is not None:
        scene.add(
            Sphere(radius=0.1),
            name="behind",
            pose=Pose(xyz=(0.7 * np.cos(behind), 0.7 * np.sin(behind), 0.2)),
        )
    return Guard(scene, self_test=False)


def gap(q, centre, radius):
    """True distance of the arm and a ball, by hand [m]."""
    tip = np.array([np.cos(q), np.sin(q)])
    along = np.clip(centre @ tip, 0.1, 1.0)
    return float(np.linalg.norm(centre - along * tip)) - ARM - radius


def come(guard, seconds=1.9, has_velocity=True, desired=0.0):
    """Have the cart come at the arm.

    Returns:
        Least gap to the cart, joint positions, and why the arm did not follow.
    """
    q, v = 0.0, 0.0
    rows, gaps, blocked = [], [], []
    for k in range(int(seconds / PERIOD)):
        time = k * PERIOD
        centre = np.array([0.7, 0.6 - SPEED * time])
        guard.place(
            "cart",
            Pose(xyz=(*centre, 0.2)),
            time,
            velocity=(0.0, -SPEED, 0.0) if has_velocity else None,
        )
        command = guard.filter([q], [desired], time, velocity=[v], now=time)
        v = command.velocity[0]
        q += v * PERIOD
        rows.append(q)
        gaps.append(gap(q, centre, CART))
        blocked.append(command.blocked["arm"])
    return min(gaps), np.array(rows), blocked


def test_an_arm_at_rest_gets_out_of_the_way():
    least, rows, blocked = come(cart_guard())
    assert least > 0.0
    assert rows[-1] < -0.05
    assert Blocked.EVADING in blocked


@pytest.mark.parametrize(("evade", "has_velocity"), [(False, True), (True, False)])
def test_one_that_is_not_to_or_cannot_know_is_hit(evade, has_velocity):
    least, rows, blocked = come(cart_guard(evade), has_velocity=has_velocity)
    assert least < 0.0
    assert np.abs(rows).max() < 1e-6
    assert Blocked.EVADING not in blocked


def test_an_arm_at_work_does_so_too_whatever_its_operator_wants():
    least, _, blocked = come(cart_guard(), desired=0.05)
    assert least > 0.0
    assert Blocked.EVADING in blocked


def test_it_does_not_run_into_what_is_behind_it():
    guard = cart_guard(behind=-0.45)
    _, rows, _ = come(guard)
    behind = 0.7 * np.array([np.cos(0.45), -np.sin(0.45)])
    assert min(gap(q, behind, 0.1) for q in rows) >= 0.005


def test_what_goes_away_is_not_evaded():
    guard = cart_guard()
    for k in range(200):
        time = k * PERIOD
        at = Pose(xyz=(0.7, 0.2 + SPEED * time, 0.2))
        guard.place("cart", at, time, velocity=(0.0, SPEED, 0.0))
        command = guard.filter([0.0], [0.0], time, velocity=[0.0], now=time)
        assert command.blocked["arm"] is not Blocked.EVADING


@pytest.mark.parametrize(
    ("velocity", "words"),
    [
        ((0.0, 2.0, 0.0), "its top_speed is 0.5"),
        ((0.0, np.nan, 0.0), "3 finite numbers"),
        ((0.0, 1.0), "3 finite numbers"),
    ],
)
def test_a_velocity_that_cannot_be_is_an_error(velocity, words):
    guard = cart_guard()
    with pytest.raises(SceneError, match=words):
        guard.place("cart", Pose(xyz=(0.7, 0.6, 0.2)), 0.0, velocity=velocity)


def test_nor_can_a_stationary_object_have_one():
    guard = cart_guard(behind=-1.5)
    with pytest.raises(SceneError, match="no top_speed"):
        guard.place("behind", Pose(xyz=(0.0, -0.7, 0.2)), 0.0, velocity=(0, 1, 0))


def past(
    guard, begin, velocity, seconds, *, desired=(0.0, 0.0), gone=None, wrong_at=None
):
    """Have a cart come straight at an arm of links of 0.5 m, and go past.

    Args:
        guard: The guard.
        begin: Where the cart is first, in the plane [m].
        velocity: Its velocity there [m/s].
        seconds: For how long.
        desired: Motion that the operator desires [rad/s].
        gone: When the cart is taken away; None if it is not [s].
        wrong_at: When the operator sends what is no number; None if never [s].

    Returns:
        Least gap to the cart, joint positions and why the arm did not follow, of each
        cycle.
    """
    q, v = np.zeros(2), np.zeros(2)
    gaps, rows, blocked = [], [], []
    for k in range(int(seconds / PERIOD)):
        time = k * PERIOD
        centre = np.array(begin) + time * np.array(velocity)
        if guard.tables.slots:
            guard.update_cells(NO_CHANGES, time)
        if gone is None or time < gone:
            at = Pose(xyz=(*centre, 0.3))
            guard.place("cart", at, time, velocity=(*velocity, 0.0))
            gaps.append(links_gap(q, centre))
        elif gone - PERIOD < time:
            guard.remove("cart")
        asked = np.array(desired)
        if wrong_at is not None and abs(time - wrong_at) < 0.5 * PERIOD:
            asked[:] = np.nan
        command = guard.filter(q, asked, time, velocity=v, now=time)
        v = command.velocity
        q = q + v * PERIOD
        rows.append(q)
        blocked.append(command.blocked["arm"])
    return min(gaps), np.array(rows), blocked


def links_gap(q, centre):
    """True distance of an arm and a cart that is taller than it, by hand [m]."""
    least, at, turn = np.inf, np.zeros(2), 0.0
    for angle in q:
        turn += angle
        tip = np.array([np.cos(turn), np.sin(turn)])
        along = np.clip((centre - at) @ tip, 0.1, 0.5)
        least = min(least, float(np.linalg.norm(centre - at - along * tip)))
        at = at + 0.5 * tip
    return least - ARM - CART


def tall_cart_guard(*, top_speed=0.6, crowd=0, behind=None, cells=False, **response):
    """An arm along x that turns about z, and a tall cart that may come."""
    scene = Scene(mode="path")
    if cells:
        scene.set_sensing(
            region={"centre": CENTRE, "size": SIZE}, cell=CELL, unknown="still",
            intruder={"speed": 0.0, "size": 0.05},
        )  # fmt: skip
    scene.add_robot(
        simple_arm(joints=2, length=0.5),
        name="arm",
        stopping=FIGURES,
        response=ResponseSettings(evade=True, **response),
        home={"joint1": 0.0, "joint2": 0.0},
    )
    scene.add(
        Capsule(start=(0.0, 0.0, -0.3), end=(0.0, 0.0, 0.3), radius=CART),
        name="cart",
        pose=Pose(xyz=(0.0, 5.0, 0.3)),
        top_speed=top_speed,
    )
    if behind is not None:
        box = Box(size=(2.0, 0.1, 2.0))
        scene.add(box, name="wall", pose=Pose(xyz=(1.0, behind, 0.3)))
    for k in range(crowd):
        at = (3.0 + 0.1 * (k % 10), 3.0 + 0.1 * (k // 10), 0.3)
        scene.add(Sphere(radius=0.01), name=f"ball{k}", pose=Pose(xyz=at))
    return Guard(scene, self_test=False)


def runs_of(blocked):
    """How often the arm began to get out of the way."""
    evades = [why is Blocked.EVADING for why in blocked]
    return sum(now and not before for before, now in pairwise([False, *evades]))


def test_an_arm_steps_aside_of_what_comes_along_it():
    # No joint leads away from the cart: all of them move the tip across its way.
    least, rows, blocked = past(tall_cart_guard(), (1.9, 0.0), (-0.5, 0.0), 2.4)
    assert least > 0.02
    assert np.abs(rows[:, 0]).max() > 0.1
    assert runs_of(blocked) == 1


def test_what_misses_is_no_threat():
    _, rows, blocked = past(tall_cart_guard(), (1.3, 1.0), (0.0, -0.4), 4.0)
    assert Blocked.EVADING not in blocked
    assert np.abs(rows).max() < 1e-6


def test_it_waits_aside_until_the_cart_has_passed_and_is_given_back():
    _, rows, blocked = past(tall_cart_guard(), (0.9, 1.0), (0.0, -0.4), 6.0)
    assert runs_of(blocked) == 1
    assert blocked[-1] is Blocked.NOT
    passed = int(4.5 / PERIOD)
    assert np.abs(rows[passed:] - rows[-1]).max() < 1e-6


def test_it_is_given_back_when_the_cart_is_gone():
    _, _, blocked = past(tall_cart_guard(), (0.9, 1.0), (0.0, -0.4), 2.5, gone=1.7)
    assert Blocked.EVADING in blocked
    assert blocked[-1] is Blocked.NOT
    assert Blocked.STOPPED not in blocked


def test_an_operator_who_leads_into_the_way_of_what_comes_is_not_followed():
    guard = tall_cart_guard()
    least, _, blocked = past(guard, (0.6, 1.2), (0.0, -0.4), 4.5, desired=(0.2, 0.0))
    assert least > 0.02
    assert Blocked.EVADING in blocked


@pytest.mark.parametrize("crowd", [0, FEW])
def test_ways_that_lead_into_something_are_not_taken(crowd):
    # Below the arm there is a wall: it has to fold upwards.
    guard = tall_cart_guard(behind=-0.15, crowd=crowd, evade_time=2.0)
    least, rows, _ = past(guard, (0.9, 1.0), (0.0, -0.4), 2.4)
    assert least > 0.02
    tips = 0.5 * (np.sin(rows[:, 0]) + np.sin(rows.sum(axis=1)))
    assert tips.min() - ARM > -0.1 + 0.005


@pytest.mark.parametrize("occupied", [True, False])
def test_ways_that_lead_into_cells_are_not_taken(occupied):
    # The same wall, known by sensors alone: occupied, or never seen free.
    guard = tall_cart_guard(cells=True, evade_time=2.0)
    wall = grid()
    wall[:, : round((-0.1 - LOW[1]) / CELL)] = True
    found = (wall, grid()) if occupied else (grid(), wall)
    feed(guard, changes(*found, 0.0), 0.0)
    least, rows, _ = past(guard, (0.9, 1.0), (0.0, -0.4), 2.4)
    assert least > 0.02
    tips = 0.5 * (np.sin(rows[:, 0]) + np.sin(rows.sum(axis=1)))
    assert tips.min() - ARM > -0.1 + 0.005


def test_what_it_does_is_the_same_again():
    first, again = (
        past(tall_cart_guard(), (0.8, 0.9), (0.1, -0.4), 2.0)[1] for _ in range(2)
    )
    assert (first == again).all()


def test_an_evading_arm_needs_no_wider_margin():
    assert tall_cart_guard().tables.margin == Scene(mode="path").margin


def test_an_arm_that_was_stopped_evades_when_it_rests():
    least, _, blocked = past(
        tall_cart_guard(), (1.9, 0.0), (-0.5, 0.0), 2.4, wrong_at=0.2
    )
    assert Blocked.STOPPED in blocked
    assert Blocked.EVADING in blocked
    assert least > 0.02


def test_what_passes_near_by_stops_no_robot_that_could_evade_it():
    # It misses by 40 mm, and could be at the arm before that is surely at rest.
    guard = tall_cart_guard(top_speed=5.0)
    least, rows, blocked = past(guard, (1.18, 1.0), (0.0, -0.4), 4.0)
    assert least == pytest.approx(0.04, abs=1e-3)
    assert np.abs(rows).max() < 1e-6
    assert Blocked.STOPPED not in blocked
    assert runs_of(blocked) == 1
    assert blocked[-1] is Blocked.NOT


@kernel(inline=False, entry=True)
def keep_away(response, lines):
    """Let each joint of the first robot move only as it leads out."""
    w = open_workspace(lines)
    only_out(0, open_response(response), w.motion)


@pytest.mark.parametrize(
    ("way", "low", "high", "kept"),
    [
        (-1, -0.5, 0.5, (-0.5, 0.0)),
        (1, -0.5, 0.5, (0.0, 0.5)),
        (0, -0.5, 0.5, (-0.5, 0.5)),
        # Led back from its upper limit, or its lower one: it goes on.
        (1, -0.5, -0.02, (-0.02, -0.02)),
        (-1, 0.02, 0.5, (0.02, 0.02)),
    ],
)
def test_a_joint_that_is_led_back_from_its_limit_goes_on(way, low, high, kept):
    guard = tall_cart_guard()
    guard.filter([0.0, 0.0], [0.0, 0.0], 0.0, velocity=[0.0, 0.0], now=0.0)
    response = guard._response
    response.ways_out[:], response.low[:], response.high[:] = way, low, high
    response.target[:] = 0.1
    keep_away(guard._response_lines, guard._lines)
    assert (response.low[0], response.high[0]) == kept
    assert response.target[0] == np.clip(0.1, *kept)


@kernel(inline=False, entry=True)
def look(response, lines):
    """Look for robots that something comes at."""
    look_for_threats(open_response(response), open_workspace(lines))


@pytest.mark.parametrize(
    ("phase", "asked", "since", "evading"),
    [
        (RECOVERING, 0.0, 0.97 * LINGERS, True),
        (RECOVERING, 0.0, 1.03 * LINGERS, False),
        (RECOVERING, 0.05, 0.97 * LINGERS, True),
        (RUNNING, 0.0, 0.97 * LINGERS, False),
        (RESTING, 0.05, 0.97 * LINGERS, False),
    ],
)
def test_one_that_recovers_is_held_for_a_while_when_nothing_comes_any_more(
    phase, asked, since, evading
):
    guard = cart_guard()
    guard.place("cart", Pose(xyz=(0.7, 0.6, 0.2)), 0.0, velocity=(0.0, 0.0, 0.0))
    guard.filter([0.0], [0.0], 0.0, velocity=[0.0], now=0.0)
    escape, response = guard._escape, guard._response
    guard._watch.phase[0] = phase
    escape.notes[0].evading, escape.memory[0].clear_time = 1, since - PERIOD
    response.requested[0] = asked
    look(guard._response_lines, guard._lines)
    assert (escape.notes[0].evading, guard._watch.evades[0]) == (evading, evading)
    assert response.requested[0] == (0.0 if evading else asked)


# Distance that is required at rest, and gap of the cart at x to an arm along x [m].
FLOOR = 0.005
TIP = 1.0 + ARM + CART


def comes_at(guard, x, y, asked=(0.0, 0.0), velocity=(0.0, 0.0)):
    """Command of an arm along x in the cycle in which a cart is seen to come down."""
    guard.place("cart", Pose(xyz=(x, y, 0.3)), 0.0, velocity=(0.0, -0.4, 0.0))
    q = np.zeros(2)
    return guard.filter(q, np.array(asked), 0.0, velocity=np.array(velocity), now=0.0)


@pytest.mark.parametrize("share", [0.985, 1.015])
def test_what_passes_30_mm_off_is_no_threat_and_what_passes_nearer_is(share):
    guard = tall_cart_guard(evade_time=2.0)
    command = comes_at(guard, TIP + FLOOR + share * 0.03, 0.3)
    assert (command.blocked["arm"] is Blocked.EVADING) == (share < 1.0)


@pytest.mark.parametrize("share", [0.985, 1.015])
def test_a_robot_aside_is_given_back_when_what_comes_misses_it_by_45_mm(share):
    guard = tall_cart_guard(evade_time=2.0)
    guard._escape.notes[0].evading = 1
    # The operator desires next to no motion.
    command = comes_at(guard, TIP + FLOOR + share * 0.045, 0.3, asked=(2e-6, 0.0))
    assert (command.blocked["arm"] is Blocked.EVADING) == (share < 1.0)


@pytest.mark.parametrize(("worth", "kept"), [(0.0505, False), (0.0535, True)])
def test_a_robot_with_a_way_that_leads_just_clear_looks_for_one_that_leads_farther(
    worth, kept
):
    """A way counts as better from 8 mm on, and none beyond 60 mm."""
    guard, stays = tall_cart_guard(evade_time=2.0), 0.035
    # The tip has to turn back from the cart's line by so much.
    turn = np.arccos(1.0 - (worth - stays))
    speed = 0.5
    rise, fall = speed / FIGURES["acceleration"], speed / FIGURES["deceleration"]
    escape = guard._escape
    escape.notes[0].evading = escape.notes[0].has_motion = 1
    escape.memory[0].time_left = turn / speed + 0.5 * rise - 0.5 * fall
    escape.way[:] = -speed, 0.0
    command = comes_at(guard, TIP + FLOOR + stays, 0.3)
    assert command.blocked["arm"] is Blocked.EVADING
    assert escape.notes[0].has_motion == 1
    assert (escape.way.tolist() == [-speed, 0.0]) == kept


@pytest.mark.parametrize("phase", [RESTING, RUNNING, RECOVERING, STOPPING, BRAKING])
def test_no_robot_evades_while_it_is_stopped(phase):
    guard = tall_cart_guard(evade_time=2.0)
    guard._watch.phase[0] = phase
    command = comes_at(guard, 0.9, 0.3)
    evades = phase in (RESTING, RUNNING, RECOVERING)
    assert guard._watch.evades[0] == evades
    assert (command.blocked["arm"] is Blocked.EVADING) == evades


@pytest.mark.parametrize(("top_speed", "beset"), [(0.45, False), (5.0, True)])
def test_a_robot_stopped_for_something_else_is_not_held_for_what_passes(
    top_speed, beset
):
    """Only one of the carts could be at the arm before that rests."""
    guard = tall_cart_guard(behind=-0.14, top_speed=top_speed, evade_time=0.6)
    guard._watch.phase[0] = RUNNING
    turn = (-0.8, 0.0)
    command = comes_at(guard, TIP + 0.06, 0.1, asked=turn, velocity=turn)
    assert command.verdict.level is Level.STOP
    # The cart is near, and comes.
    assert guard._escape.plan.approaching_count == 1
    (headroom,) = (
        pair.headroom
        for pair in command.verdict.near
        if (pair.a, pair.b) == ("arm/link2", "cart")
    )
    assert (headroom < 0.0) == beset
    assert (command.blocked["arm"] is Blocked.EVADING) == beset


def test_no_more_ways_are_judged_in_a_cycle_than_there_is_time_for():
    # A cart that comes along the arm, and is not evaded well.
    guard, most = tall_cart_guard(evade_time=0.6), 0
    q, v, tried = np.zeros(2), np.zeros(2), [0]
    for k in range(8):
        time, at = k * PERIOD, Pose(xyz=(1.3, 0.0, 0.3))
        guard.place("cart", at, time, velocity=(-0.4, 0.0, 0.0))
        v = guard.filter(q, np.zeros(2), time, velocity=v, now=time).velocity
        q = q + v * PERIOD
        most = max(most, int(guard._escape.plan.placed))
        tried.append(guard._escape.notes[0].judged)
    # One way is begun before they are spent: two links, looked at twice and in between.
    assert 800 < most <= 800 + 2 * (2 * STEPS + POSTURES)
    assert np.diff(tried).max() < 30
    assert tried[-1] > 64
