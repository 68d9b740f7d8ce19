"""The guard's words for numbers that came in a message.

They live where the guard does, which takes a second to import; a client does so once,
when it connects, and never in its loop.
"""

from functools import cache
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from armguard.guard.levels import Level, Reason
    from armguard.respond.command import Action, Blocked, Held


class Words(NamedTuple):
    """The enumerations, and what a robot is that waits."""

    level: "type[Level]"
    reason: "type[Reason]"
    action: "type[Action]"
    blocked: "type[Blocked]"
    held: "type[Held]"


@cache
def words() -> Words:
    """All of them."""
    from armguard.guard.levels import Level, Reason
    from armguard.respond.command import Action, Blocked, Held

    return Words(Level, Reason, Action, Blocked, Held)
