"""Pictures of the live view, of a recording and of a report, to be looked at.

python benchmarks/page_pictures.py FOLDER [--only held person] [--recording FILE]

Service, simulated arms, an operator and the view run as in `make demo`; headless
Chromium draws the page without a graphics card. Each state is kept in the size of a
desktop and of a phone. Nothing is judged here.
Needs playwright and a Chromium that is installed.
"""

import argparse
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from playwright.sync_api import Page, sync_playwright

from armguard.guard.levels import Level
from armguard.recording import open_recording
from armguard.recording.frames import Frame, Kind
from armguard.service.client import Client
from armguard.service.wire import Role
from armguard.simulation.stage import Stage
from armguard.view.view import View
from armguard.view.world import held_in, levels_of
from cue_times import CHROMIUM, FLAGS

# Names and sizes of the screens [px].
SIZES = {"desktop": (1280, 800), "phone": (390, 844)}

# Nothing here takes longer [s].
PATIENCE = 120.0

# As the demo on a busy computer has it, and a rate that leaves time for the browser.
OPTIONS = ("--rate", "100", "--late", "0.08", "--stale", "0.2", "--no-self-test")

# Simulated sensors and the frontier take more of the computer.
SENSING = ("--rate", "50", "--late", "0.3", "--stale", "1.5", "--no-self-test")

# Velocity of every first joint towards the other arm [rad/s].
INWARD = 0.3


class Pictures:
    """A page, and the folder of its pictures.

    Args:
        page: The browser's page.
        folder: Where pictures are kept.
        only: Begins of the names that are kept; all if empty.
    """

    def __init__(self, page: Page, folder: Path, only: list[str]) -> None:
        self.page, self._folder, self._only = page, folder, only

    def wanted(self, name: str) -> bool:
        """Whether pictures of this name are kept, or some whose names begin with it."""
        return not self._only or any(
            name.startswith(one) or one.startswith(name) for one in self._only
        )

    def keep(
        self,
        name: str,
        ready: Callable[[], bool] = lambda: True,
        whole: bool = False,
        first: Callable[[], None] = lambda: None,
    ) -> None:
        """Keep a picture of each size, each once the page is ready.

        Args:
            name: Begin of the files' names.
            ready: Whether the page is ready.
            whole: Whether to keep all of the page, not only what the screen shows.
            first: Brings the page into its state; another size shows the first tab.
        """
        if not self.wanted(name):
            return
        for size, (width, height) in SIZES.items():
            self.page.set_viewport_size({"width": width, "height": height})
            # Viser and the header fit themselves to the size, the plot last.
            self.page.wait_for_timeout(3000)
            first()
            until(ready, self.page)
            path = self._folder / f"{name}-{size}.png"
            self.page.screenshot(path=path, full_page=whole, timeout=PATIENCE * 1e3)
            print(path, flush=True)

    def level(self, *names: str) -> Callable[[], bool]:
        """Whether the light has one of these levels."""
        light = self.page.locator("#light")
        return lambda: light.get_attribute("data-level") in names

    def says(self, words: str) -> Callable[[], bool]:
        """Whether the sentence has these words."""
        return lambda: words in self.page.locator("#why").inner_text()


