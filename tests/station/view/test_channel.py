"""The page's own channel: who may listen, how fast a level is there, what ends it."""

import asyncio
import json
import time
import urllib.error
import urllib.request
from pathlib import Path

import numpy as np
import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus

from armguard import Guard, bay_scene
from armguard.guard.verdict import Verdict
from armguard.station.recorded import RecordedGuard
from armguard.station.ring import RingWriter
from armguard.station.view.live import LiveFrames
from armguard.station.view.view import View

PATIENCE = 20.0


class Loop:
    """A loop that judges when it is told to, and a view that reads its ring."""

    def __init__(self, folder: Path) -> None:
        scene = bay_scene("path")
        scene.period = 0.01
        self.guard = Guard(scene, self_test=False)
        self.ring = RingWriter(folder / "ring")
        self.taped = RecordedGuard(self.guard, self.ring)
        self.heard: list[object] = []
        self.view = View(scene, 0, self.heard.append)
        self.frames = LiveFrames(folder / "ring", self.view.cue, lambda frame: None)
        self.frames.start()
        self.stamp = 0.0

    def cycle(self, readable: bool = True) -> Verdict:
        """One cycle; a stop if it cannot be read."""
        q = self.guard.home if readable else np.full_like(self.guard.home, np.nan)
        self.stamp += 0.01
        still = np.zeros_like(self.guard.home)
        return self.taped.step(q, self.stamp, velocity=still)

    def close(self) -> None:
        self.frames.close()
        self.view.close()
        self.ring.close()


@pytest.fixture(scope="module")
def loop(tmp_path_factory):
    made = Loop(tmp_path_factory.mktemp("loop"))
    yield made
    made.close()


def listening(loop, origin):
    """A page of some origin on the channel."""
    address = loop.view.page.address.replace("http", "ws") + "station"
    return connect(address, origin=origin)


async def told(page, seconds):
    """States the page is told of within some time."""
    found = []
    try:
        async with asyncio.timeout(seconds):
            while True:
                message = json.loads(await page.recv())
                if message["type"] == "state":
                    found.append(message)
    except TimeoutError:
        return found


def test_every_change_of_a_level_is_told_with_its_sentence(loop):
    async def listen():
        messages, changes, before = [], [], None
        origin = loop.view.page.address.rstrip("/")
        async with listening(loop, origin) as page:
            # One cycle in thirty cannot be read: a stop that is over soon.
            for k in range(120):
                verdict = loop.cycle(readable=k % 30 != 20)
                levels = (verdict.level, *verdict.levels.values())
                if levels != before:
                    changes.append((k, verdict))
                before = levels
                messages += await told(page, 0.02)
            messages += await told(page, 0.5)
            await page.send(json.dumps({"type": "stop"}))
            await page.send("no JSON")
            await page.send(json.dumps([1]))
        return messages, changes

    messages, changes = asyncio.run(listen())
    assert len(changes) >= 8
    by_cycle = {message["cycle"]: message for message in messages}
    for cycle, verdict in changes:
        message = by_cycle[cycle]
        assert message["name"] == verdict.level.name
        assert message["why"] == verdict.why
        names = {robot["name"]: robot["level"] for robot in message["robots"]}
        assert names == {name: int(level) for name, level in verdict.levels.items()}
    end = time.monotonic() + PATIENCE
    while {"type": "gone"} not in loop.heard and time.monotonic() < end:
        time.sleep(0.01)
    assert loop.heard == [{"type": "stop"}, {"type": "gone"}]
    assert len(loop.view.cue_delays) == len(changes) - 1


def test_pages_of_others_are_refused(loop):
    async def listen(origin):
        async with listening(loop, origin):
            pass

    for origin in ("http://example.org", None, "http://127.0.0.1:1"):
        with pytest.raises(InvalidStatus):
            asyncio.run(listen(origin))
    scene = f"ws://127.0.0.1:{loop.view.server.get_port()}"

    async def look():
        import viser

        protocol = f"viser-v{viser.__version__}"
        async with connect(
            scene, origin="http://example.org", subprotocols=[protocol]
        ) as page:
            async with asyncio.timeout(PATIENCE):
                while True:
                    await page.recv()

    with pytest.raises(Exception, match="1008"):
        asyncio.run(look())


def test_only_its_own_files_are_given_and_only_under_its_own_name(loop):
    address = loop.view.page.address
    with urllib.request.urlopen(address, timeout=PATIENCE) as answer:
        page = answer.read().decode()
        assert "station.js" in page
        assert "default-src 'self'" in answer.headers["Content-Security-Policy"]
    for path in ("../view.py", "nothing", "page_server.py"):
        with pytest.raises(urllib.error.HTTPError, match="404"):
            urllib.request.urlopen(address + path, timeout=PATIENCE)
    stranger = urllib.request.Request(address, headers={"Host": "example.org"})
    with pytest.raises(urllib.error.HTTPError, match="403"):
        urllib.request.urlopen(stranger, timeout=PATIENCE)


def test_a_port_that_is_taken_is_an_error_in_words(loop):
    with pytest.raises(Exception, match=f"port {loop.view.page.port}.*--page-port"):
        View(bay_scene("path"), loop.view.page.port, loop.heard.append)
