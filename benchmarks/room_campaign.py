"""How much room a guard leaves, beside the least that would do; writes docs/room.md.

make room                            all of it, a quarter of an hour
make room ARGS="--only passing"      one of the measurements, the others as they were
make room ARGS="--page"              the page from the last results
"""

from collections.abc import Callable, Mapping
from typing import Any

from armguard.cli.console import say
from episodes.campaign import command
from episodes.records import keep, read
from pages import DOCS
from room import approaches, passing
from room.page import write_page
from room.walls import measure_head_on, measure_walls

RESULTS = DOCS / "room.json"

SPEEDS = (0.1, 0.25, 0.4, 0.6)  # [m/s]

MEASUREMENTS: Mapping[str, Callable[[int], list[dict[str, Any]]]] = {
    "approaches": lambda count: approaches.measure(count, SPEEDS),
    "passing": lambda count: passing.measure(max(count // 4, 1), SPEEDS),
    "co_braking": lambda _: measure_head_on(),
    "least_buffer": lambda _: measure_walls(),
}


def main() -> None:
    """Measure, write docs/room.json, docs/room.md and plots."""
    parser = command(__doc__)
    parser.add_argument("--only", choices=tuple(MEASUREMENTS))
    parser.add_argument("--approaches", type=int, default=24)
    parser.add_argument("--page", action="store_true", help="from the last results")
    chosen = parser.parse_args()
    for name, measure in MEASUREMENTS.items():
        if chosen.page or chosen.only not in (None, name):
            continue
        keep(RESULTS, name, measure(chosen.approaches), chosen.approaches)
    write_page(read(RESULTS), DOCS)
    say("wrote docs/room.md")


if __name__ == "__main__":
    main()