def main() -> int:
    """Keep all pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--recording", type=Path, help="else that of held arms")
    chosen = parser.parse_args()
    folder: Path = chosen.folder
    folder.mkdir(parents=True, exist_ok=True)
    with sync_playwright() as tools:
        browser = tools.chromium.launch(executable_path=CHROMIUM, args=list(FLAGS))
        pictures = Pictures(browser.new_page(), folder, chosen.only)
        pictures.page.set_default_timeout(PATIENCE * 1e3)
        live = ("clear", "slow", "person", "drive", "edit", "silent")
        if any(map(pictures.wanted, live)):
            keep_live(pictures)
        if any(map(pictures.wanted, ("sensed", "blindfolded"))):
            keep_sensed(pictures)
        recording: Path | None = chosen.recording
        if recording is None:
            recording = keep_held(pictures, folder / "recordings")
        elif pictures.wanted("held"):
            keep_held(pictures, folder / "recordings")
        if pictures.wanted("still"):
            keep_still(pictures, recording)
        keep_recording(pictures, recording, folder / "report.html")
        browser.close()
    return 0


def keep_live(pictures: Pictures) -> None:
    """Keep the states of arms that are driven, by a commander or in the page."""
    page = pictures.page
    # Arms that slow down, and are not deflected, stay slow as long as they are led.
    with Stage("bay", "--response", "slow", *OPTIONS) as stage:
        begin(stage)
        with shown("--port", str(stage.port)) as (view, link):
            open_page(page, link)
            pictures.keep("clear", pictures.level("CLEAR", "CAUTION"))
            with moving_inward(stage, releases=True):
                pictures.keep("slow", pictures.level("SLOW"))
                page.locator("#stop").click(force=True)
                pictures.keep("person", pictures.says("STOPPED BY A PERSON"))
                # The first click asks whether to take the command from its holder.
                while page.locator("#drive").is_visible():
                    page.locator("#drive").click(force=True)
                    page.wait_for_timeout(2000)
                pictures.keep("drive", first=partial(show_drive, page))
            pictures.keep("edit", first=partial(refuse_edit, page))
            os.kill(view.pid, signal.SIGSTOP)
            pictures.keep("silent", lambda: page.locator(":root.grey").count() > 0)
            os.kill(view.pid, signal.SIGCONT)


def keep_sensed(pictures: Pictures) -> None:
    """Keep two arms among what sensors see, then with the camera blindfolded."""
    page = pictures.page
    with Stage("sensed-table", "--simulated-sensors", *SENSING) as stage:
        begin(stage)
        stage.start_operator()
        with shown("--port", str(stage.port)) as (_, link):
            open_page(page, link)
            show = partial(press, page, "tab", "Sensors", "Blindfold: far_skin")
            moving = pictures.level("CLEAR", "CAUTION", "SLOW")
            seeing = page.get_by_text("in order")
            pictures.keep(
                "sensed", lambda: moving() and seeing.count() == 5, first=show
            )
            press(page, "button", "Blindfold: top", "See again: top")
            pictures.keep("blindfolded", pictures.level("STOP", "HELD"), first=show)


def keep_held(pictures: Pictures, recordings: Path) -> Path:
    """Keep arms that the guard stopped and holds; a recording of them."""
    words = ("--response", "stop", "--record", str(recordings), *OPTIONS)
    with Stage("bay", *words) as stage:
        begin(stage)
        with shown("--port", str(stage.port)) as (_, link), moving_inward(stage):
            open_page(pictures.page, link)
            pictures.keep("held", pictures.level("HELD"))
    return max(recordings.glob("**/*.mcap"), key=lambda path: path.stat().st_mtime)


class StillView(View):
    """The live page on a cycle that stays, so that no busy machine changes it.

    Attributes:
        frame: The cycle.
    """

    frame: Frame

    def step(self) -> None:
        """Draw the cycle as the present one."""
        may = {"role": "command", "engage": True, "taken": False, "commands": False}
        self.page.publish("may", may)
        self.draw(self.frame)
        self.publish(replace(self.frame, monotonic=time.monotonic()))


def keep_still(pictures: Pictures, recording: Path) -> None:
    """Keep the live page at a recorded cycle of each level, and at one with a hold."""
    found = open_recording(recording)
    scene = found.scene()
    view = StillView(scene, 0, lambda *said: None)
    cycles: dict[str, Frame] = {}
    names, robots = ["clear", "caution", "slow", "stop"], len(view.world.names.robots)
    for frame in found.frames():
        if frame.kind is Kind.CYCLE and len(frame.poses) and len(frame.verdict):
            name = Level(levels_of(frame, robots)[0]).name.lower()
            cycles.setdefault("held" if any(held_in(frame, robots)) else name, frame)
    view.frame = cycles["clear"]
    ended = threading.Event()
    drawing = threading.Thread(target=view.run, args=(ended.is_set,))
    drawing.start()
    open_page(pictures.page, view.login.link)
    for name in (*names, "held"):
        if name in cycles:
            view.frame = cycles[name]
            pictures.keep(f"still-{name}", pictures.level(name.upper()))
    ended.set()
    drawing.join()
    view.close()


def keep_recording(pictures: Pictures, recording: Path, report: Path) -> None:
    """Keep a recording at its first stop, and its report."""
    page = pictures.page
    if pictures.wanted("recording"):
        with shown(str(recording)) as (_, link):
            open_page(page, link)
            pictures.keep("recording")
    if pictures.wanted("report"):
        command = ("-m", "armguard", "report", str(recording), "--out", str(report))
        subprocess.run([sys.executable, *command], check=True)
        page.goto(report.absolute().as_uri())
        pictures.keep("report", whole=True)


def begin(stage: Stage) -> None:
    """Start service and arms."""
    stage.start_service()
    stage.wait_for_service()
    stage.start_arms()


def open_page(page: Page, link: str) -> None:
    """Open a page, and close viser's note on the missing graphics card."""
    page.goto(link)
    page.locator("#light[data-level]").wait_for()
    page.locator(".uplot[tabindex] canvas").wait_for()
    page.wait_for_timeout(5000)
    note = page.locator("[class*=Notification] button")
    if note.count():
        note.first.click(force=True)
    page.mouse.move(0, 0)


