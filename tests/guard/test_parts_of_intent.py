"""When a gripper's intent is over, and what is put down comes slowly enough."""

import numba
import numpy as np
import pytest

from armguard.guard.grips import (
    CONTRACT,
    END_FINGER,
    ENDING,
    EXPIRED,
    FIRST_A,
    FIRST_B,
    FIRST_FINGER,
    GRIPPER_WIDTH,
    IN_FORCE,
    MEANT,
    NEAR,
    NEAREST,
    NONE,
    NORMAL,
    POINT,
    SLOT,
    SPEED,
    SPENT_ON,
    STATE,
)
from armguard.guard.intent import comes_slowly, settle_meant
from armguard.robot.kinematics import PRISMATIC
from records import record


@numba.njit
def settle(h):
    settle_meant(1, h)


@numba.njit
def slowly(c, again, u, w, m):
    return comes_slowly(c, again, u, w, m)


# States of the contracts of two fingers, whether that is over, and was spent.
STATES = [
    (NONE, NONE, True, False),
    (NONE, IN_FORCE, False, False),
    (ENDING, NONE, False, False),
    (EXPIRED, NONE, False, True),
    (EXPIRED, EXPIRED, False, True),
]


@pytest.mark.parametrize(("one", "other", "over", "spent"), STATES)
def test_what_was_meant_is_forgotten_once_all_its_contracts_are_over(
    one, other, over, spent
):
    h = record(
        grippers=np.full((2, GRIPPER_WIDTH), -1, dtype=np.int64),
        contracts=np.zeros((6, CONTRACT)),
    )
    own = h.grippers[1]
    own[[FIRST_FINGER, END_FINGER, SLOT, SPENT_ON]] = 2, 4, 3, 7
    h.contracts[:, STATE] = IN_FORCE
    h.contracts[3:5, STATE] = one, other
    for meant in (-1, 0, 5):
        own[MEANT], own[SPENT_ON] = meant, 7
        settle(h)
        assert own[MEANT] == (-1 if over else meant)
        assert own[SPENT_ON] == (meant if spent and meant >= 0 else 7)


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
    """On two slides; what it is put on stands still, or is carried by another one."""
    axes = np.zeros((4, 6))
    axes[:, :3] = [(0, 0, -1), (1, 0, 0), (0, 0, -1), (1, 0, 0)]
    m = record(
        joints=np.array([[0, 1], [2, 3]], dtype=np.int32),
        length=np.array([2, 2], dtype=np.int32),
        joint_kind=np.full(4, PRISMATIC, dtype=np.int32),
        q_index=np.arange(4, dtype=np.int32),
        gain=np.ones((4, 2)),
        axes=axes,
        rate=np.zeros(2 if carried else 1),
    )
    w = record(bodies=np.array([0, 1 if carried else -1], dtype=np.int32))
    u = np.array([down, across, 0.0, 0.0]) * 0.05
    if carried:
        u += [0.02, 0.01, 0.02, 0.01]
    c = np.zeros(CONTRACT)
    c[[FIRST_A, FIRST_B]] = 0, 1
    c[[SPEED, NEAR]] = 0.05, 0.1
    c[NORMAL : NORMAL + 3] = 0.0, 0.0, -1.0
    c[POINT : POINT + 3] = 0.3, 0.2, 0.1
    for nearest in (0.0, 0.099):
        c[NEAREST] = nearest
        assert slowly(c, again, u, w, m) == known
    # Farther off it is neither begun nor ended.
    for nearest in (0.101, np.nan):
        c[NEAREST] = nearest
        assert slowly(c, again, u, w, m) == again
