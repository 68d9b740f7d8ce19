"""The page in a real browser, on a real service with simulated arms."""

import os
import signal
import threading
import time
from contextlib import closing
from pathlib import Path

import numpy as np
from tests.view.conftest import BRAKED, PATIENCE, VIEWPORT, shown

from armguard.guard import layout
from armguard.guard.layout import IN_ROBOT
from armguard.guard.levels import Level
from armguard.recording.frames import Kind, frame_of
from armguard.recording.ring import RingReader
from armguard.service.link import LinkEnd

STOPPED = ("STOP", "RECOVER", "HELD")

# Levels come and go faster than a test can ask: the page notes each with its sentence.
NOTE_LEVELS = """() => {
  const light = document.getElementById("light");
  const why = document.getElementById("why");
  window.levelsSeen = [];
  const note = () => window.levelsSeen.push([light.dataset.level, why.textContent]);
  new MutationObserver(note).observe(light, {attributes: true, childList: true});
}"""


def at_rest(station):
    """Whether nothing is commanded to move any more."""
    return not station.newest().told[:7].any()


def test_it_loads_from_this_machine_alone_and_without_a_complaint(station):
    # A machine that was late has the arm stopped; that is shown as well.
    station.until(lambda: station.light() in ("CLEAR", *STOPPED), "it shows nothing")
    station.picture("page")
    outside = [
        url
        for url in station.requests
        if not url.startswith((station.address, "ws://127.0.0.1:", "blob:", "data:"))
    ]
    assert outside == []
    assert station.errors == []
    assert station.page.get_by_text("Share").count() == 0
    assert station.page.locator("#why").inner_text() != ""
    assert "written" in station.page.locator("#headroom").inner_text()


def test_the_picture_is_as_high_as_the_page_below_the_header(station):
    header, picture = (
        station.page.locator(part).bounding_box()
        for part in ("#station", "#root canvas[data-engine]")
    )
    assert picture["y"] == header["height"]
    assert picture["y"] + picture["height"] == VIEWPORT["height"]


def test_why_exactly_has_the_terms_of_the_same_cycle_as_its_sentence(station):
    station.clear()
    fold = station.page.locator("#exactly")
    fold.locator("summary").click()
    text = fold.locator("pre")
    station.until(lambda: text.inner_text().startswith("cycle "), "it is empty")
    # The whole text is replaced at once, so it is of one cycle.
    cycle, said, *full = text.inner_text().split("\n")
    assert said and full
    assert int(cycle.removeprefix("cycle ")) <= station.newest().cycle
    station.picture("exactly")
    fold.locator("summary").click()
    assert not text.is_visible()


def test_the_light_turns_while_the_page_is_busy_drawing(station):
    busy, stops = 3.0, 1.0

    def turns():
        """Turns of the light while the page's own thread does nothing else."""
        station.clear()
        timer = threading.Timer(stops, station.stage.client.stop)
        timer.start()
        begin, end = station.page.evaluate(
            """(busy) => {
              const begin = Date.now();
              while (Date.now() < begin + busy) ;
              return [begin / 1000, Date.now() / 1000];
            }""",
            1000.0 * busy,
        )
        timer.join()
        station.until(lambda: station.light() in STOPPED, "the light did not turn")
        turned = [at for _, at in station.page.evaluate("window.stationTurns")]
        return [at for at in turned if begin < at < end]

    # A machine that was late stops the arm before the page is busy; then once more.
    assert any(turns() for _ in range(5))
    # And it goes on as if nothing had been.
    station.clear()


def test_drawing_rests_after_a_picture_that_took_long(station):
    busy, gap, called_off = station.page.evaluate(
        """async () => {
          const turn = () => new Promise(requestAnimationFrame);
          const busy = 200;
          await new Promise((done) => requestAnimationFrame(() => {
            const begin = performance.now();
            while (performance.now() < begin + busy) ;
            done();
          }));
          const begin = performance.now();
          let called = false;
          cancelAnimationFrame(requestAnimationFrame(() => { called = true; }));
          await turn();
          return [busy, performance.now() - begin, !called];
        }"""
    )
    assert gap >= busy
    assert called_off


