"""Contracts that a client may request, held objects, and the models of a gripper."""

import numpy as np
import pytest

from armguard.errors import GraspError, UnknownNameError
from armguard.geometry import Box, Pose
from armguard.guard import Level, Reason, Region
from armguard.guard.contracts import prove_with_contract
from armguard.guard.grips import SPARE_CONTRACTS, ContractState
from armguard.guard.watch import RECOVERING, RESTING
from armguard.guard.workspace import open_workspace
from armguard.kernel import kernel
from armguard.motion.pair_state import ALLOWED, EXCEEDED, PROVEN
from armguard.motion.state import NEXT
from armguard.scene import Gripper, Scene
from armguard.scene.settings import IndexSettings
from grippers import (
    BELOW,
    FIGURES,
    FINGER,
    HAND,
    Loop,
    add_gantry,
    add_table,
    gantry,
    guard_of,
    pick_scene,
)
from sliding import at_gap, slides

FLOOR = 0.005
DOWN, TOUCH, OPEN = 0.1, 0.02, 0.04


def fingers(to, robot):
    """Both fingers' joints at a place."""
    return {f"{robot}/open_left": to, f"{robot}/open_right": to}


def finger_height(loop, robot="arm"):
    """How far the fingers' lower ends are above the table [m]."""
    z = loop.q[loop.guard.q_names.index(f"{robot}/z")]
    return z - BELOW - FINGER[2]


def over_table(**options):
    """A loop of a gantry over a table with nothing on it."""
    return Loop(guard_of(pick_scene(blocks={}, **options)))


def press(loop, cycles=3000, speed=0.1):
    """Push down; the height the fingers end at [m]."""
    loop.push({"arm/z": -speed}, cycles)
    return finger_height(loop)


def test_without_a_contract_fingers_keep_their_distance_from_a_table():
    loop = over_table()
    loop.go({"arm/z": DOWN}, speed=0.3)
    assert press(loop) >= FLOOR


def allow_both(guard, **options):
    """Let both fingers touch the table."""
    for finger in ("left", "right"):
        guard.allow(f"arm/{finger}", "table", **options)


def test_what_is_allowed_touches_at_the_speed_and_depth_that_were_said():
    loop = over_table()
    loop.go({"arm/z": DOWN + 0.02}, speed=0.3)
    allow_both(loop.guard, depth=0.003, speed=0.01, until=1e9)
    assert {c.kind for c in loop.guard.contracts} == {"asked"}
    loop.rows.clear()
    assert -0.003 <= press(loop) < 0.0
    assert loop.stops == []
    heights = [q[2] - BELOW - FINGER[2] for q, _ in loop.rows]
    first = int(np.argmax(np.array(heights) <= 0.0))
    assert abs(loop.rows[first][1][2]) <= 0.01


@pytest.mark.parametrize(("x", "touches"), [(0.0, True), (0.2, False)])
def test_a_region_is_where_it_holds_and_nowhere_else(x, touches):
    loop = over_table()
    region = Region(size=(0.1, 0.4, 0.04), pose=Pose(xyz=(0.0, 0.0, 0.0)))
    loop.go({"arm/x": x, "arm/z": DOWN + 0.02}, speed=0.3)
    allow_both(loop.guard, region=region, until=1e9)
    height = press(loop)
    assert (height < 0.0) == touches
    assert touches or height >= FLOOR


def test_a_contract_expires_and_then_the_arm_holds():
    loop = over_table()
    loop.go({"arm/z": DOWN}, speed=0.3)
    allow_both(loop.guard, until=loop.t + 1.5)
    assert press(loop, 1000) < FLOOR
    last = loop.push(np.zeros(5), 1500)
    assert last.verdict.level is Level.RECOVER
    assert last.verdict.causes["arm"] is Reason.CONTRACT_EXCEEDED
    loop.push({"arm/z": 0.05}, 1000)
    assert finger_height(loop) > FLOOR
    last = loop.push(np.zeros(5), 5)
    assert last.action == 0
    assert loop.guard.contracts == ()


def test_an_object_that_moves_faster_than_a_contract_permits_keeps_its_distance():
    scene = pick_scene(blocks={})
    scene.add(
        Box(size=(0.1, 0.1, 0.04)),
        name="cart",
        pose=Pose(xyz=(0.0, 0.0, 0.02)),
        top_speed=0.05,
    )
    guard = guard_of(scene)
    guard.place("cart", Pose(xyz=(0.0, 0.0, 0.02)), 0.0)
    loop = Loop(guard)
    loop.push({}, 3)
    for finger in ("left", "right"):
        guard.allow(f"arm/{finger}", "cart", depth=0.01, until=1e9)
    for k in range(3000):
        if k % 10 == 0:
            guard.place("cart", Pose(xyz=(0.0, 0.0, 0.02)), loop.t)
        loop.cycle({"arm/z": -0.1})
    assert finger_height(loop) - 0.04 >= FLOOR


