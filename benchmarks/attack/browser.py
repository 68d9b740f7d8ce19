"""Attacks on the live view: by raw sockets, and by pages of other origins in Chromium.

A station with simulated arms runs, its view has the command, and handles are up at all
tools. An attack has succeeded where anything of a message was done, or an arm moved.
"""

import itertools
import json
import os
import socket
import tempfile
import threading
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import viser
from websockets.frames import Frame, Opcode

from armguard.errors import NoServiceError
from armguard.simulation.stage import Stage
from armguard.view.live_view import LiveView
from attack.target import free_port

CHROMIUM = Path("/usr/bin/chromium")

# Without these it looks for its maker's hosts, and does not run as root.
FLAGS = [
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]

OPTIONS = ("--rate", "100", "--late", "0.5", "--stale", "1.0", "--no-self-test")

# Sockets that a page of another origin opens at a time.
AT_A_TIME = 40

# An answer, or its absence, takes no longer [s].
PATIENCE = 10.0

# A service on a busy machine answers its first clients within this time [s].
STARTS = 60.0

# An arm that follows a handle for so long is seen to move [s], by so much [rad].
SETTLES, MOVED = 1.0, 1e-3

EVIL = "http://evil.example"


class Target:
    """A station and its view, with all that the view does on behalf of pages counted.

    Attributes:
        view: The view, in this process.
        done: What it did, by name.
    """

    def __init__(self, stage: Stage) -> None:
        self.view = patiently(lambda: LiveView(stage.port, 0))
        self.done: dict[str, int] = {}
        self.view.drive.handles.show(True)
        driver, commander = self.view.driver, self.view.commander
        for owner, name in (
            (driver, "lead_tool"),
            (driver.jog, "receive"),
            (commander, "claim"),
            (commander, "give_back"),
            (commander, "call"),
            (commander, "stop"),
        ):
            setattr(owner, name, self._counted(name, getattr(owner, name)))
        self.ports = (self.view.page.port, self.view.server.get_port())
        self._end = threading.Event()
        self._thread = threading.Thread(target=self.view.run, args=(self._end.is_set,))
        self._thread.start()

    def take_command(self) -> None:
        """Wait for the arms, take the command, and let them follow."""
        while self.view.source.newest is None:
            time.sleep(0.05)
        commander = self.view.commander
        assert commander.claim() and commander.call("engage")

    @property
    def q(self) -> Any:
        """Where the arms are, shape (n,) [rad]."""
        frame = self.view.source.newest
        assert frame is not None
        return np.array(frame.q)

    @property
    def link(self) -> str:
        """What lets a browser in."""
        return self.view.login.link

    def messages(self) -> list[bytes]:
        """What an attacker sends to viser: drags of all handles, clicks of buttons."""
        drags: list[dict[str, Any]] = [
            {
                "type": "TransformControlsUpdateMessage",
                "name": f"/handles/{part.name}",
                "wxyz": [1, 0, 0, 0],
                "position": [0.5, 0.4, 0.7],
                "owner": "",
            }
            for part in self.view.world.tables.robots
        ]
        clicks: list[dict[str, Any]] = [
            {
                "type": "GuiUpdateMessage",
                "uuid": button._impl.uuid,
                "updates": {"value": True},
            }
            for button in (self.view.drive._take, self.view.drive._give)
        ]
        return [msgspec.msgpack.encode(message) for message in (*drags, *clicks)]

    def close(self) -> None:
        """Let go of everything."""
        self._end.set()
        self._thread.join()
        self.view.close()

    def _counted(self, name: str, does: Callable[..., Any]) -> Callable[..., Any]:
        def count(*words: Any, **named: Any) -> Any:
            # That a hand let go is no deed.
            if name != "lead_tool" or words[1] is not None:
                self.done[name] = self.done.get(name, 0) + 1
            return does(*words, **named)

        return count


def patiently(make: Callable[[], LiveView]) -> LiveView:
    """A view, once its service has time to answer."""
    end = time.monotonic() + STARTS
    while True:
        try:
            return make()
        except NoServiceError:
            if time.monotonic() > end:
                raise


def run(raw: int, sockets: int) -> dict[str, Any]:
    """Attack a view in all ways.

    Args:
        raw: Requests of a raw client with messages right behind them.
        sockets: Sockets that pages of other origins open in Chromium.

    Returns:
        By kind of attack: tries, what was answered or opened, and what was done.
    """
    with ExitStack() as stack:
        log = stack.enter_context(tempfile.TemporaryFile())
        stage = stack.enter_context(Stage("bay", *OPTIONS, log=log))
        stage.start_service()
        stage.wait_for_service()
        stage.start_arms()
        target = stack.enter_context(closing(Target(stage)))
        target.take_command()
        return {
            "raw": watched(target, lambda: raw_attack(target, raw)),
            "chromium": watched(target, lambda: page_attack(target, sockets)),
        }


