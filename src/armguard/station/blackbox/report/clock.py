"""One clock for recordings of several runs: a machine that starts anew counts anew."""

from collections.abc import Iterable, Iterator
from dataclasses import replace

from armguard.station.blackbox.report.words import duration
from armguard.station.frames import Frame

# What the next run begins later by if the wall clock does not say [s].
LEAST_BREAK = 1.0


def on_one_clock(frames: Iterable[Frame], notes: list[str]) -> Iterator[Frame]:
    """Frames whose monotonic clock does not go back.

    Where it does, another run of the machine began: what follows is moved to where the
    wall clock says it is, or right behind what was before.

    Args:
        frames: Frames in their order.
        notes: Gets a sentence for each such place.
    """
    shift, last, wall, before = 0.0, -float("inf"), 0.0, 0
    for frame in frames:
        if frame.monotonic + shift < last:
            later = max(frame.wall - wall, LEAST_BREAK)
            shift = last + later - frame.monotonic
            notes.append(
                f"another run of the machine begins {duration(later)} after cycle "
                f"{before}; its monotonic clock began anew"
            )
        last, wall, before = frame.monotonic + shift, frame.wall, frame.cycle
        yield frame if not shift else moved(frame, shift)


def moved(frame: Frame, shift: float) -> Frame:
    """A frame at a later time [s]."""
    return replace(
        frame,
        monotonic=frame.monotonic + shift,
        ended=frame.ended + shift,
        received=frame.received + shift,
    )
