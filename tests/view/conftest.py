"""A service, simulated arms, a view and a browser: the real processes of each."""

import os
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
import viser
from websockets.asyncio.client import connect

from armguard.recording.frames import Frame, Kind, frame_of
from armguard.recording.ring import RingReader
from armguard.scene.bay import bay_path
from armguard.simulation.stage import Stage
from armguard.view.live_view import LiveView

CHROMIUM = Path("/usr/bin/chromium")

# Without these it looks for its maker's hosts, and does not run as root.
FLAGS = [
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--enable-unsafe-swiftshader",
]

# Nothing here takes longer, however busy the machine is: the browser draws without a
# graphics card, and lets every other process go first [s].
PATIENCE = 120.0

# Levels at which no arm is stopped, and those that only a reset ends.
MOVING = ("CLEAR", "CAUTION", "SLOW")
BRAKED = ("BRAKE", "HARDWARE_STOP")

# A small page is drawn sooner.
VIEWPORT = {"width": 900, "height": 640}

# An arm, a post in its way, a crate it may not reach, and a box held ready. The period
# is long and may be late, and so may the arm's stop: a browser that draws without a
# graphics card takes its time.
SCENE = f"""\
robots:
  left:
    urdf: {bay_path().parent / "bay_arm.urdf"}
    base: {{xyz: [0, 0, 0.5]}}
    home: {{joint1: 0, joint2: -0.35, joint3: 0, joint4: 1.7, joint5: 0, joint6: 1.25}}
    response: stop
    stopping:
      deceleration: 4.0
      acceleration: 8.0
      delays: {{sensing: 0.003, command: 0.003, stale: 1.0}}

objects:
  floor: {{box: [2, 2, 0.1], at: {{xyz: [0, 0, 0.3]}}}}   # what it stands on
  post: {{box: [0.1, 0.1, 1.4], at: {{xyz: [0.2, 0.32, 1.05]}}}}
  spare: {{box: [0.2, 0.2, 0.2], at: {{xyz: [-1, -1, 1]}}, present: false}}

allow:
  - {{a: left/link1, b: floor, reason: it stands there}}
"""

OPTIONS = ("--rate", "100", "--late", "0.1", "--no-self-test")


class Station:
    """What is running, and a page that shows it.

    Attributes:
        page: The browser's page.
        requests: Addresses the page requested.
        errors: What went wrong in the page.
        scene_file: The scene's file.
        stage: Service and arms.
        link: What lets the browser in.
        address: Where the page is.
    """

    def __init__(self, stage: Stage, page: Any, link: str, scene_file: Path) -> None:
        self.stage, self.page, self.link = stage, page, link
        self.address = link.partition("?")[0]
        self.scene_file = scene_file
        self.requests: list[str] = []
        self.errors: list[str] = []

    def cycles(self) -> list[Frame]:
        """The cycles that are in the ring."""
        ring = RingReader(Path(self.stage.client.welcome.ring))
        rows = [row for row in ring.unread() if int(row[0]) == Kind.CYCLE]
        ring.close()
        return [frame_of(row) for row in rows]

    def newest(self) -> Frame:
        """The newest cycle."""
        return self.cycles()[-1]

    def until(self, what: Callable[[], Any], says: str) -> Any:
        """Wait for something; the pages of the browser go on meanwhile."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            found = what()
            if found:
                return found
            self.page.wait_for_timeout(50)
        self.picture("failed")
        why = self.page.locator("#why").inner_text()
        raise AssertionError(f"after {PATIENCE:.0f} s: {says}; the page says: {why}")

    def tab(self, name: str) -> None:
        """Open a tab of the panel."""
        self.page.get_by_role("tab", name=name).click()

    def button(self, name: str) -> Any:
        """A button of the panel; the bar above may have one of that name too."""
        return self.page.get_by_role("button", name=name).last

    def take(self) -> None:
        """Take the command, unless it is ours."""
        button = self.button("Take the command")
        if button.is_enabled():
            # Unless it is granted meanwhile; then there is nothing to click.
            with suppress(Exception):
                button.click(timeout=1000)

    def lead(self, joint: int) -> None:
        """Lead a joint to its upper end, with the command, and engaged if need be.

        A machine that is busy with drawing may be late for once: then everything is
        stopped and the command may be gone, as it is to be.
        """
        self.take()
        if self.light() in BRAKED:
            self.button("Reset after a brake").click()
        elif self.light() != "CLEAR":
            self.button("Engage all").click()
        # The first slider is the speed's; then come the joints.
        self.page.get_by_role("slider").nth(joint).press("End")

    def clear(self) -> None:
        """Have the arm at rest and clear of all else, engaged if it was stopped."""
        self.engage(("CLEAR",))

    def engage(self, levels: Sequence[str] = MOVING) -> None:
        """Have the arms engaged, reset before where they were braked.

        Args:
            levels: Levels at which nothing is left to do.
        """
        self.tab("Drive")

        def engaged() -> bool:
            if self.light() not in (*levels, "None"):
                self.take()
                if self.light() in BRAKED:
                    self.button("Reset after a brake").click()
                self.button("Engage all").click()
            return self.light() in levels

        self.until(engaged, f"no arm gets to {' or '.join(levels)}")

    def light(self) -> str:
        """The level the light shows."""
        return str(self.page.locator("#light").get_attribute("data-level"))

    def picture(self, name: str) -> None:
        """Keep a picture of the page."""
        folder = os.environ.get("ARMGUARD_PICTURES")
        if folder:
            self.page.screenshot(path=Path(folder) / f"{name}.png")


@pytest.fixture(scope="module")
def browser(tmp_path_factory: Any) -> Iterator[Any]:
    """Chromium without a window; without one the tests are skipped."""
    if not CHROMIUM.exists():
        pytest.skip(f"there is no browser at {CHROMIUM}")
    playwright = pytest.importorskip("playwright.sync_api")
    # It draws with the processors that the loop runs on: let that go first.
    polite = tmp_path_factory.mktemp("browser") / "chromium"
    polite.write_text(f'#!/bin/sh\nexec nice -n 19 {CHROMIUM} "$@"\n')
    polite.chmod(0o755)
    with playwright.sync_playwright() as tools:
        found = tools.chromium.launch(executable_path=str(polite), args=FLAGS)
        yield found
        found.close()


@pytest.fixture(scope="module")
def station(browser: Any, tmp_path_factory: Any) -> Iterator[Station]:
    """A service with an arm, and its view in a page."""
    folder = tmp_path_factory.mktemp("station")
    file = folder / "scene.yaml"
    file.write_text(SCENE, encoding="utf-8")
    with (
        (folder / "log").open("wb") as log,
        Stage(str(file), *OPTIONS, log=log) as stage,
    ):
        stage.start_service()
        stage.wait_for_service()
        stage.start_arms()
        with shown(stage.port) as (process, link):
            del process
            page = browser.new_page(viewport=VIEWPORT)
            page.set_default_timeout(PATIENCE * 1e3)
            yield opened(Station(stage, page, link, file))
            page.close()


class shown:
    """A view of a service, as a process of its own."""

    def __init__(self, port: int, *words: str) -> None:
        self._words = (
            *(sys.executable, "-m", "armguard", "view"),
            *("--port", str(port), "--page-port", "0", *words),
        )

    def __enter__(self) -> tuple[subprocess.Popen[str], str]:
        self._process = subprocess.Popen(self._words, stdout=subprocess.PIPE, text=True)
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if "http://" not in line:
            self.__exit__()
            raise AssertionError("the view did not start; it said why above")
        return self._process, line.split()[-1]

    def __exit__(self, *_: object) -> None:
        self._process.terminate()
        self._process.wait(timeout=PATIENCE)
        if self._process.stdout is not None:
            self._process.stdout.close()


def let_in(link: str) -> dict[str, str]:
    """Follow a link as a browser does; the headers that its sockets have from then on.

    Args:
        link: A link that was not used yet.
    """
    with urllib.request.urlopen(link, timeout=PATIENCE) as answer:
        cookie = answer.headers["Set-Cookie"].partition(";")[0]
    return {"Cookie": cookie, "Origin": link.partition("/?")[0]}


def channel_of(link: str, page: str = "one") -> str:
    """Address of the page's channel, for a page of some name."""
    return link.replace("http", "ws").partition("?")[0] + f"station?page={page}"


