"""From a stopped state at the limit there is a way out, or the pinch is named."""

from armguard.scene import bay_scene
from ways_out_campaign import run


def test_a_sample_of_states_of_the_bay():
    found = run(bay_scene("path"), 60, seed=7)
    assert found.states == 60
    assert found.too_near > 20
    assert found.neither == 0
    assert found.pinched == found.pinched_in_truth
    assert found.out_by_cue > 50
