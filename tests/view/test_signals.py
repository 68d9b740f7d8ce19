"""The plot of the panel: what it shows and offers; the first camera."""

import time
from dataclasses import replace

import numpy as np
import pytest
from tests.view.test_agreement import filtered  # noqa: F401  (a fixture)

from armguard import bay_scene
from armguard.guard import layout
from armguard.guard.layout import IN_HEADER, IN_NEAR, IN_ROBOT
from armguard.guard.levels import Level
from armguard.scene.compile import compile_scene
from armguard.scene.poses import body_poses
from armguard.scene.two_pandas import two_pandas_scene
from armguard.view.drawables import NearPairs
from armguard.view.signals import NEAREST, POSITION, SHADED, NearList, SignalPlot
from armguard.view.view import HALF_VIEW, View, bounds_of, corners_of, fitted


@pytest.mark.parametrize("make", [bay_scene, two_pandas_scene])
def test_the_first_camera_sees_all_robots_and_no_more(make):
    tables = compile_scene(make())
    places = body_poses(tables, tables.home)[:, [3, 7, 11]]
    low, high = bounds_of(tables, places)
    assert (places >= low).all() and (places <= high).all()
    corners, towards = corners_of(low, high), np.array([0.6, -0.64, 0.48])
    position, look_at = fitted(corners, towards)
    assert np.cross(position - look_at, towards) == pytest.approx(0.0, abs=1e-9)
    aside = np.array([0.64, 0.6, 0.0]) / np.hypot(0.64, 0.6)
    above = np.cross(towards, aside)
    seen = corners - position
    depth = -seen @ towards
    slopes = np.abs(seen @ np.array([aside, above]).T) / depth[:, None] / HALF_VIEW
    assert depth.min() > 0.0
    assert slopes.max() == pytest.approx(1.0)


@pytest.fixture
def view():
    """A view of the bay without a page."""
    scene = bay_scene("path")
    scene.period = 0.01
    made = View(scene, 0, lambda *said: None)
    yield made
    made.close()


def crowded(view, frame, count):
    """The cycle with pairs of the same two primitives, each nearer than the last.

    All have their witness points at the origin.
    """
    pairs = np.zeros((count, layout.NEAR_WIDTH))
    pairs[:, IN_NEAR.second] = 9.0
    pairs[:, IN_NEAR.headroom] = np.arange(count, 0, -1) * 1e-3
    first = frame.verdict[: view.world.names.first_row]
    verdict = np.concatenate([first, pairs.reshape(-1)])
    verdict[IN_HEADER.near_count], verdict[IN_HEADER.nearest] = (
        count,
        count - 1,
    )
    return replace(frame, verdict=verdict)


def test_where_no_cycle_was_drawn_there_is_neither_line_nor_shade(filtered, view):  # noqa: F811
    frame, plot = crowded(view, filtered[1], 1), view.plot
    frame.verdict[layout.HEADER + IN_ROBOT.level] = Level.SLOW
    plot.fill(
        view.world.cycle(replace(frame, monotonic=100.0 + at))
        for at in (0.0, 0.5, 6.5, 7.0)
    )
    plot._send()
    times, *shades, line, _ = plot._plot.data
    high = plot._shown[1]
    assert times.tolist() == [-7.0, -6.5, -6.5, -0.5, -0.5, 0.0]
    slow = dict(zip(sorted(SHADED), shades, strict=True))[Level.SLOW]
    assert slow.tolist() == [high, high, 0.0, 0.0, high, high]
    assert (line > high).tolist() == [False, False, True, True, False, False]


def test_two_links_are_listed_once_and_labelled_once(filtered, view):  # noqa: F811
    frame = crowded(view, filtered[1], 3)
    view.draw(frame)
    (near_list,) = (one for one in view.drawables if isinstance(one, NearList))
    rows = near_list._text.content.splitlines()[2:]
    assert len(rows) == 1 and rows[0].endswith("| 1 mm |")
    (labels,) = (one for one in view.drawables if isinstance(one, NearPairs))
    assert [label.visible for label in labels.nodes.values()] == [True, False, False]


def test_the_last_cycle_of_several_is_drawn_by_all(filtered, view):  # noqa: F811
    (near_list,) = (one for one in view.drawables if isinstance(one, NearList))
    view.draw(crowded(view, filtered[1], 3))
    last = crowded(view, filtered[1], 0)
    view.draw(last)
    end = time.monotonic() + 10.0
    while "mm" in near_list._text.content and time.monotonic() < end:
        time.sleep(0.01)
        view.draw(last)
    assert near_list._text.content == "No pair is within the margin."


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
        slow[layout.HEADER + IN_ROBOT.level] = Level.SLOW
        slow[IN_HEADER.near_count], slow[IN_HEADER.nearest] = 0, -1
        for k, verdict in enumerate((frame.verdict, slow)):
            plot._due = -np.inf
            view.draw(replace(frame, verdict=verdict, monotonic=frame.monotonic + k))
        high = plot._shown[1]
        shades = dict(zip(sorted(SHADED), plot._plot.data[1:], strict=False))
        assert shades[Level.SLOW][-1] == high
        assert shades[Level.CAUTION][-1] == shades[Level.STOP][-1] == 0.0
        # No pair is reported: the line is outside of the plot.
        assert plot._plot.data[-2][-1] > high
        plot._choice.value = joints[3]
        plot._choose(joints[3])
        low, high = plot._shown
        assert plot._plot.data[-2] == pytest.approx(frame.q[3])
        assert low < frame.q[3] < high
        assert plot._plot.title == POSITION
    finally:
        view.close()
