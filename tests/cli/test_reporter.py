"""Events that the demo prints."""

from types import SimpleNamespace

import pytest
from rich.console import Console

from armguard.cli.demo import Reporter, too_busy
from armguard.guard import Level
from armguard.guard.events import Event
from armguard.guard.levels import Reason


def stop_of(reason):
    """A stop that began in a late cycle."""
    return Event(
        first=3,
        last=40,
        began=0.012,
        ended=0.16,
        level=Level.STOP,
        reason=reason,
        a="left/hand",
        b="right/hand",
        least_headroom=-0.001,
        distance=0.004,
        at=5,
        stamp=0.02,
        why="left/hand 4 mm from right/hand: stop, must keep 5 mm",
    )


@pytest.mark.parametrize(
    ("reason", "printed"),
    [
        (Reason.TOO_CLOSE, True),
        (Reason.STOP_LAGS, True),
        (Reason.CYCLE_LATE, False),
        (Reason.STATE_STALE, False),
    ],
)
def test_only_stops_ordered_for_lateness_are_left_out(reason, printed):
    event = stop_of(reason)
    log = SimpleNamespace(start=0.0, finish=lambda: event)
    tally = SimpleNamespace(log=log, too_busy=True)
    console = Console(record=True, width=200, quiet=False, file=None)
    Reporter(tally, verbose=False, quiet=False).finish(console)
    assert ("4 mm from right/hand" in console.export_text()) is printed


def test_a_busy_computer_is_named_with_what_came_late():
    late = SimpleNamespace(delay=0.042, late=0.03)
    assert "a cycle came 42 ms late, 30 ms are permitted. Each" in too_busy(late)
    stale = SimpleNamespace(delay=0.017, late=0.03)
    assert " ms" not in too_busy(stale)