def watched(target: Target, attack: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """An attack, what was done because of it, and how far an arm moved meanwhile."""
    before, furthest = target.q, 0.0
    target.done.clear()
    found: dict[str, Any] = {}
    thread = threading.Thread(target=lambda: found.update(attack()))
    thread.start()
    end = np.inf
    while time.monotonic() < end:
        furthest = max(furthest, float(np.abs(target.q - before).max()))
        if end == np.inf and not thread.is_alive():
            end = time.monotonic() + SETTLES
        time.sleep(0.01)
    moved = furthest if furthest > MOVED else 0.0
    return {**found, "done": dict(target.done), "moved_rad": moved}


def raw_attack(target: Target, tries: int) -> dict[str, Any]:
    """Messages sent together with the handshake, under many names and origins."""
    cookie = cookie_of(target.link)
    own = f"http://127.0.0.1:{target.ports[0]}"
    ways: list[tuple[str | None, str | None, str | None]] = [
        # Host, origin, cookie; None for one that is left out, the right host if "".
        ("", EVIL, None),
        ("", None, None),
        ("", own, None),
        ("", own, f"armguard-{target.ports[0]}=guessed"),
        ("", EVIL, cookie),
        ("", None, cookie),
        ("", "null", cookie),
        ("", "http://127.0.0.1:1", cookie),
        ("evil.example", own, cookie),
        (None, own, cookie),
    ]
    to_viser = [frame(Opcode.BINARY, message) for message in target.messages()]
    # Not a stop: after it nothing that follows could be seen to move an arm.
    keys = json.dumps({"type": "keys", "held": ["KeyW"]}).encode()
    to_channel = [frame(Opcode.TEXT, keys)]
    page, scene = target.ports
    answered = opened = 0
    doors = (scene, "/", to_viser), (page, "/station", to_channel)
    each = itertools.cycle(itertools.product(ways, doors))
    for (host, origin, given), door in itertools.islice(each, tries):
        port, path, frames = door
        lines = {
            "Host": f"127.0.0.1:{port}" if host == "" else host,
            "Origin": origin,
            "Cookie": given,
            "Upgrade": "websocket",
            "Connection": "Upgrade",
            "Sec-WebSocket-Key": "x3JJHMbDL1EzLkh9GBhXDw==",
            "Sec-WebSocket-Version": "13",
            "Sec-WebSocket-Protocol": f"viser-v{viser.__version__}",
        }
        head = [f"{name}: {line}" for name, line in lines.items() if line is not None]
        text = "\r\n".join([f"GET {path} HTTP/1.1", *head, "", ""]).encode()
        answer = first_answer(port, text + b"".join(frames))
        answered += bool(answer)
        opened += b" 101 " in answer
    return {"tries": tries, "answered": answered, "opened": opened}


def first_answer(port: int, text: bytes) -> bytes:
    """The first bytes that a port answers; empty if it hangs up."""
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as one:
        with suppress(ConnectionError):
            one.sendall(text)
            return one.recv(256)
    return b""


def frame(kind: Opcode, message: bytes) -> bytes:
    """A frame as a client sends it."""
    return Frame(kind, message).serialize(mask=True)


def cookie_of(link: str) -> str:
    """The cookie of a browser that followed a link; empty if it got none."""
    with urllib.request.urlopen(link, timeout=PATIENCE) as answer:
        return str(answer.headers["Set-Cookie"] or "").partition(";")[0]


# Functions that run in pages.
OPEN, LEARN = (
    Path(__file__).with_name(f"{name}.js").read_text("utf-8")
    for name in ("open_sockets", "learn_of_port")
)


def page_attack(target: Target, count: int) -> dict[str, Any]:
    """Pages of another site and of another port, in the operator's own browser."""
    from playwright.sync_api import sync_playwright

    messages = [list(message) for message in target.messages()]
    protocol = f"viser-v{viser.__version__}"
    page_port, scene_port = target.ports
    with ExitStack() as stack:
        other = stack.enter_context(other_site())
        tools = stack.enter_context(sync_playwright())
        browser = tools.chromium.launch(
            executable_path=str(CHROMIUM), args=FLAGS, env={**os.environ}
        )
        context = browser.new_context()
        context.set_default_timeout(0)
        # The operator's browser has been let in: its cookie goes wherever it may.
        own = context.new_page()
        own.goto(target.link, wait_until="commit")
        own.close()
        opened, learnt = 0, []
        for host in ("localhost", "127.0.0.1"):
            page = context.new_page()
            page.goto(f"http://{host}:{other}/")
            share = count // 2
            opened += page.evaluate(
                OPEN, [scene_port, protocol, messages, share, AT_A_TIME]
            )
            closed = page.evaluate(LEARN, free_port(socket.SOCK_STREAM))
            learnt += [
                port
                for port in (page_port, scene_port)
                if page.evaluate(LEARN, port) != closed
            ]
            page.close()
        browser.close()
    return {
        "tries": 2 * (count // 2),
        "opened": opened,
        "ports_told_from_closed_ones": len(learnt),
    }


@contextmanager
def other_site() -> Iterator[int]:
    """A server of another origin with an empty page; its port."""

    class Empty(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(b"<!doctype html><body></body>")

        def log_message(self, *_: object) -> None:
            return

    server = ThreadingHTTPServer(("127.0.0.1", 0), Empty)
    thread = threading.Thread(target=partial(server.serve_forever, 0.05), daemon=True)
    thread.start()
    try:
        yield server.server_port
    finally:
        server.shutdown()
        server.server_close()
