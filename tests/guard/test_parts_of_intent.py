"""When a gripper's intent is over, and what is put down comes slowly enough."""

import numpy as np
import pytest

from armguard.geometry import Box, Pose
from armguard.guard.grips import ContractRow, ContractState, GripperRow
from armguard.guard.intent import (
    approaches_slowly,
    read_gripper,
    score_of,
    settle_intended,
)
from armguard.guard.workspace import open_workspace
from armguard.kernel import kernel
from armguard.record import records
from armguard.robot.kinematics import PRISMATIC
from armguard.scene import Grasp, Scene
from grippers import BELOW, BLOCK, add_gantry, guard_of
from records import record


@kernel(entry=True)
def settle(h):
    settle_intended(1, h)


@kernel(entry=True)
def slowly(c, again, u, w, m):
    return approaches_slowly(c, again, u, w, m)


# Primitive of the support.
SUPPORT = 39

# States of the contracts of two fingers, whether that is over, and was spent.
STATES = [
    (ContractState.NONE, ContractState.NONE, True, False),
    (ContractState.NONE, ContractState.IN_FORCE, False, False),
    (ContractState.ENDING, ContractState.NONE, False, False),
    (ContractState.EXPIRED, ContractState.NONE, False, True),
    (ContractState.EXPIRED, ContractState.EXPIRED, False, True),
]


@pytest.mark.parametrize(("one", "other", "over", "spent"), STATES)
def test_a_target_is_forgotten_once_all_its_contracts_are_over(one, other, over, spent):
    h = record(
        grippers=records(2, GripperRow),
        contracts=records(6, ContractRow),
    )
    own = h.grippers[1]
    own.first_finger, own.end_finger = 3, 5
    h.contracts["state"] = ContractState.IN_FORCE
    h.contracts["state"][3:5] = one, other
    for intended in (-1, 0, 5):
        own.target, own.expired_target = intended, 7
        settle(h)
        assert own.target == (-1 if over else intended)
        assert own.expired_target == (intended if spent and intended >= 0 else 7)


# Speed of the object down and across, as shares of its greatest; whether it was put
# down before; and whether that is slow enough.
@pytest.mark.parametrize(
    ("down", "across", "again", "known"),
    [
        (0.94, 0.0, False, True),
        (0.96, 0.0, False, False),
        (0.96, 0.0, True, True),
        (1.01, 0.0, True, False),
        (-0.9, 0.0, False, False),
        (-0.9, 0.0, True, True),
        (0.4, 0.66, False, True),
        (0.4, 0.72, False, False),
        (0.0, 0.0, False, False),
        (0.0, 0.0, True, True),
    ],
)
@pytest.mark.parametrize("carried", [False, True])
def test_what_is_put_down_comes_slowly_and_towards_it(
    down, across, again, known, carried
):
    """On two slides; what it is put on is stationary, or is carried by another one."""
    axes = np.zeros((4, 6))
    axes[:, :3] = [(0, 0, -1), (1, 0, 0), (0, 0, -1), (1, 0, 0)]
    m = record(
        joints=np.array([[0, 1], [2, 3]], dtype=np.int32),
        length=np.array([2, 2], dtype=np.int32),
        joint_kind=np.full(4, PRISMATIC, dtype=np.int32),
        q_index=np.arange(4, dtype=np.int32),
        gain=np.ones((4, 2)),
        axes=axes,
        # A carried support is the last of many primitives that move.
        rate=np.zeros(SUPPORT + 1 if carried else SUPPORT),
    )
    bodies = np.zeros(SUPPORT + 1, dtype=np.int32)
    bodies[SUPPORT] = 1 if carried else -1
    w = record(bodies=bodies)
    u = np.array([down, across, 0.0, 0.0]) * 0.05
    if carried:
        u += [0.02, 0.01, 0.02, 0.01]
    c = records(1, ContractRow)[0]
    c.first_a, c.first_b = 0, SUPPORT
    c.speed, c.near = 0.05, 0.1
    c.normal = 0.0, 0.0, -1.0
    c.point = 0.3, 0.2, 0.1
    for nearest in (0.0, 0.099):
        c.nearest = nearest
        assert slowly(c, again, u, w, m) == known
    # Farther off it is neither begun nor ended.
    for nearest in (0.101, np.nan):
        c.nearest = nearest
        assert slowly(c, again, u, w, m) == again


@kernel(entry=True)
def score(o, u, way, lines):
    w = open_workspace(lines)
    m, h = w.motion, w.grips
    return score_of(0, o, u, way, h, w, m)


@kernel(entry=True)
def read(u, lines):
    w = open_workspace(lines)
    v, m = w.watch, w.motion
    read_gripper(0, u, w.grips, w, v, m)