def press(page: Page, role: str, name: str, then: str) -> None:
    """Press a tab or a button of the panel, and wait for a text that follows."""
    page.get_by_role(role, name=name).last.click(force=True)  # type: ignore[arg-type]
    page.get_by_text(then).last.wait_for()


def show_drive(page: Page) -> None:
    """Show how the arms are driven, once the page has the command."""
    press(page, "tab", "Drive", "Give it back")


def refuse_edit(page: Page) -> None:
    """Try an edit that is refused."""
    press(page, "tab", "Edit", "Write to the scene file")
    press(page, "button", "Write to the scene file", "Not done")
    page.wait_for_timeout(2000)


@contextmanager
def shown(*words: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A view as a separate process, and its link."""
    view = subprocess.Popen(
        [sys.executable, "-m", "armguard", "view", *words, "--page-port", "0"],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert view.stdout is not None
        yield view, view.stdout.readline().split()[-1]
    finally:
        view.terminate()
        view.wait()


@contextmanager
def moving_inward(stage: Stage, releases: bool = False) -> Iterator[None]:
    """A commander that leads both arms towards each other, whatever happens.

    Args:
        stage: Service and arms.
        releases: Whether it sends zero velocity to release arms that are held.
    """
    ended = threading.Event()

    def command() -> None:
        with Client(stage.port, role=Role.COMMAND, name="commander") as client:
            client.connect()
            client.claim()
            velocities = np.array([inward(name) for name in client.welcome.names])
            while not ended.wait(0.02):
                held = releases and bool(client.latest.held)
                client.send_velocities(0.0 * velocities if held else velocities)
                # Reads answers, so that the service knows that this client lives.
                client.receive()

    commander = threading.Thread(target=command)
    commander.start()
    try:
        yield
    finally:
        ended.set()
        commander.join()


def inward(joint: str) -> float:
    """Velocity of a joint that leads its arm towards the other one [rad/s]."""
    if not joint.endswith("/joint1"):
        return 0.0
    return -INWARD if joint.startswith("left/") else INWARD


def until(ready: Callable[[], bool], page: Page) -> None:
    """Wait until something is true of a page.

    Raises:
        TimeoutError: It is not, after a long time.
    """
    end = time.monotonic() + PATIENCE
    while not ready():
        if time.monotonic() > end:
            raise TimeoutError(page.locator("#why").inner_text())
        page.wait_for_timeout(20)


if __name__ == "__main__":
    sys.exit(main())
