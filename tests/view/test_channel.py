"""The page's own channel: which page may listen, how fast a level is there, its end."""

import asyncio
import contextlib
import json
import socket
import time
import urllib.error
import urllib.request
from pathlib import Path

import numpy as np
import pytest
import viser
from tests.view.conftest import channel_of, let_in
from websockets.asyncio.client import connect

from armguard import Guard, bay_scene
from armguard.guard.verdict import Verdict
from armguard.recording.recorded import RecordedGuard
from armguard.recording.ring import RingWriter
from armguard.view.live_view import LiveFrames
from armguard.view.view import View

PATIENCE = 20.0

# What no page of ours says; none of it ends a channel.
NONSENSE = (
    "no JSON",
    "[1]",
    "[" * 10_000,
    b"\x00\xff",
    json.dumps({"type": ["stop"]}),
)


class Loop:
    """A loop that judges on demand, and a view that reads its ring."""

    def __init__(self, folder: Path) -> None:
        scene = bay_scene("path")
        scene.period = 0.01
        self.guard = Guard(scene, self_test=False)
        self.ring = RingWriter(folder / "ring")
        self.taped = RecordedGuard(self.guard, self.ring)
        self.heard: list[object] = []
        self.view = View(scene, 0, lambda *said: self.heard.append(said))
        self.browser = let_in(self.view.login.link)
        self.frames = LiveFrames(folder / "ring", self.view.publish, lambda frame: None)
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


def listening(loop, **headers):
    """A page on the channel, in a browser that was let in; some headers otherwise.

    A header that is None is left out.
    """
    wanted = {**loop.browser, **headers}
    sent = {name: value for name, value in wanted.items() if value is not None}
    return connect(channel_of(loop.view.login.link), additional_headers=sent)


async def states_of(page, seconds):
    """States that the page gets within some time."""
    found = []
    try:
        async with asyncio.timeout(seconds):
            while True:
                message = json.loads(await page.recv())
                if message["type"] == "state":
                    found.append(message)
    except TimeoutError:
        return found


def test_every_change_of_a_level_is_sent_with_its_sentence(loop):
    async def listen():
        messages, changes, before = [], [], None
        async with listening(loop) as page:
            # One cycle in thirty cannot be read: a stop that is over soon.
            for k in range(120):
                verdict = loop.cycle(readable=k % 30 != 20)
                levels = (verdict.level, *verdict.levels.values())
                if levels != before:
                    changes.append((k, verdict))
                before = levels
                messages += await states_of(page, 0.02)
            messages += await states_of(page, 0.5)
            await page.send(json.dumps({"type": "stop"}))
            for nonsense in NONSENSE:
                await page.send(nonsense)
            await page.send(json.dumps({"type": "stop"}))
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
    while ("one", {"type": "gone"}) not in loop.heard and time.monotonic() < end:
        time.sleep(0.01)
    assert loop.heard == [("one", {"type": kind}) for kind in ("stop", "stop", "gone")]
    assert len(loop.view.cue_delays) == len(changes) - 1


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://example.org"},
        {"Origin": "http://127.0.0.1:1"},
        {"Origin": None},
        {"Cookie": None},
        {"Cookie": "armguard-{port}=guessed"},
        {"Cookie": "armguard-1={secret}"},
        {"Host": "example.org"},
        {"Host": "localhost:1"},
    ],
)
def test_sockets_of_others_are_hung_up_on(loop, headers):
    secret = loop.browser["Cookie"].partition("=")[2]
    port = loop.view.page.port
    changed = {
        name: value and value.format(port=port, secret=secret)
        for name, value in headers.items()
    }
    answers = [
        raw(to, request(to, path, {**loop.browser, **changed}))
        for to, path in ((port, "/station"), (loop.view.server.get_port(), "/"))
    ]
    assert answers == [b"", b""]


