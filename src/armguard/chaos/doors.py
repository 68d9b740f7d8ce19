"""What comes in by other ways than the service's port: the page, Zenoh, and files."""

import json
import re
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec

from armguard.chaos.fault import Unplayable
from armguard.chaos.playground import Playground
from armguard.service.wire.keys import keys_path

# Longest start of a process beside the guard [s].
START = 120.0

# How long an answer of the page is waited for [s].
ANSWER = 2.0

# Requested sockets, and forged commands.
TRIES = 20

# Requests a socket of the page, as a page of another site does.
HANDSHAKE = (
    "GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nOrigin: http://evil.example\r\n"
    "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
)

# A bomb of merged keys, a nesting, and a mesh outside of the scene's folder.
MERGES = "a0: &a0 {k: 1}\n" + "".join(
    f"a{k}: &a{k} {{<<: [{', '.join([f'*a{k - 1}'] * 9)}], k{k}: 1}}\n"
    for k in range(1, 10)
)
OUTSIDE = "objects: {stolen: {mesh: ../../../../../../etc/hostname.stl}}\n"
BOMBS = {"merges": MERGES, "depth": "[" * 5000, "outside": OUTSIDE}


@contextmanager
def page_of_another_site(ground: Playground) -> Iterator[None]:
    """A page of another site requests sockets of the operator's page."""
    if find_spec("viser") is None:
        raise Unplayable("the page needs the extra 'view'")
    own = ("-m", "armguard.view", "--page-port", "0")
    line = started(ground, "page", own, r"http://127\.0\.0\.1:(\d+)/\?token=")
    port = int(line[1])
    ground.settle()
    ground.begin()
    for _ in range(TRIES):
        for path in ("/station", "/"):
            if opens(port, path):
                raise AssertionError("a page of another site opened a socket")
    yield
    ground.stage.crew.end_one("page")


def opens(port: int, path: str) -> bool:
    """Whether a socket opens for a page of another site."""
    with socket.create_connection(("127.0.0.1", port), ANSWER) as one:
        one.sendall(HANDSHAKE.format(path=path, port=port).encode() + b"\x82\x80mask")
        one.settimeout(ANSWER)
        try:
            return b" 101 " in one.recv(4096)
        except OSError:
            return False


@contextmanager
def command_over_zenoh(ground: Playground) -> Iterator[None]:
    """A client of the Zenoh bridge puts commands, which are the bridge's alone."""
    if find_spec("zenoh") is None:
        raise Unplayable("Zenoh needs the extra 'station'")
    import zenoh

    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{one.getsockname()[1]}"
    own = ("-m", "armguard.bridges.zenoh_bridge", "--listen", endpoint)
    started(ground, "bridge", own, re.escape(endpoint))
    ground.settle()
    ground.begin()
    config = zenoh.Config()
    for key, value in (
        ("mode", "client"),
        ("connect/endpoints", [endpoint]),
        ("scouting/multicast/enabled", False),
    ):
        config.insert_json5(key, json.dumps(value))
    heard: list[bytes] = []

    def take(sample: zenoh.Sample) -> None:
        heard.append(sample.payload.to_bytes())

    with zenoh.open(config) as listener, zenoh.open(config) as forger:
        listener.declare_subscriber("armguard/guard/command", take)
        ground.watch_until(lambda: bool(heard), START)
        for _ in range(TRIES):
            forger.put("armguard/guard/command", b"forged")
            ground.watch(0.01)
    if not heard:
        raise AssertionError("the bridge puts no commands")
    if b"forged" in heard:
        raise AssertionError("a forged command was passed on")
    yield
    ground.stage.crew.end_one("bridge")


@contextmanager
def hostile_scenes(ground: Playground) -> Iterator[None]:
    """Scenes that are made to hurt are checked beside the guard: one sentence each."""
    for name, text in BOMBS.items():
        refuse(ground, name, text)
    # The programs kept this machine busy; what counts is that the guard goes on.
    ground.settle()
    ground.begin()
    yield


def refuse(ground: Playground, name: str, text: str) -> None:
    """Check a scene beside the guard, which has to be refused in a sentence.

    Raises:
        AssertionError: It was not.
    """
    path, log = ground.folder / f"{name}.yaml", ground.folder / f"{name}.log"
    path.write_text(text, encoding="utf-8")
    with log.open("wb") as file:
        words = ("-m", "armguard", "check", str(path))
        check = ground.stage.crew.start(name, words, log=file)
    ground.watch_until(lambda: check.poll() is not None, START)
    said = log.read_text(errors="replace")
    if check.poll() != 2 or "Traceback" in said:
        raise AssertionError(
            f"'{name}' ends with code {check.poll()}: {said.strip()[-200:]}"
        )


def started(
    ground: Playground, name: str, words: tuple[str, ...], says: str
) -> re.Match[str]:
    """Start a process beside the guard, and wait for what it says.

    Raises:
        AssertionError: It does not say so in time.
    """
    port = ground.stage.port
    option = "--service" if name == "page" else "--port"
    log = ground.folder / f"{name}.log"
    keyed = (option, str(port), "--key-file", str(keys_path(port)))
    with log.open("wb") as file:
        ground.stage.crew.start(name, (*words, *keyed), log=file)

    def found() -> re.Match[str] | None:
        return re.search(says, log.read_text(errors="replace"))

    ground.watch_until(lambda: found() is not None, START)
    match = found()
    if match is None:
        tail = log.read_text(errors="replace").strip()[-200:]
        raise AssertionError(f"the {name} does not start: {tail}")
    return match
