"""What came of an attack."""

from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A row of the table.

    Attributes:
        door: What was attacked.
        attack: What was done.
        tried: How often.
        had: How often it had its effect.
        unit: What is counted as its effect.
        target: What is to come of it, in words.
        passed: Whether it did.
        note: What else is to be known.
        figures: Further figures, for the JSON.
    """

    door: str
    attack: str
    tried: int
    had: int
    unit: str
    target: str
    passed: bool
    note: str = ""
    figures: dict[str, Any] = field(default_factory=dict)


def none(
    door: str,
    attack: str,
    tried: int,
    had: int,
    *,
    unit: str = "accepted",
    wanted: int = 0,
    note: str = "",
    **figures: Any,
) -> Row:
    """A row of what is never to have an effect.

    Args:
        door: See `Row`.
        attack: See `Row`.
        tried: See `Row`.
        had: See `Row`.
        unit: See `Row`.
        wanted: Least number of tries that make it a result.
        note: See `Row`.
        figures: See `Row`.
    """
    return Row(
        door=door,
        attack=attack,
        tried=tried,
        had=had,
        unit=unit,
        target="0",
        passed=had == 0 and tried >= max(wanted, 1),
        note=note,
        figures=figures,
    )
