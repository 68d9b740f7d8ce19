"""Response: filter of the operators' desired motion to safe commands."""

from armguard.respond.command import Action, Blocked, Changed, Command, Held
from armguard.respond.guard import Guard
from armguard.respond.responses import RESPONSES, ResponseKind

__all__ = [
    "RESPONSES",
    "Action",
    "Blocked",
    "Changed",
    "Command",
    "Guard",
    "Held",
    "ResponseKind",
]