# How near a gripper has to be, and how near its way has to lead [m].
CLOSE, AIMED = 0.1, 0.02

# How far the middle between the fingers is above the blocks [m].
HEIGHT = 0.06


def over_blocks(offset, apart=0.3):
    """A gripper above two blocks, and its guard.

    Args:
        offset: How far its middle is beside the first block, along x [m].
        apart: From the first block's middle to the second one's [m].
    """
    scene = Scene(mode="path")
    at = np.array([BLOCK[0] + offset, 0.0, BELOW + BLOCK[2] + HEIGHT])
    add_gantry(scene, "arm", home=tuple(at), coarse=False)
    for name, x in (("first", 0.0), ("second", apart)):
        scene.add(
            Box(size=tuple(2 * half for half in BLOCK)),
            name=name,
            pose=Pose(xyz=(x, 0.0, 0.0)),
            graspable=Grasp(near=CLOSE, aim=AIMED),
        )
    guard = guard_of(scene)
    guard.step(guard.home, 0.0, velocity=np.zeros(5), now=0.0)
    return guard


def down(speed, across=0.0):
    """Velocities of a gantry that goes down, and along x [m/s]."""
    return np.array([across, 0.0, -speed, 0.0, 0.0])


@pytest.mark.parametrize("intended", [-1, 0])
@pytest.mark.parametrize("speed", [0.015, 0.05])
def test_the_target_is_the_block_nearest_to_the_way_and_to_the_middle(speed, intended):
    """A way straight down leads past the first block as far as it is beside it."""
    for offset in (-BLOCK[0], 0.005, 0.97 * AIMED):
        guard = over_blocks(offset)
        guard._grips.grippers[0].target = intended
        beside = max(offset, 0.0)
        known = beside + 0.25 * np.hypot(beside, HEIGHT)
        # What was in the scratch does not matter.
        for before in (0.0, np.nan):
            found = score(0, down(speed), np.full(16, before), guard._lines.ctypes.data)
            assert found == pytest.approx(known, abs=1e-9)
        assert score(1, down(speed), np.zeros(16), guard._lines.ctypes.data) == np.inf


@pytest.mark.parametrize("intended", [False, True])
def test_a_way_that_leads_past_it_means_nothing(intended):
    most = (1.25 if intended else 1.0) * AIMED
    for share in (0.97, 1.03):
        guard = over_blocks(share * most)
        guard._grips.grippers[0].target = 0 if intended else -1
        found = score(0, down(0.05), np.zeros(16), guard._lines.ctypes.data)
        assert (found == np.inf) == (share > 1.0)


def test_the_object_of_a_spent_contract_is_a_target_only_while_it_stays_one():
    guard = over_blocks(0.0)
    own = guard._grips.grippers[0]
    own.expired_target = 0
    for intended, spent in ((-1, True), (1, True), (0, False)):
        own.target = intended
        found = score(0, down(0.05), np.zeros(16), guard._lines.ctypes.data)
        assert (found == np.inf) == spent
        assert own.expired_target == 0


@pytest.mark.parametrize("share", [0.9, 1.1])
def test_another_block_is_the_target_only_if_it_is_nearer_by_more_than_5_mm(share):
    apart = 2.0 * BLOCK[0] + 0.03

    def nearer_by(offset):
        """How much nearer the second block is than the first one [m]."""
        sides = np.array([offset, apart - 2.0 * BLOCK[0] - offset])
        scores = sides + 0.25 * np.hypot(sides, HEIGHT)
        return scores[0] - scores[1]

    low, high = 0.015, 0.024
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (
            (middle, high) if nearer_by(middle) < share * 0.005 else (low, middle)
        )
    guard = over_blocks(low, apart)
    grips = guard._grips
    own = grips.grippers[0]
    own.target = 0
    states = grips.contracts["state"][own.first_finger : own.end_finger]
    for before in (ContractState.IN_FORCE, ContractState.ENDING):
        states[:] = before
        read(down(0.05), guard._lines.ctypes.data)
        assert (
            states == (ContractState.IN_FORCE if share < 1.0 else ContractState.ENDING)
        ).all()


@pytest.mark.parametrize("filtered", [False, True])
@pytest.mark.parametrize("speed", [-0.05, 0.05])
def test_the_target_is_read_from_desired_or_measured_motion(speed, filtered):
    guard = over_blocks(0.0)
    for k in range(1, 4):
        time, velocity = k * 1e-3, down(speed)
        if filtered:
            still = np.zeros(5)
            guard.filter(guard.home, velocity, time, velocity=still, now=time)
        else:
            guard.step(guard.home, time, velocity=velocity, now=time)
    assert guard._grips.grippers[0].target == (0 if speed > 0.0 else -1)
