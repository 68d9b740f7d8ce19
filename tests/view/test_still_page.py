"""The page in a real browser, on a cycle that stays: what is marked, what is where."""

import time
from dataclasses import replace

import numpy as np
import pytest
from tests.view.conftest import PATIENCE, VIEWPORT, running

from armguard import Guard, bay_scene
from armguard.recording.frames import Kind, frame_of
from armguard.recording.recorded import RecordedGuard
from armguard.recording.ring import RingReader, RingWriter
from armguard.view.signals import pair_name
from armguard.view.view import View
from armguard.view.world import World


class OneCycle(View):
    """A view of a cycle that stays, with a browser's page.

    Attributes:
        frame: The cycle.
    """

    def __init__(self, scene, frame):
        super().__init__(scene, 0, lambda *said: None)
        self.frame = frame

    def step(self):
        self.draw(self.frame)
        self.publish(replace(self.frame, monotonic=time.monotonic()))

    def marks(self, page, pair):
        """Wait until a pair is marked in the picture, or None."""
        end = time.monotonic() + PATIENCE
        name = "" if pair is None else pair_name(pair)
        while time.monotonic() < end:
            if self.marked.text.startswith(name) and bool(self.marked.text) == bool(
                name
            ):
                return
            page.wait_for_timeout(50)
        raise AssertionError(f"not '{name}' but '{self.marked.text}' is marked")


@pytest.fixture(scope="module")
def near(browser, tmp_path_factory):
    """A page with near pairs of both arms and in itself, its view and its cycle."""
    path, scene = tmp_path_factory.mktemp("ring") / "ring", bay_scene("path")
    guard, rng = Guard(scene, self_test=False), np.random.default_rng(2)
    taped, reader = RecordedGuard(guard, RingWriter(path)), RingReader(path)
    world, tables, pairs = World(None, scene), guard.tables, []
    while len({(pair.a, pair.b) for pair in pairs}) < 3 or not (
        any(pair.a.startswith("right/") for pair in pairs[1:])
        and not any("right/" in pair.a + pair.b for pair in pairs[:1])
    ):
        guard.reset()
        q = rng.uniform(tables.lower, tables.upper)
        taped.step(q, 0.0, velocity=0.0 * q)
        frames = [frame_of(row) for row in reader.unread()]
        frame = [one for one in frames if one.kind is Kind.CYCLE][-1]
        pairs = world.cycle(frame).pairs
    with running(OneCycle(scene, frame)) as view:
        page = browser.new_page(viewport=VIEWPORT)
        page.set_default_timeout(PATIENCE * 1e3)
        page.goto(f"{view.login.link}&fixedDpr=0.1")
        page.locator(".uplot[tabindex]").wait_for()
        yield page, view, pairs
        page.close()


def test_what_is_pointed_at_is_marked_in_the_picture(near):
    page, view, pairs = near
    card = page.locator(".robot[data-name=right]")
    of_right = next(one for one in pairs if "right/" in one.a + one.b)
    other = next(one for one in pairs if pair_name(one) != pair_name(pairs[0]))
    assert of_right is not pairs[0]
    row = page.locator("#root tbody tr", has_text=pair_name(other)).first
    for part, pair in (
        (card, of_right),
        (page.locator(".uplot"), pairs[0]),
        (row, other),
        (page.locator("#why"), None),
    ):
        part.hover(force=True)
        view.marks(page, pair)


def test_what_the_keyboard_focuses_is_marked_in_the_picture(near):
    page, view, pairs = near
    page.locator(".robot[data-name=left]").focus()
    page.keyboard.press("Tab")
    view.marks(page, next(one for one in pairs if "right/" in one.a + one.b))
    page.keyboard.press("Shift+Tab")
    view.marks(page, next(one for one in pairs if "left/" in one.a + one.b))
    page.keyboard.press("Tab")
    page.keyboard.press("Tab")
    view.marks(page, None)
    page.locator(".uplot").focus()
    view.marks(page, pairs[0])


def test_on_a_phone_all_is_one_below_the_other_and_nothing_is_beside_it(near):
    page, view, _ = near
    page.set_viewport_size({"width": 390, "height": 844})

    def boxes():
        parts = "#light", "#why", "#root canvas[data-engine]", "#root [role=tablist]"
        parts += (".uplot",)
        return [page.locator(part).first.bounding_box() for part in parts]

    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        light, why, picture, panel, plot = found = boxes()
        if all(found) and picture["y"] + picture["height"] <= panel["y"]:
            if plot["width"] > 330:
                break
        page.wait_for_timeout(100)
    for above, below in zip((light, why, picture), (why, picture, panel), strict=True):
        assert above["y"] + above["height"] <= below["y"]
    # The picture is seen whole, and as wide as the phone.
    assert (picture["x"], picture["width"]) == (0, 390)
    assert picture["height"] > 200
    assert plot["x"] >= 0 and plot["x"] + plot["width"] <= 390
    assert plot["width"] > 330
    # Of two notes the last one is seen, with its sentence.
    (client,) = view.server.get_clients().values()
    for sentence in ("the first sentence", "the last sentence"):
        client.add_notification("Not done", sentence, auto_close_seconds=None)
        page.get_by_text(sentence).wait_for()
    assert not page.get_by_text("the first sentence").is_visible()
    page.set_viewport_size(VIEWPORT)


def test_a_silent_view_names_what_stops_the_arms_instead_of_it(near):
    page, view, _ = near
    step, view.step = view.step, lambda: None
    try:
        veil = page.get_by_text("STOP may not arrive: use the emergency stop")
        veil.wait_for()
    finally:
        view.step = step
    veil.wait_for(state="hidden")
