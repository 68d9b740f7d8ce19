"""Who commands, as far as a client has heard."""

from typing import NamedTuple

from armguard.station.wire.layout import CLAIM, GRANT


class Grant(NamedTuple):
    """The answer to a claim.

    Attributes:
        granted: Whether it was granted.
        token: What the commander shows with every wish.
        holder: Who has the command now.
    """

    granted: bool
    token: int
    holder: int


class Command:
    """Whether this client has it.

    Attributes:
        token: What it shows with every wish; 0 if it does not command.
        grant: What its last claim was answered with; None if it was not yet.
        claimed: Whether `Client.cycle` has claimed it.
    """

    def __init__(self) -> None:
        self.token = 0
        self.grant: Grant | None = None
        self.claimed = False

    def write(self, payload: memoryview, force: bool) -> int:
        """Write a CLAIM; how many bytes it has."""
        self.grant = None
        CLAIM.pack_into(payload, 0, force, 0)
        return CLAIM.size

    def take(self, payload: memoryview) -> None:
        """Take a GRANT over."""
        granted, _, token, holder, _, _ = GRANT.unpack_from(payload)
        self.grant = Grant(bool(granted), token, holder)
