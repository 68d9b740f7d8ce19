"""A verdict as a page tells it: who, how near, what it needed, and why."""

from dataclasses import dataclass
from enum import Enum

from armguard.guard.layout import NEAR_COUNT, NEAR_WIDTH
from armguard.guard.levels import SENTENCES, Level, Reason
from armguard.guard.nuisance import Cause
from armguard.guard.verdict import ABOUT_PAIRS, Names, Verdict
from armguard.station.frames import Frame


class Sense(Enum):
    """What a slow or a stop was good for, as far as one cycle tells."""

    NEEDED = "needed"
    """The arms were too near or too fast, or a stop was not what was declared."""

    EARLY = "early"
    """With a closer fit, fresher data or a faster reaction it would have come later, or
    not at all: nobody knows."""

    NEEDLESS = "needless"
    """Nothing was too near: the input could not be believed, or the guard's own limits
    were used up."""

    UNKNOWN = "not known"
    """The cycle does not tell."""


def sense_of(cause: Cause | None, deficit: float | None) -> Sense:
    """What a slow or a stop was good for.

    A stop is ordered in the first cycle that lacks something, so it hardly ever lacks
    much: a length that would have let that cycle pass is no proof that the stop was
    for nothing.

    Args:
        cause: What made it.
        deficit: What it lacked; None where no pair tells [m].
    """
    if cause is None:
        return Sense.UNKNOWN
    if cause in (Cause.TRUE_NEED, Cause.FIGURES):
        return Sense.NEEDED
    return Sense.NEEDLESS if deficit is None else Sense.EARLY


@dataclass(frozen=True, slots=True)
class Spoken:
    """One verdict in words.

    Attributes:
        level: Its level.
        reason: Why it has that level.
        subject: The two bodies, or who a fault is about; "" if all.
        distance: Signed distance of the pair; None if it is about none [m].
        needed: What the pair had to keep, likewise [m].
        clearance: What was left of that [m].
        why: The verdict's sentence.
        budget: What it needed, term by term; "" if nobody knows.
        cause: What made the slow or stop; None if nothing did, or it is not recorded.
        deficit: What it lacked [m].
        remedy: What would have let it pass.
    """

    level: Level
    reason: Reason
    subject: str
    distance: float | None
    needed: float | None
    clearance: float | None
    why: str
    budget: str = ""
    cause: Cause | None = None
    deficit: float | None = None
    remedy: str = ""

    @property
    def sense(self) -> Sense:
        """What it was good for, if it is a slow or a stop."""
        return sense_of(self.cause, self.deficit)

    def to_dict(self) -> dict[str, object]:
        """The same as plain numbers and strings."""
        return {
            "level": self.level.name,
            "reason": self.reason.name,
            "subject": self.subject,
            "distance": self.distance,
            "needed": self.needed,
            "clearance": self.clearance,
            "why": self.why,
            "budget": self.budget,
            "cause": None if self.cause is None else self.cause.value,
            "deficit": self.deficit,
            "remedy": self.remedy,
            "sense": self.sense.value,
        }


def is_whole(frame: Frame, names: Names) -> bool:
    """Whether a cycle's frame holds all near pairs of its verdict."""
    rows = int(frame.verdict[NEAR_COUNT])
    return len(frame.verdict) >= names.first_row + rows * NEAR_WIDTH


def spoken(frame: Frame, names: Names) -> Spoken:
    """The verdict of a cycle in words."""
    fault = str(frame.text.get("fault", ""))
    verdict = Verdict(frame.verdict, names, None, frame.cycle_time, fault)
    reason, level = verdict.reason, verdict.level
    if not is_whole(frame, names):
        told = fault or f"{SENTENCES[reason]} (near pairs are not in the recording)"
        return Spoken(level, reason, "", None, None, None, told)
    nuisance, budget, nearest = verdict.nuisance, verdict.budget, verdict.nearest
    about = nearest if reason in ABOUT_PAIRS and not fault else None
    return Spoken(
        level=level,
        reason=reason,
        subject=verdict.subject if about is None else f"{about.a} – {about.b}",
        distance=None if about is None else about.distance,
        needed=None if about is None else about.primitive_distance - about.clearance,
        clearance=None if about is None else about.clearance,
        why=verdict.why,
        budget="" if about is None or budget is None else budget.sentence,
        cause=None if nuisance is None else nuisance.cause,
        deficit=None if nuisance is None else nuisance.deficit,
        remedy="" if nuisance is None else nuisance.remedy,
    )