def test_of_two_contracts_the_one_that_allows_more_counts():
    loop = over_table()
    loop.go({"arm/z": DOWN}, speed=0.3)
    for finger in ("left", "right"):
        loop.guard.allow(f"arm/{finger}", "table", depth=0.001, until=1e9)
        loop.guard.allow("table", f"arm/{finger}", depth=0.004, until=1e9)
    assert -0.004 <= press(loop) < -0.001


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"a": "arm/lefd"}, UnknownNameError, "did you mean 'arm/left'"),
        ({"b": "tabel"}, UnknownNameError, "did you mean 'table'"),
        ({"a": "table"}, GraspError, "name two bodies"),
        ({"depth": np.nan}, GraspError, "depth is nan m"),
        ({"depth": -0.001}, GraspError, "must be finite and >= 0"),
        ({"speed": 0.0}, GraspError, "must be finite and > 0"),
        ({"until": -5.0}, GraspError, "later than the last cycle"),
        ({"until": np.nan}, GraspError, "later than the last cycle"),
        ({"a": "arm/hand", "b": "arm/left"}, GraspError, "not checked"),
        (
            {"region": Region(size=(2, 2, 2), frame="arm/hnad")},
            UnknownNameError,
            "did you mean 'arm/hand'",
        ),
    ],
)
def test_contracts_that_cannot_be_are_refused(options, error, words):
    loop = over_table()
    loop.push(np.zeros(5), 3)
    arguments = {"a": "arm/left", "b": "table", **options}
    with pytest.raises(error, match=words):
        loop.guard.allow(arguments.pop("a"), arguments.pop("b"), **arguments)
    assert loop.guard.contracts == ()
    assert not loop.guard._grips.may.any()


def test_a_region_without_size_is_refused():
    with pytest.raises(GraspError, match="3 finite numbers"):
        Region(size=(0.2, 0.0, 0.2))


def test_there_is_room_for_so_many_contracts_and_no_more():
    scene = Scene(mode="path")
    add_gantry(scene, "arm")
    for k in range(SPARE_CONTRACTS + 1):
        scene.add(
            Box(size=(0.02, 0.02, 0.02)),
            name=f"box{k}",
            pose=Pose(xyz=(-0.9 + 0.025 * k, 0.9, 0.0)),
        )
    guard = guard_of(scene)
    Loop(guard).push(np.zeros(5), 2)
    for k in range(SPARE_CONTRACTS):
        guard.allow("arm/left", f"box{k}", until=1e9)
    with pytest.raises(GraspError, match="no room"):
        guard.allow("arm/left", f"box{SPARE_CONTRACTS}", until=1e9)
    # One that is in force may be replaced all the same.
    guard.allow("arm/left", "box3", depth=0.001, until=1e9)
    assert len(guard.contracts) == SPARE_CONTRACTS


def bar_scene(index=None):
    """Two gantries over a bar that both can hold, 140 mm apart."""
    scene = Scene(mode="path", **({} if index is None else {"index": index}))
    add_gantry(scene, "first", home=(-0.07, 0.0, 0.4))
    add_gantry(scene, "second", home=(0.37, 0.0, 0.4))
    add_table(scene)
    scene.add(
        Box(size=(0.2, 0.04, 0.06)),
        name="bar",
        pose=Pose(xyz=(0.0, 0.0, 0.03)),
        graspable=True,
    )
    return scene


def take(loop, robot, x):
    """Bring a gripper over its end of the bar and close it."""
    assert loop.go({f"{robot}/x": x}, speed=0.2)
    assert loop.go({f"{robot}/z": DOWN}, speed=0.08)
    assert loop.go(fingers(TOUCH, robot), speed=0.02)


def middle_of(guard, name):
    """Where an object's frame is in the world [m]."""
    return guard._workspace.T_world[guard.tables.holds.objects[name].body][[3, 7, 11]]