def request(port, path, headers):
    """The text of a socket's request; a header that is None is left out."""
    lines = {
        "Host": f"127.0.0.1:{port}",
        "Upgrade": "websocket",
        "Connection": "Upgrade",
        "Sec-WebSocket-Key": "x3JJHMbDL1EzLkh9GBhXDw==",
        "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Protocol": f"viser-v{viser.__version__}",
        **headers,
    }
    head = [f"{name}: {value}" for name, value in lines.items() if value is not None]
    return "\r\n".join([f"GET {path} HTTP/1.1", *head, "", ""]).encode()


def raw(port, text):
    """All that a port answers to some bytes."""
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as one:
        one.sendall(text)
        answer = b""
        with contextlib.suppress(ConnectionResetError):
            while part := one.recv(4096):
                answer += part
        return answer


def test_sockets_of_our_own_page_open_on_both_ports(loop):
    async def greet(port, path):
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(request(port, path, loop.browser))
        line = await asyncio.wait_for(reader.readline(), PATIENCE)
        writer.close()
        return line

    for port, path in (
        (loop.view.page.port, "/station"),
        (loop.view.server.get_port(), "/?page=one"),
    ):
        assert b"101" in asyncio.run(greet(port, path))


def ask(loop, path="", **headers):
    """Request a file of the page; what comes back."""
    address = loop.view.login.link.partition("?")[0] + path
    one = urllib.request.Request(address, headers=headers)
    return urllib.request.urlopen(one, timeout=PATIENCE)


def test_only_its_own_files_are_given_and_only_to_browsers_that_were_let_in(loop):
    cookie = {"Cookie": loop.browser["Cookie"]}
    with ask(loop, **cookie) as answer:
        assert "station.js" in answer.read().decode()
        policy = answer.headers["Content-Security-Policy"]
        assert "default-src 'self'" in policy and f":{loop.view.page.port}" in policy
        assert answer.headers["Server"] is None
    for path in ("../view.py", "nothing", "page_server.py"):
        with pytest.raises(urllib.error.HTTPError, match="404"):
            ask(loop, path, **cookie)
    for path in ("", "station.js"):
        with pytest.raises(urllib.error.HTTPError, match="403") as refused:
            ask(loop, path)
        assert b"open the link that armguard printed last" in refused.value.read()


@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "example.org"},
        {"Sec-Fetch-Mode": "no-cors", "Sec-Fetch-Dest": "empty"},
        {"Sec-Fetch-Mode": "cors", "Sec-Fetch-Dest": "empty"},
        {"Sec-Fetch-Mode": "navigate", "Sec-Fetch-Dest": "iframe"},
        {"Sec-Fetch-Mode": "no-cors", "Sec-Fetch-Dest": "script"},
    ],
)
@pytest.mark.parametrize("known", [True, False])
def test_what_another_page_requests_is_not_answered(loop, headers, known):
    cookie = {"Cookie": loop.browser["Cookie"]} if known else {}
    with pytest.raises(OSError) as refused:
        ask(loop, "", **cookie, **{"Sec-Fetch-Site": "same-site"}, **headers)
    assert not isinstance(refused.value, urllib.error.HTTPError)


def test_a_link_lets_one_browser_in_and_the_next_one_reads_why_not(loop):
    login = loop.view.login
    links = []
    login.used = links.append
    used = login.link
    another = let_in(used)
    assert another["Cookie"] != loop.browser["Cookie"]
    assert links == [login.link] != [used]
    with pytest.raises(urllib.error.HTTPError, match="403"):
        let_in(used)
    assert len(links) == 1
    for browser in (another, loop.browser):
        with ask(loop, Cookie=browser["Cookie"]) as answer:
            assert answer.status == 200


def test_the_cookie_is_kept_from_scripts_and_from_other_sites(loop):
    with urllib.request.urlopen(loop.view.login.link, timeout=PATIENCE) as answer:
        name, *rest = answer.headers["Set-Cookie"].split("; ")
    assert name.startswith(f"armguard-{loop.view.page.port}=")
    assert set(rest) == {"HttpOnly", "SameSite=Strict", "Path=/"}


def test_a_port_that_is_taken_is_an_error_in_words(loop):
    with pytest.raises(Exception, match=f"port {loop.view.page.port}.*--page-port"):
        View(bay_scene("path"), loop.view.page.port, loop.heard.append)
