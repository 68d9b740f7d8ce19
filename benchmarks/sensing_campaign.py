"""Maps of cells beside OctoMap and FCL; writes docs/sensing.json and docs/sensing.md.

make sensing ARGS=FOLDER    with the recorded images of a folder, see `sensing.images`
make sensing                with computed images alone
make sensing ARGS=--own     what needs no image and no peer, into the last results
make sensing ARGS=--page    the page from the last results
make sensing ARGS=--json    figures of computed images to standard output
"""

import json
import sys
from pathlib import Path
from typing import Any

from episodes.campaign import command
from pages import DOCS, rendered
from sensing import distances, rates
from sensing.images import recorded, room
from speed import sense
from timing import describe_machine, version_of

RESULTS = DOCS / "sensing.json"

PEERS = ("octomap-python", "python-fcl")


def measured(folders: list[str]) -> dict[str, Any]:
    """All figures."""
    images = [image for folder in folders for image in recorded(Path(folder))]
    images.append(room())
    found = {
        "machine": describe_machine(),
        "peers": {name: version_of(name) for name in PEERS},
        "rates": rates.measure(images),
        "distances": distances.measure(images),
        "frames": frames(),
    }
    if found["peers"]["octomap-python"] is None:
        print(rates.PEER_MISSING, file=sys.stderr)
    return found


def frames() -> dict[str, Any]:
    """Whole frames of sensors."""
    return sense.bench(sense.CYCLES, lambda sentence: None)


def measured_again() -> dict[str, Any]:
    """The last figures, with new ones of all that needs no image and no peer."""
    found: dict[str, Any] = json.loads(RESULTS.read_text(encoding="utf-8"))
    found["rates"] |= rates.own_figures()
    found["frames"] = frames()
    return found


def main() -> int:
    """Measure, unless only the page is wanted, and write; 1 if a peer is missing."""
    parser = command(__doc__)
    parser.add_argument("folders", nargs="*", metavar="FOLDER")
    for option in ("--own", "--page", "--json"):
        parser.add_argument(option, action="store_true")
    chosen = parser.parse_args()
    if chosen.json:
        print(json.dumps(measured(chosen.folders), indent=1))
        return 0
    if not (chosen.own or chosen.page) and version_of("octomap-python") is None:
        # The page would lose the peer's figures.
        print(rates.PEER_MISSING, file=sys.stderr)
        return 1
    if not chosen.page:
        found = measured_again() if chosen.own else measured(chosen.folders)
        text = json.dumps(found, indent=1)
        RESULTS.write_text(text + "\n", encoding="utf-8")
    figures = json.loads(RESULTS.read_text(encoding="utf-8"))
    (DOCS / "sensing.md").write_text(rendered("sensing", **figures), encoding="utf-8")
    print("wrote docs/sensing.md")
    return 0


if __name__ == "__main__":
    sys.exit(main())
