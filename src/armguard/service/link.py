"""Questions that programs of one user ask each other, beside a service.

The program that answers listens on a port of loopback. A file beside the service's
keys, which this user alone reads, has the port and a word that every question has to
show.
"""

import json
import os
import secrets
import socket
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from armguard.service.wire.keys import keys_path

LOOPBACK = "127.0.0.1"

# Longest question, and longest answer [bytes].
MOST = 60_000

# How long an answer is waited for [s].
PATIENCE = 0.05


def link_path(port: int, kind: str) -> Path:
    """File of the program that answers beside the service on a port.

    Args:
        port: Port of the service.
        kind: Kind of program: "rig" or "line".
    """
    return keys_path(port).with_suffix(f".{kind}")


class LinkEnd:
    """The end that answers.

    Args:
        port: Port of the service.
        kind: See `link_path`.
    """

    def __init__(self, port: int, kind: str) -> None:
        self._path, self._word = link_path(port, kind), secrets.token_hex(16)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((LOOPBACK, 0))
        self._socket.setblocking(False)
        text = f"{self._socket.getsockname()[1]} {self._word}"
        self._path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        self._path.unlink(missing_ok=True)
        handle = os.open(self._path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(handle, "w") as file:
            file.write(text)

    def answer(self, reply: Callable[[dict[str, Any]], Mapping[str, Any]]) -> None:
        """Answer the questions that came; those without the word are left out.

        Args:
            reply: Makes the answer to a question, ready for JSON.
        """
        while True:
            try:
                data, address = self._socket.recvfrom(MOST)
            except OSError:
                return
            with suppress(
                ValueError, TypeError, AttributeError, OSError, RecursionError
            ):
                question = json.loads(data)
                if secrets.compare_digest(str(question.get("word")), self._word):
                    text = json.dumps(reply(question), allow_nan=False)
                    self._socket.sendto(text.encode(), address)

    def close(self) -> None:
        """Remove the file, and release the port."""
        self._path.unlink(missing_ok=True)
        self._socket.close()


def ask(
    port: int, kind: str, question: Mapping[str, Any] | None = None
) -> dict[str, Any] | None:
    """The answer of a program beside a service; None if there is none.

    Args:
        port: Port of the service.
        kind: See `link_path`.
        question: The question, ready for JSON.
    """
    try:
        to, _, word = link_path(port, kind).read_text("utf-8").partition(" ")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
            one.settimeout(PATIENCE)
            one.connect((LOOPBACK, int(to)))
            one.send(json.dumps({**(question or {}), "word": word}).encode())
            found: dict[str, Any] = json.loads(one.recv(MOST))
            return found
    except (OSError, ValueError):
        return None
