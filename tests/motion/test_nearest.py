"""Bodies of a chain are placed as forward kinematics of everything places them."""

import numpy as np
import pytest

from armguard.kernel import kernel
from armguard.motion.nearest import place_chain
from armguard.motion.state import Motion
from armguard.respond import Guard
from armguard.robot.kinematics import forward_kinematics
from armguard.scene import bay_scene
from armguard.table import Ledger, opener
from grippers import Loop, guard_of, pick_scene

open_motion = opener(Motion)


@kernel(entry=True)
def place(body, first, address):
    place_chain(body, first, open_motion(address))


def holding():
    """An arm that holds a block."""
    guard = guard_of(pick_scene(blocks={"block": (0.0, 0.0)}))
    loop = Loop(guard)
    assert loop.go({"arm/z": 0.1}, speed=0.08)
    assert loop.go({"arm/open_left": 0.02, "arm/open_right": 0.02}, speed=0.02)
    guard.grasp("arm", "block")
    return guard


@pytest.mark.parametrize("made", [lambda: Guard(bay_scene("path")), holding])
def test_chains_are_placed_to_the_bit_with_what_they_share(made):
    guard = made()
    m, tables = guard._workspace.motion, guard.tables
    ledger = Ledger(m)
    m.q_node[:] = np.random.default_rng(3).uniform(-1.0, 1.0, len(m.q_node))
    wanted = np.zeros_like(m.corner_T)
    forward_kinematics(
        m.q_node, tables.parent, tables.joint_kind, tables.q_index, tables.gain,
        tables.T_parent_joint, tables.axis, wanted,
    )  # fmt: skip
    bodies = range(len(tables.parent))
    for one in bodies:
        for other in bodies:
            m.corner_T[:] = np.nan
            place(one, 0, ledger.lines.ctypes.data)
            assert np.array_equal(m.corner_T[one], wanted[one])
            place(other, m.shared[one, other], ledger.lines.ctypes.data)
            assert np.array_equal(m.corner_T[other], wanted[other])
