"""The plot of the panel: what it shows and offers; the first camera."""

from dataclasses import replace

import numpy as np
import pytest
from tests.view.test_agreement import filtered  # noqa: F401  (a fixture)

from armguard import bay_scene
from armguard.guard import layout
from armguard.guard.levels import Level
from armguard.scene.compile import compile_scene
from armguard.scene.two_pandas import two_pandas_scene
from armguard.view.signals import NEAREST, SHADED, SignalPlot
from armguard.view.view import View, bounds_of
from armguard.view.world import body_poses


@pytest.mark.parametrize("make", [bay_scene, two_pandas_scene])
def test_the_first_camera_looks_at_all_robots(make):
    tables = compile_scene(make())
    places = body_poses(tables, tables.home)[:, [3, 7, 11]]
    low, high = bounds_of(tables, places)
    assert (places >= low).all() and (places <= high).all()
    assert np.linalg.norm(high - low) < 4.0


def test_the_plot_shades_levels_and_offers_every_joint(filtered):  # noqa: F811
    _, frame = filtered
    scene = bay_scene("path")
    scene.period = 0.01
    view = View(scene, 0, lambda *said: None)
    try:
        (plot,) = (one for one in view.drawables if isinstance(one, SignalPlot))
        joints = view.world.tables.q_names
        assert set(plot._choice.options) >= {NEAREST, *joints}
        slow = frame.verdict.copy()
        slow[layout.HEADER + layout.ROBOT_LEVEL] = Level.SLOW
        slow[layout.NEAR_COUNT], slow[layout.NEAREST] = 0, -1
        for verdict in (frame.verdict, slow):
            plot._sent = -np.inf
            view.draw(replace(frame, verdict=verdict))
        high = plot._shown[1]
        shades = dict(zip(sorted(SHADED), plot._plot.data[1:], strict=False))
        assert shades[Level.SLOW][-1] == high
        assert shades[Level.CAUTION][-1] == shades[Level.STOP][-1] == 0.0
        # No pair is reported: the line is outside of the plot.
        assert plot._plot.data[-2][-1] > high
        plot._choice.value = joints[3]
        plot._choose(joints[3])
        view.draw(replace(frame, verdict=slow))
        low, high = plot._shown
        assert plot._plot.data[-2] == pytest.approx(frame.q[3])
        assert low < frame.q[3] < high
        assert joints[3] in plot._plot.title
    finally:
        view.close()