def opened(station: Station) -> Station:
    """Open the page, listening to all it requests; whatever is outside is refused."""
    page = station.page

    def ask(route: Any) -> None:
        station.requests.append(route.request.url)
        ours = route.request.url.startswith((station.address, "blob:", "data:"))
        if ours:
            route.continue_()
        else:
            route.abort()

    def hear(message: Any) -> None:
        if message.type == "error":
            station.errors.append(message.text)

    page.on("console", hear)
    page.on("pageerror", lambda error: station.errors.append(str(error)))
    page.on("websocket", lambda socket: station.requests.append(socket.url))
    page.route("**", ask)
    # Drawn coarsely: here no graphics card draws, but the processors that do the rest.
    sharpness = 1.0 if os.environ.get("ARMGUARD_PICTURES") else 0.1
    page.goto(f"{station.link}&fixedDpr={sharpness}")
    station.until(lambda: station.light() not in ("None", ""), "no light")
    page.get_by_role("tab", name="Drive").wait_for(timeout=PATIENCE * 1e3)
    # Viser says that it draws without a graphics card; that is so.
    notice = page.get_by_text("Software WebGL rendering detected")
    if notice.count():
        page.locator("[class*=Notification] button").first.click(force=True)
    return station


@pytest.fixture(scope="module")
def stage(tmp_path_factory: Any) -> Iterator[Stage]:
    """A service with an arm, without a browser."""
    folder = tmp_path_factory.mktemp("station")
    file = folder / "scene.yaml"
    file.write_text(SCENE, encoding="utf-8")
    with (folder / "log").open("wb") as log:
        with Stage(str(file), *OPTIONS, log=log) as made:
            made.start_service()
            made.wait_for_service()
            made.start_arms()
            yield made


@contextmanager
def running(view: LiveView) -> Iterator[LiveView]:
    """A view that draws in a thread."""
    end = threading.Event()
    thread = threading.Thread(target=view.run, args=(end.is_set,))
    thread.start()
    try:
        yield view
    finally:
        end.set()
        thread.join()
        view.close()


@pytest.fixture(scope="module")
def live(stage: Stage) -> Iterator[tuple[LiveView, dict[str, str]]]:
    """The view of the station, and the headers of a browser that was let in."""
    with running(LiveView(stage.port, 0)) as view:
        yield view, let_in(view.login.link)


def until(what: Callable[[], Any], seconds: float = 30.0) -> bool:
    """Wait until something is true; whether it is."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if what():
            return True
        time.sleep(0.01)
    return False


async def greet(view: LiveView, browser: dict[str, str]) -> tuple[Any, Any]:
    """A page's channel, and its socket of viser's, that were both opened."""
    channel = connect(
        channel_of(view.login.link), additional_headers=browser, max_queue=None
    )
    scene = connect(
        f"ws://127.0.0.1:{view.server.get_port()}/?page=one",
        additional_headers=browser,
        subprotocols=[f"viser-v{viser.__version__}"],
        # What is to be drawn is not read.
        max_queue=None,
    )
    return channel, scene
