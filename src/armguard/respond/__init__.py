"""Act: what to tell the robots, so that what their operators ask for stays safe."""

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
