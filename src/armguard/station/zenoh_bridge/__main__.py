"""The bridge as a process: `python -m armguard.station.zenoh_bridge`."""

import argparse
import logging
import signal
import sys
from pathlib import Path

from armguard.entry import run_program
from armguard.errors import ArmguardError
from armguard.station.zenoh_bridge.bridge import Bridge
from armguard.station.zenoh_bridge.settings import LISTEN, BridgeSettings


def main() -> int:
    """Carry messages until a signal comes."""
    parser = argparse.ArgumentParser(
        "armguard.station.zenoh_bridge", description=__doc__
    )
    parser.add_argument("--port", type=int, required=True, help="of the service")
    parser.add_argument("--host", default="127.0.0.1", help="of the service")
    parser.add_argument("--key-file", type=Path, help="the service's keys")
    parser.add_argument("--listen", action="append", help=f"endpoint, else {LISTEN}")
    parser.add_argument("--connect", action="append", help="endpoint, of a router say")
    parser.add_argument("--prefix", default="armguard", help="keys begin with it")
    parser.add_argument("--name", default="guard", help="follows the prefix")
    parser.add_argument(
        "--companion", action="store_true", help="end when the service is gone"
    )
    parser.add_argument("--wait", type=float, default=10.0, help="for the service [s]")
    options = parser.parse_args()
    logging.basicConfig(format="zenoh bridge: %(message)s", level=logging.INFO)
    ended: list[int] = []
    for name in (signal.SIGTERM, signal.SIGINT):
        signal.signal(name, lambda number, frame: ended.append(number))
    try:
        settings = BridgeSettings(
            port=options.port,
            host=options.host,
            keys=options.key_file,
            listen=tuple(options.listen or [LISTEN]),
            connect=tuple(options.connect or []),
            prefix=options.prefix,
            name=options.name,
            companion=options.companion,
        )
        bridge = Bridge(settings, timeout=options.wait)
    except ArmguardError as error:
        print(f"zenoh bridge: {error}", file=sys.stderr)
        return 2
    print(f"keys {settings.root}/** at {', '.join(settings.listen)}", flush=True)
    try:
        bridge.run(lambda: bool(ended))
    finally:
        bridge.close()
    return 0


if __name__ == "__main__":
    run_program(main, "zenoh bridge:")
