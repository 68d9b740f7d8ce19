"""`python -m armguard.service.mapping`: the map beside a service."""

import argparse
import logging
import signal
from pathlib import Path

from armguard.entry import run_program
from armguard.errors import StationError
from armguard.processes import end_with
from armguard.service.mapping.process import MapLink, MapProcess
from armguard.service.server.scenes import open_scene

# How long the service gets to answer at first [s].
PATIENCE = 30.0

LOOPBACK = ("127.0.0.1", "localhost")


def main() -> None:
    """Fill the map of a service until the process is ended."""
    words = argparse.ArgumentParser(prog="python -m armguard.service.mapping")
    words.add_argument("scene", help="the service's")
    words.add_argument("--service", required=True, metavar="HOST:PORT")
    words.add_argument("--port", type=int, default=0, help="for frames")
    words.add_argument("--record", type=Path, help="file for positions and frames")
    words.add_argument("--key-file", type=Path, help="the service's keys")
    words.add_argument("--parent", type=int, help="ends with that process")
    asked = words.parse_args()
    if asked.parent is not None:
        end_with(asked.parent)
    fill_map(asked.scene, asked.service, asked.port, asked.record, asked.key_file)


def fill_map(
    what: str, service: str, port: int = 0, record: Path | None = None,
    keys: Path | None = None,
) -> None:  # fmt: skip
    """Fill the map of a service until the process is asked to end.

    Args:
        what: The scene, see `open_scene`.
        service: Host and port of the service, on this machine.
        port: Port for frames; 0 for a free one.
        record: File for joint positions and frames.
        keys: File with the service's keys.

    Raises:
        StationError: The service is not on this machine, does not answer, or has
            another scene; a port is taken.
        ArmguardError: The scene cannot be used.
    """
    logging.basicConfig(level=logging.INFO, format="%(levelname)s map: %(message)s")
    ending: list[int] = []
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda got, _: ending.append(got))
    with MapLink(port_of(service), keys) as link:
        welcome = link.connect(PATIENCE)
        late = float(welcome.text["late"])
        scene, _ = open_scene(what, period=welcome.period, late=late)
        MapProcess(scene, link, port, record).run(lambda: bool(ending))


def port_of(service: str) -> int:
    """The port in `HOST:PORT`.

    Raises:
        StationError: It is none, or the host is another machine, where no positions can
            be read.
    """
    host, _, port = service.rpartition(":")
    if host not in LOOPBACK or not port.isdecimal() or not 0 < int(port) < 65536:
        raise StationError(
            f"the service is '{service}'; it must be 127.0.0.1:PORT, as in "
            "127.0.0.1:47800: the map runs on the machine of its service"
        )
    return int(port)


if __name__ == "__main__":
    run_program(main, "map:")