@pytest.mark.parametrize("kind", [None, "brute_force"])
def test_hand_over_and_two_grippers_on_one_object(kind):
    index = None if kind is None else IndexSettings(kind=kind)
    guard = guard_of(bar_scene(index))
    loop = Loop(guard)
    take(loop, "first", -0.07)
    guard.grasp("first", "bar")
    take(loop, "second", 0.07)
    guard.grasp("second", "bar")
    assert guard.held == {"bar": ("first", "second")}
    with pytest.raises(GraspError, match="already"):
        guard.grasp("second", "bar")
    # Both lift together.
    desired = {"first/z": 0.04, "second/z": 0.04}
    before = middle_of(guard, "bar").copy()
    loop.push(desired, 500)
    lifted = middle_of(guard, "bar")[2] - before[2]
    assert lifted == pytest.approx(0.02, abs=2e-3)
    guard.release("first", "bar")
    assert guard.held == {"bar": ("second",)}
    assert "let go" in {c.kind for c in guard.contracts}
    loop.push({}, 50)
    loop.go(fingers(OPEN, "first"), speed=0.02)
    loop.go({"first/z": 0.3}, speed=0.1)
    before = middle_of(guard, "bar").copy()
    assert loop.go({"second/z": 0.25}, speed=0.1)
    assert middle_of(guard, "bar")[2] > before[2] + 0.05
    assert loop.stops == []
    assert {c.kind for c in guard.contracts} <= {"held", "intent"}


def test_two_held_objects_may_touch_under_a_contract_and_not_without():
    scene = Scene(mode="path")
    add_gantry(scene, "first", home=(-0.2, 0.0, 0.4))
    add_gantry(scene, "second", home=(0.2, 0.0, 0.4))
    add_table(scene)
    for name, x in (("peg", -0.2), ("plate", 0.2)):
        scene.add(
            Box(size=(0.1, 0.04, 0.06)),
            name=name,
            pose=Pose(xyz=(x, 0.0, 0.03)),
            graspable=True,
        )
    guard = guard_of(scene)
    loop = Loop(guard)
    for robot, name, x in (("first", "peg", -0.2), ("second", "plate", 0.2)):
        take(loop, robot, x)
        guard.grasp(robot, name)
        assert loop.go({f"{robot}/z": 0.2}, speed=0.1)

    def apart():
        """True distance of the two along x [m]."""
        return middle_of(guard, "plate")[0] - middle_of(guard, "peg")[0] - 0.1

    loop.push({"first/x": 0.1}, 4000)
    assert FLOOR <= apart() < 0.02
    guard.allow("peg", "plate", depth=0.002, until=1e9)
    loop.push({"first/x": 0.1}, 3000)
    assert -0.002 <= apart() < 0.0
    assert loop.stops == []
    # Whatever else they have keeps its distance: the hands, and both from the table.
    assert not any(
        pair.contract and {pair.a, pair.b} != {"peg", "plate"}
        for pair in loop.commands[-1].verdict.near
    )


@pytest.mark.parametrize("coarse", [True, False])
def test_the_model_changes_with_the_distance_and_back_and_nothing_is_missed(coarse):
    loop = over_table(coarse=coarse)
    guard = loop.guard
    grips, present = guard._grips, guard.index.state.residency.status
    box = int(grips.grippers[0].box)
    members = [i for link in grips.members for i in range(link.first, link.end)]
    seen = set()

    def look(_=None):
        detailed = bool(present[members].all())
        assert detailed or not present[members].any()
        if coarse:
            assert detailed != bool(present[box])
        seen.add(detailed)

    for z in (0.9, DOWN, 0.9, DOWN, 0.9):
        for _ in range(4000):
            way = z - loop.q[2]
            if abs(way) < 1e-3:
                break
            loop.cycle({"arm/z": float(np.clip(4.0 * way, -0.5, 0.5))})
            look()
    assert seen == ({True, False} if coarse else {True})
    assert loop.stops == []
    guard.index.check()


def test_after_coming_back_the_answer_is_that_of_a_fresh_guard():
    used, fresh = over_table(), over_table()
    for z in (0.9, DOWN, 0.9):
        used.go({"arm/z": z}, speed=0.5, within=1e-3)
    used.guard.reset()
    rng = np.random.default_rng(8)
    lower, upper = used.guard.tables.lower, used.guard.tables.upper
    for _ in range(200):
        q = rng.uniform(lower, upper)
        one, other = used.guard.judge_at_rest(q), fresh.guard.judge_at_rest(q)
        assert one.tobytes() == other.tobytes()


def test_the_model_may_be_chosen():
    loop = over_table()
    guard = loop.guard
    guard.swap_model("arm", "detailed")
    loop.push({}, 3)
    box = int(guard._grips.grippers[0].box)
    assert not guard.index.state.residency[box].status
    guard.swap_model("arm", "coarse")
    loop.go({"arm/z": DOWN}, speed=0.3, longest=3000)
    assert guard.index.state.residency[box].status
    # The box reaches as low as the fingers do, and wider: it stops no later.
    assert press(loop) >= FLOOR
    assert HAND[1] > 0.0
    with pytest.raises(GraspError, match="did you mean 'coarse'"):
        guard.swap_model("arm", "coarser")
    with pytest.raises(UnknownNameError, match="no robot is named"):
        guard.swap_model("nobody", "auto")