def test_a_slider_moves_the_arm(station):
    station.tab("Drive")
    station.page.get_by_text("Joints of left").click()
    before = station.newest().q.copy()

    def led():
        if at_rest(station):
            station.lead(7)
        return station.newest().q[6] > before[6] + 0.5

    station.until(led, "the joint is not led")
    others = (station.newest().q - before)[:6]
    assert np.abs(others).max() < 0.01
    station.until(lambda: at_rest(station), "it does not come to rest")
    station.picture("slider")


def test_keys_move_the_tool_while_they_are_held(station):
    station.tab("Drive")
    station.page.get_by_label("Keys and gamepad").check(force=True)
    station.page.locator("#station[data-driving=true]").wait_for()
    before = station.newest().poses.copy()
    station.page.keyboard.down("KeyR")

    def rises():
        if at_rest(station) and station.light() != "CLEAR":
            station.button("Engage all").click()
        station.take()
        return np.abs(station.newest().poses - before).max() > 0.02

    station.until(rises, "the tool did not rise")
    station.page.keyboard.up("KeyR")
    station.until(lambda: at_rest(station), "it goes on rising")


def test_a_near_miss_turns_the_light_and_stops_the_arm(station):
    page = station.page
    page.locator("#sound").click()
    station.tab("Drive")
    # The post is to the left of the arm: it is led there, and on.

    page.evaluate(NOTE_LEVELS)

    def stopped():
        if at_rest(station):
            station.lead(1)
        seen = page.evaluate("window.levelsSeen")
        return any(level in STOPPED and "post" in why for level, why in seen)

    station.until(stopped, "the post did not stop the arm")
    station.picture("stopped")
    # It was the loop that stopped it, and the page had it from there.
    levels = [
        (frame.verdict[layout.HEADER + IN_ROBOT.level], frame.told[:7].any())
        for frame in station.cycles()
    ]
    assert max(level for level, _ in levels) >= Level.STOP
    assert not all(moves for level, moves in levels if level >= Level.STOP)
    beeps = page.evaluate("window.stationBeeps")
    assert {beep["name"] for beep in beeps} == {"left"}
    assert any(beep["level"] >= Level.STOP for beep in beeps)
    # Muted again, it says no more.
    page.locator("#sound").click()
    count = len(page.evaluate("window.stationBeeps"))
    page.wait_for_timeout(600)
    assert len(page.evaluate("window.stationBeeps")) == count


def test_the_stop_button_stops_everything_until_it_is_engaged(station):
    page = station.page
    station.engage()
    page.locator("#stop").click()

    def stopped() -> bool:
        if station.light() in BRAKED:
            # The machine was too busy for the declared stop: once more.
            station.engage()
            page.locator("#stop").click()
        return "STOPPED BY A PERSON" in page.locator("#why").inner_text()

    station.until(stopped, "the page does not say that a person ordered a stop")
    assert station.light() == "HELD"
    assert "held" in page.locator(".robot").inner_text()
    station.picture("held")
    page.locator("#engage").click()
    station.until(
        lambda: "STOPPED" not in page.locator("#why").inner_text(),
        "it was engaged",
    )


def test_a_reload_works_by_the_cookie_and_the_link_is_dead(station, browser):
    page = station.page
    assert "token" not in page.url
    page.reload()
    station.until(lambda: station.light() not in ("None", ""), "no light")
    stranger = browser.new_page()
    answer = stranger.goto(station.link)
    assert answer.status == 403
    assert "open the link that armguard printed last" in stranger.content()
    stranger.close()
    assert [one["name"] for one in page.context.cookies()] == [
        f"armguard-{station.address.rstrip('/').rpartition(':')[2]}"
    ]


