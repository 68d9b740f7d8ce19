"""Proofs that outlive a change: what is left of them, and when that is too little."""

import numpy as np
import pytest

from armguard.geometry import Pose
from armguard.guard.change import NO_ROW, TOO_MANY, note_pair, renew
from armguard.guard.workspace import open_workspace
from armguard.kernel import kernel
from armguard.motion.pair_state import PROVEN, UNSURE
from sliding import APART, at_gap, let_go, slides

SPEED = 0.5


@kernel(entry=True)
def renewed(lines):
    return renew(open_workspace(lines))


@kernel(entry=True)
def noted(lines):
    w = open_workspace(lines)
    note_pair(0, 1, 0, w.near[0], w, w.watch)


class Judged:
    """A slide and a ball that moves, judged; and what is noted of their pair."""

    def __init__(self):
        self.guard = slides({}, mover={"top_speed": SPEED}, period=0.005)
        self.guard.place("ball", Pose(xyz=(APART, 0.0, 0.0)), stamp=5.0)
        let_go(self.guard)
        verdict = self.guard.step(at_gap(0.5), 5.0, velocity=[0.1], now=5.0)
        self.left = verdict.nearest.headroom
        assert self.guard._workspace.header.near_count == 1

    def renew(self, left, grown, longer, row):
        """Whether a pair is proven again; the proof and headroom in its row."""
        v, m = self.guard._watch, self.guard._motion
        near = self.guard._workspace.near[0]
        v.judged_count[0], v.judged_left[0], v.grown[0] = 1, left, grown
        v.judged_pairs[0] = 0, 1, row
        v.judged_settled[0] = m.span.settled - longer
        near.headroom = 9.0
        known = renewed(self.guard._lines.ctypes.data)
        return known, near.proof, near.headroom


@pytest.mark.parametrize("longer", [-0.04, 0.0, 0.04])
def test_what_joints_and_an_object_add_is_taken_off_what_was_left(longer):
    judged = Judged()
    used = 0.01 + SPEED * max(longer, 0.0)
    for left in (0.05, used + 1e-9):
        known, proof, found = judged.renew(left, 0.01, longer, 0)
        assert known
        assert proof == PROVEN
        assert found == pytest.approx(left - used, abs=1e-12)
        assert judged.renew(left, 0.01, longer, NO_ROW) == (True, PROVEN, 9.0)
    # A little less does not say that nothing happens.
    known, proof, found = judged.renew(used - 1e-9, 0.01, longer, 0)
    assert (known, proof) == (True, PROVEN)
    assert found == pytest.approx(judged.left)
    assert not judged.renew(used - 1e-9, 0.01, longer, NO_ROW)[0]


# How a pair was proven, whether more was looked at, and what is noted to be left.
@pytest.mark.parametrize(
    ("proof", "looked", "known"),
    [(PROVEN, 0, 0.3), (UNSURE, 0, -np.inf), (PROVEN, 1, -np.inf)],
)
def test_only_what_was_proven_by_itself_has_anything_left(proof, looked, known):
    guard = Judged().guard
    v, near = guard._watch, guard._workspace.near[0]
    near.proof, near.headroom = proof, 0.3
    guard._motion.effort.beyond_primitives = looked
    v.judged_count[0] = 0
    noted(guard._lines.ctypes.data)
    assert (v.judged_count[0], v.judged_left[0]) == (1, known)
    assert v.judged_pairs[0].tolist() == [0, 1, 0]
    v.judged_count[0] = len(v.judged_pairs)
    noted(guard._lines.ctypes.data)
    assert v.judged_count[0] == TOO_MANY
