"""Rights of the service's clients."""

from enum import IntEnum


class Role(IntEnum):
    """What the holder of a key may do; each role includes those before it."""

    OBSERVE = 1
    """Receive commands, ask what they mean, and order a stop."""

    SENSE = 2
    """Place and remove the objects that the scene calls movable."""

    COMMAND = 3
    """Send states of robots, claim the command, and command."""

    ADMINISTER = 4
    """Take the command from its holder, change settings, change fixtures at rest."""

    @property
    def word(self) -> str:
        """The role as key files and messages for people name it."""
        return self.name.lower()
