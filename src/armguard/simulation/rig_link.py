"""What programs ask of simulated sensors: which are at fault, where the boxes are.

The rig listens on a port of loopback. A file beside the service's keys, which this user
alone reads, has the port and a word that every question has to show.
"""

import json
import os
import secrets
import socket
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from armguard.service.wire.keys import keys_path

LOOPBACK = "127.0.0.1"

# Faults: no distance is measured; no frame comes; stamps are a second ahead, or ten
# seconds back.
FAULTS = ("blind", "lost", "ahead", "back")

# Longest question, and longest answer [bytes].
MOST = 60_000

# How long an answer is waited for [s].
PATIENCE = 0.05


def link_path(port: int) -> Path:
    """File of the rig beside the service on a port.

    Args:
        port: Port of the service.
    """
    return keys_path(port).with_suffix(".rig")


class RigEnd:
    """The rig's end.

    Attributes:
        faults: Faults of sensors by name, of `FAULTS`.

    Args:
        port: Port of the service.
        state: Further values of the answers, ready for JSON.
    """

    def __init__(self, port: int, state: dict[str, Any]) -> None:
        self.faults: dict[str, str] = {}
        self._state, self._path = state, link_path(port)
        self._word = secrets.token_hex(16)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((LOOPBACK, 0))
        self._socket.setblocking(False)
        text = f"{self._socket.getsockname()[1]} {self._word}"
        self._path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        self._path.unlink(missing_ok=True)
        handle = os.open(self._path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(handle, "w") as file:
            file.write(text)

    def hear(self, names: list[str]) -> None:
        """Answer the questions that came; those without the word are left out.

        Args:
            names: Names of the sensors.
        """
        while True:
            try:
                data, address = self._socket.recvfrom(MOST)
            except OSError:
                return
            with suppress(
                ValueError, TypeError, AttributeError, OSError, RecursionError
            ):
                asked = json.loads(data)
                if not secrets.compare_digest(str(asked.get("word")), self._word):
                    continue
                if "faults" in asked:
                    found = asked["faults"].items()
                    known = [(k, v) for k, v in found if k in names and v in FAULTS]
                    self.faults = dict(known)
                answer = {"faults": self.faults, **self._state}
                self._socket.sendto(json.dumps(answer).encode(), address)

    def close(self) -> None:
        """Remove the file, and release the port."""
        self._path.unlink(missing_ok=True)
        self._socket.close()


def ask_rig(
    port: int, faults: Mapping[str, str] | None = None
) -> dict[str, Any] | None:
    """State of the simulated sensors beside a service; None if there are none.

    Args:
        port: Port of the service.
        faults: Faults of sensors from now on, by name; as before if None.

    Returns:
        `faults`: as above; `boxes`: for each box `size` [m] and `xyz` [m].
    """
    try:
        to, _, word = link_path(port).read_text("utf-8").partition(" ")
        question: dict[str, Any] = {"word": word}
        if faults is not None:
            question["faults"] = dict(faults)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
            one.settimeout(PATIENCE)
            one.connect((LOOPBACK, int(to)))
            one.send(json.dumps(question).encode())
            found: dict[str, Any] = json.loads(one.recv(MOST))
            return found
    except (OSError, ValueError):
        return None
