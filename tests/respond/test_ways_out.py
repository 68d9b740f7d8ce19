"""From a stopped state at the limit there is a way out, or the pinch is named."""

import numpy as np
import pytest

from armguard.respond import Guard
from armguard.scene import bay_scene
from ways_out_campaign import (
    SPEED,
    Count,
    commanded,
    headroom,
    judge,
    leads_out,
    run,
)

# States of the bay from which a way out was hard to find, by what is hard [rad].
HARD = {
    # What errors of velocity and tracking may take is all that is left of the buffer.
    "within errors of touching": (
        0.52, -1.3586, 0.3492, -0.9126, 2.1157, 0.0198, -1.5509,
        1.1314, 1.4981, -2.3857, -0.804, 1.3925, 1.1203, 2.1898,
    ),
    # The other arm follows its operator, who desires no motion.
    "beside an arm that is not stopped": (
        1.1993, 1.2677, -1.6479, -0.0953, 1.6529, 1.6179, -3.0048,
        -1.306, -1.6583, -2.2464, -0.3066, -1.139, -1.6111, 1.4793,
    ),
    # What opens one pair closes another one, whichever joint it is.
    "no joint leads out alone": (
        1.5926, 1.6429, -0.5822, -1.1239, -0.8332, -0.2054, 1.3661,
        2.5489, -0.7489, -0.0283, -1.7295, -1.988, 1.5518, 1.0153,
    ),
    "both arms between three bodies each": (
        2.684, -1.6992, 1.7612, 1.6305, 1.3087, -0.4839, -2.7268,
        -2.1382, -1.2115, -0.2843, -1.3171, -0.4161, 0.2299, -0.3074,
    ),
}  # fmt: skip


def test_a_sample_of_states_of_the_bay():
    found = run(bay_scene("path"), 60, seed=7)
    assert found.states == 60
    assert found.too_near > 20
    assert found.neither == 0
    assert found.pinched == found.pinched_in_truth
    assert found.out_by_cue > 50


@pytest.mark.parametrize("hard", HARD)
def test_the_cue_leads_out_where_that_is_hard(hard):
    guard, q = Guard(bay_scene("path"), self_test=False), np.array(HARD[hard])
    assert min(headroom(guard, q).values()) < 1e-3
    found = Count()
    judge(guard, q, found)
    assert found.out_by_cue == 1


def test_no_joint_moves_without_desired_motion_however_it_is_held():
    guard = Guard(bay_scene("path"), self_test=False)
    for q in map(np.array, HARD.values()):
        velocity, _ = commanded(guard, q, np.zeros_like(q))
        assert not velocity.any()


def test_desired_motion_of_the_wrong_way_does_not_lead_nearer():
    guard = Guard(bay_scene("path"), self_test=False)
    top = np.concatenate([p.stopping.velocity for p in guard.tables.robots])
    for q in map(np.array, HARD.values()):
        guard.reset()
        cues = guard.step(q, 0.0, velocity=np.zeros_like(q), now=0.0).cues
        wrong = -SPEED * top * np.concatenate([c.escape for c in cues.values()])
        velocity, _ = commanded(guard, q, wrong)
        assert not velocity.any() or leads_out(guard, q, velocity)
