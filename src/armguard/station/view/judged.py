"""A frame of a cycle with its words: the verdict and the command it holds."""

from dataclasses import dataclass

from armguard.guard import layout
from armguard.guard.answer import Names
from armguard.guard.levels import Level, Reason, level_of
from armguard.guard.verdict import Verdict
from armguard.respond import Command
from armguard.scene.tables import SceneTables
from armguard.station.frames import Frame


@dataclass(frozen=True, slots=True)
class Judged:
    """A cycle as it was judged.

    Attributes:
        frame: The frame.
        verdict: What its verdict says.
        command: What the robots were told; None where nothing was asked.
    """

    frame: Frame
    verdict: Verdict
    command: Command | None


def judged(frame: Frame, tables: SceneTables, names: Names) -> Judged:
    """The words of a cycle's frame."""
    verdict = Verdict(
        frame.verdict,
        names,
        float(frame.stamps[0]) if len(frame.stamps) else None,
        frame.cycle_time,
        str(frame.text.get("fault", "")),
    )
    command = Command(frame.told, tables.robots, verdict) if len(frame.told) else None
    return Judged(frame, verdict, command)


def level_at_a_glance(frame: Frame, robots: int) -> tuple[int, ...]:
    """Levels of all robots and of the cycle's reason, without names or sentences.

    Args:
        frame: Frame of a cycle.
        robots: Robots the verdict has a row for.
    """
    own = level_of(Reason(int(frame.verdict[layout.REASON])))
    step = layout.ROBOT_WIDTH
    first = layout.HEADER + layout.ROBOT_LEVEL
    each = frame.verdict[first : first + robots * step : step]
    levels = tuple(int(level) for level in each)
    return (max((int(own), *levels), default=int(Level.CLEAR)), *levels)
