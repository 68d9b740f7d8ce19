"""Decide: the cycle from joint angles to verdict."""

from armguard.guard.events import Event, EventLog
from armguard.guard.guard import Guard
from armguard.guard.levels import SENTENCES, Level, Reason, level_of
from armguard.guard.verdict import Counts, NearPair, Verdict

__all__ = [
    "SENTENCES",
    "Counts",
    "Event",
    "EventLog",
    "Guard",
    "Level",
    "NearPair",
    "Reason",
    "Verdict",
    "level_of",
]
