"""A mistake, and three parts of its answer."""

from typing import Any, NamedTuple


class Mistake(NamedTuple):
    """A mistake, and three parts of its answer.

    Attributes:
        value: The wrong value, as the answer has it.
        place: Where it is: file and line, key, joint, robot, object or argument.
        remedy: What to do.
        given: The mistake itself: a text, or what makes it; see the test of its door.
        logged: Whether the answer is a warning of the log, and the input is used.
    """

    value: str
    place: str
    remedy: str
    given: Any
    logged: bool = False

    def missing(self, said: str) -> list[str]:
        """Parts that an answer does not hold."""
        return [part for part in self[:3] if part not in said]
