"""The bridge as a process: `python -m armguard.bridges.zenoh_bridge`."""

import argparse
import logging
import sys
from pathlib import Path

from armguard.bridges.zenoh_bridge.bridge import Bridge
from armguard.bridges.zenoh_bridge.settings import LISTEN, BridgeSettings
from armguard.entry import run_program
from armguard.errors import ArmguardError
from armguard.processes import interrupted


def main() -> int:
    """Carry messages until a signal comes."""
    parser = argparse.ArgumentParser(
        "armguard.bridges.zenoh_bridge", description=__doc__
    )
    parser.add_argument("--port", type=int, required=True, help="of the service")
    parser.add_argument("--host", default="127.0.0.1", help="of the service")
    parser.add_argument(
        "--key-file",
        dest="keys",
        metavar="KEY_FILE",
        type=Path,
        help="the service's keys",
    )
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
    given = vars(options)
    wait = given.pop("wait")
    given["listen"] = tuple(options.listen or [LISTEN])
    given["connect"] = tuple(options.connect or [])
    with interrupted() as ended:
        try:
            settings = BridgeSettings(**given)
            bridge = Bridge(settings, timeout=wait)
        except ArmguardError as error:
            print(f"zenoh bridge: {error}", file=sys.stderr)
            return 2
        print(f"keys {settings.root}/** at {', '.join(settings.listen)}", flush=True)
        try:
            bridge.run(ended.is_set)
        finally:
            bridge.close()
    return 0


if __name__ == "__main__":
    run_program(main, "zenoh bridge:")