def test_a_robot_without_a_gripper_or_of_mode_fixed_cannot_grasp():
    scene = Scene(mode="path")
    scene.add_robot(gantry(), name="arm", stopping=FIGURES)
    add_table(scene)
    guard = guard_of_home(scene)
    with pytest.raises(GraspError, match="has no gripper"):
        guard.grasp("arm", "table")
    fixed = Scene(mode="fixed")
    fixed.add_robot(
        gantry(), name="arm", gripper=Gripper(link="hand", fingers=("left", "right")),
        home={"z": 0.6, "open_left": 0.04, "open_right": 0.04},
    )  # fmt: skip
    fixed.add(Box(size=(0.02, 0.02, 0.02)), name="nut", graspable=True)
    guard = guard_of(fixed)
    with pytest.raises(GraspError, match="'fixed'"):
        guard.grasp("arm", "nut")
    with pytest.raises(GraspError, match="'fixed'"):
        guard.allow("arm/left", "nut", until=1.0)


def guard_of_home(scene):
    """A guard of a scene whose gantry is up at home."""
    scene.set_home("arm", {"z": 0.6, "open_left": 0.04, "open_right": 0.04})
    return guard_of(scene)


def test_contracts_cost_nothing_where_there_is_no_gripper():
    scene = Scene(mode="path")
    scene.add_robot(gantry(), name="arm", stopping=FIGURES)
    add_table(scene)
    guard = guard_of_home(scene)
    settings = guard._settings
    assert settings.contracts == settings.intents == 0
    Loop(guard).push(np.zeros(5), 2)
    guard.allow("arm/left", "table", until=1.0)
    assert settings.contracts == settings.intents == 1


def test_the_reason_has_its_sentence():
    assert "contract" in Reason.CONTRACT_EXCEEDED.sentence


@kernel(entry=True)
def prove(lines):
    """How the first near pair is proven."""
    w = open_workspace(lines)
    return prove_with_contract(0, 1, NEXT, NEXT, w.near[0], w)[0]


def slides_in_contract(gap=0.003, speed=0.1):
    """A guard of two slides that may touch, nearer than their floor, and its row."""
    guard = slides({}, {}, buffer=FLOOR, period=0.001)
    q, still = at_gap(gap, 2), np.zeros(2)
    guard.filter(q, still, 0.0, velocity=still, now=0.0)
    guard.allow("left/ball", "right/ball", depth=0.002, speed=speed, until=1e9)
    guard.filter(q, still, 0.001, velocity=still, now=0.001)
    contracts = guard._grips.contracts
    return guard, contracts[np.flatnonzero(contracts["state"])[0]]


@pytest.mark.parametrize(
    ("before", "share", "kept"),
    [(1.0, 0.97, True), (1.0, 1.01, False), (0.9, 0.94, True), (0.9, 0.96, False)],
)
def test_a_repeated_command_may_use_all_of_a_contract_and_a_new_one_less(
    before, share, kept
):
    guard, _ = slides_in_contract()
    watch = guard._watch
    watch.wanted[0] = share * 0.1
    watch.under_way[0] = 0.0, before * share * 0.1
    assert (prove(guard._lines.ctypes.data) == ALLOWED) == kept


@pytest.mark.parametrize("relieved", [(0, 0), (0, 1), (1, 0)])
def test_a_contract_that_is_exceeded_relieves_no_pair(relieved):
    guard, contract = slides_in_contract()
    contract.state = ContractState.EXPIRED
    watch = guard._watch
    watch.phase[:], watch.relieved[:] = RESTING, relieved
    watch.deficit[:] = 0.0
    assert prove(guard._lines.ctypes.data) == EXCEEDED
    assert tuple(watch.relieved) == relieved
    # What lacks is what they are nearer than their floor.
    assert watch.deficit == pytest.approx(np.full(2, 0.002), abs=1e-9)


@pytest.mark.parametrize("leaves", [0, 1])
def test_a_slide_that_leaves_what_a_contract_allowed_lacks_nothing_yet(leaves):
    guard, contract = slides_in_contract()
    contract.state = ContractState.EXPIRED
    watch = guard._watch
    watch.phase[:], watch.relieved[:] = RESTING, 0
    watch.phase[leaves] = RECOVERING
    watch.deficit[:] = 0.0005, 0.00025
    assert prove(guard._lines.ctypes.data) == PROVEN
    assert watch.relieved.tolist() == [1, 1]
    assert watch.deficit.tolist() == [0.0005, 0.00025]


def test_a_path_that_is_looked_at_leaves_contracts_as_they_were():
    guard, contract = slides_in_contract()
    # It would be over by now.
    contract.until = -1.0
    before = guard._grips.contracts.copy()
    apart, touching = at_gap(0.1, 2), at_gap(-1e-3, 2)
    assert not guard.check_path([apart, touching]).clear
    assert (guard._grips.contracts == before).all()
