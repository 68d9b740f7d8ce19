"""Masks of a frame: what is left out of them is not touched by it."""

import numpy as np
import pytest

import armguard as ag
from armguard.sense.view import View
from armguard.simulation.sensed import drive, sensed_bay, swing
from armguard.simulation.sensors import Rig


def claims_after(seconds):
    """Claims of a bay in motion among foreign boxes, some of them near to arms."""
    scene = sensed_bay(unknown="moving")
    sense, rig = ag.Sense(scene), Rig(scene, boxes=[(0.1,) * 3, (0.06,) * 3])
    rig.place(0, ag.Pose(xyz=(-0.3, 0.2, 1.0)))
    rig.place(1, ag.Pose(xyz=(-0.5, -0.3, 1.1)))
    drive(sense, rig, swing(scene, 1.5), seconds)
    claims = sense.cells.claims
    assert claims.occupied.words.any()
    return [
        claims.occupied.words, claims.unknown.words, claims.stamp, claims.error,
        claims.source, *sense.cells.evidence[:3],
    ]  # fmt: skip


def whole(monkeypatch):
    """Let masks have all cells of all links and objects."""
    monkeypatch.setattr(
        View, "beside", lambda self, middles, radii: np.zeros(len(radii), dtype=bool)
    )
    init = View.__init__

    def endless(self, *given):
        init(self, *given)
        self.span = np.inf

    monkeypatch.setattr(View, "__init__", endless)


def test_masks_of_a_view_and_whole_ones_give_the_same_map(monkeypatch):
    found = claims_after(1.0)
    whole(monkeypatch)
    for mine, expected in zip(found, claims_after(1.0), strict=True):
        np.testing.assert_array_equal(mine, expected)


@pytest.mark.parametrize(
    ("middle", "beside"),
    [
        ((0.34, 0.0, 0.4), False),
        ((0.36, 0.0, 0.4), True),
        ((0.0, 0.0, -0.19), False),
        ((0.0, 0.0, -0.21), True),
    ],
)
def test_balls_of_100_mm_are_beside_a_view_of_45_degrees(middle, beside):
    # Its corners are at 0.586 of the depth: (0.4 sin + 0.1) / cos is 0.350 m.
    (sensor,) = ag.Scene(mode="fixed").add_sensor("eye", kind="vl53l8cx")
    found = View(sensor, 0.05).beside(np.array([middle]), np.array([0.1]))
    assert found.tolist() == [beside]
