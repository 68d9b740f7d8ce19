"""The guard: the cycle from joint angles to a verdict."""

from armguard.guard.answer import Counts
from armguard.guard.budget import ProtectiveDistance
from armguard.guard.contract import Contract, Region
from armguard.guard.events import Event, EventLog
from armguard.guard.levels import Level, Reason
from armguard.guard.monitor import Monitor
from armguard.guard.near_pair import NearPair
from armguard.guard.nuisance import Cause, Nuisance
from armguard.guard.self_test import SelfTestLine, SelfTestReport, self_test
from armguard.guard.verdict import Verdict

__all__ = [
    "Cause",
    "Contract",
    "Counts",
    "Event",
    "EventLog",
    "Level",
    "Monitor",
    "NearPair",
    "Nuisance",
    "ProtectiveDistance",
    "Reason",
    "Region",
    "SelfTestLine",
    "SelfTestReport",
    "Verdict",
    "self_test",
]