def test_stop_can_be_seen_and_pressed_on_a_phone(station):
    page = station.page
    page.set_viewport_size({"width": 390, "height": 844})
    box = page.locator("#stop").bounding_box()
    assert box["x"] >= 0 and box["x"] + box["width"] <= 390
    assert box["height"] >= 44 and box["width"] >= 100
    station.picture("phone")
    page.locator("#stop").click()
    station.until(lambda: station.light() in (*STOPPED, *BRAKED), "it does not stop")
    page.set_viewport_size(VIEWPORT)


def test_a_view_that_is_killed_costs_the_loop_nothing(station):
    before = station.newest().cycle
    with shown(station.stage.port) as (process, _):
        os.kill(process.pid, signal.SIGKILL)
        process.wait(timeout=PATIENCE)
        end = time.monotonic() + PATIENCE
        while station.newest().cycle < before + 50 and time.monotonic() < end:
            time.sleep(0.05)
    assert station.newest().cycle >= before + 50


def events(station, call):
    """What was called of the guard, by the ring."""
    ring = RingReader(Path(station.stage.client.welcome.ring))
    frames = [frame_of(row) for row in ring.unread() if int(row[0]) == Kind.EVENT]
    ring.close()
    return [frame.text for frame in frames if frame.text["call"] == call]


def test_a_box_is_added_moved_written_and_removed(station):
    # The last one: a view that is started now finds another file than the service's.
    page, before = station.page, station.scene_file.read_text(encoding="utf-8")
    station.tab("Edit")
    station.button("Add a box").click()
    station.until(lambda: events(station, "place"), "no box was placed")
    assert events(station, "place")[-1]["name"] == "spare"
    label = page.get_by_text("Place [m]")
    place = label.locator("xpath=ancestor::*[.//input][1]").locator("input").first
    x = events(station, "place")[-1]["pose"][0][3]

    def follows():
        if not label.count():
            # A page that was out of breath begins anew, with the first tab.
            station.tab("Edit")
            return False
        return abs(float(place.input_value(timeout=2000)) - x) < 1e-3

    station.until(follows, "the numbers do not follow")

    def moved():
        # A page out of breath may put the number back before it is entered.
        place.fill("-0.6")
        place.press("Enter")
        page.wait_for_timeout(1000)
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


# The last one, since its words stay on the page.
def test_what_a_coordination_does_is_on_the_page(station):
    line = station.page.locator("#line")
    assert not line.is_visible()
    does = "puts item 3 down – yields: right passes first, 1.5 s more"
    robot = {"name": "left", "job": 3, "share": 0.5, "yields": True, "does": does}
    item = {"job": 3, "xyz": [0.4, 0.0, 0.9], "moves": [0, 0, 0]}
    state = {
        "now": 9.0, "robots": [robot], "waiting": 1, "done": 2, "missed": 0,
        "items": [{**item, "robot": "left", "held": True}], "fault": "",
        "belt": [0.21, 0.1, 0.3], "decisions": [[8.5, "left yields to right"]],
    }  # fmt: skip
    ended = threading.Event()

    def answer():
        with closing(LinkEnd(station.stage.port, "line")) as end:
            while not ended.wait(0.005):
                end.answer(lambda _: state)

    thread = threading.Thread(target=answer)
    thread.start()
    try:
        station.until(lambda: does in line.inner_text(), "no word of it")
        station.picture("coordination")
        shown = line.inner_text()
    finally:
        ended.set()
        thread.join()
    assert "2 jobs done · 0 missed · 1 waiting · belt 0.21 m/s" in shown
    assert "one robot yields until the other has passed" in shown
    assert "8.5 s left yields to right" in shown
    assert line.locator(".yields b").inner_text() == "left"
    ends = "does not answer any more"
    station.until(lambda: ends in line.inner_text(), "its end is not shown")
