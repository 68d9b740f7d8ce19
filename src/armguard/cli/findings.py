"""One line of `armguard check`."""

from dataclasses import dataclass
from typing import Literal

Status = Literal["PASS", "WARN", "FAIL"]


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the check.

    Attributes:
        topic: What was looked at.
        status: PASS, WARN or FAIL.
        sentence: What was found.
        remedy: What to do about it, "" if nothing.
    """

    topic: str
    status: Status
    sentence: str
    remedy: str = ""
