"""The guard's words for numbers that came in a message.

They live where the guard does, which takes a second to import; a client does so once,
when it connects, and never in its loop.
"""

from functools import cache
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from armguard.guard.levels import Level, Reason
    from armguard.respond.command import Action, Blocked


class Words(NamedTuple):
    """The enumerations."""

    level: "type[Level]"
    reason: "type[Reason]"
    action: "type[Action]"
    blocked: "type[Blocked]"


@cache
def words() -> Words:
    """All of them."""
    from armguard.guard.levels import Level, Reason
    from armguard.respond.command import Action, Blocked

    return Words(Level, Reason, Action, Blocked)
