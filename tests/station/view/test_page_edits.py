"""Boxes put up at the page stand in the loop at once, in the file when confirmed."""

from pathlib import Path

import numpy as np

from armguard.station.frames import Kind, frame_of
from armguard.station.ring import RingReader


def events(station, call):
    """What was called of the guard, by the ring."""
    ring = RingReader(Path(station.stage.client.welcome.ring))
    frames = [frame_of(row) for row in ring.unread() if int(row[0]) == Kind.EVENT]
    ring.close()
    return [frame.text for frame in frames if frame.text["call"] == call]


def test_a_box_is_added_moved_written_and_removed(station):
    page, before = station.page, station.scene_file.read_text(encoding="utf-8")
    station.tab("Edit")
    station.button("Add a box").click()
    station.until(lambda: events(station, "place"), "no box was placed")
    assert events(station, "place")[-1]["name"] == "spare"
    label = page.get_by_text("Place [m]")
    place = label.locator("xpath=ancestor::*[.//input][1]").locator("input").first
    x = events(station, "place")[-1]["pose"][0][3]
    station.until(
        lambda: abs(float(place.input_value()) - x) < 1e-3, "the numbers do not follow"
    )
    place.fill("-0.6")
    place.press("Enter")

    def moved():
        pose = np.array(events(station, "place")[-1]["pose"])
        return abs(pose[0, 3] + 0.6) < 1e-6

    station.until(moved, "the box was not moved")
    station.picture("edit")
    station.button("Write to the scene file").click()
    diff = page.get_by_text("wall_1:")
    diff.wait_for()
    assert "at: {xyz: [-0.6," in diff.inner_text()
    station.picture("diff")
    assert station.scene_file.read_text(encoding="utf-8") == before
    station.button("Write").last.click()
    station.until(
        lambda: station.scene_file.read_text(encoding="utf-8") != before,
        "nothing was written",
    )
    after = station.scene_file.read_text(encoding="utf-8")
    more = [line for line in after.splitlines() if line not in before.splitlines()]
    assert len(more) == 1
    assert more[0].startswith("  wall_1: {box: [0.2, 0.2, 0.2]")
    assert "# what it stands on" in after
    station.button("Remove").click()
    station.until(lambda: events(station, "remove"), "the box was not removed")
    station.button("Undo").click()
    count = len(events(station, "place"))
    station.until(lambda: len(events(station, "place")) >= count, "undone")
