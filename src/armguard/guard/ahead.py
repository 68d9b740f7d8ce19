"""How long an announced plan is proven from a cycle on, as a verdict has it."""

from dataclasses import asdict, dataclass
from enum import Enum
from math import inf


class AheadReason(Enum):
    """What ends the lead of a cycle."""

    NO_PLAN = "no plan is announced"
    PROVEN = "every pair is proven to keep its distance to the end of the plan"
    NEAR = "a pair may be too near"
    UNPROVEN = "later places are not proven yet"
    CROWDED = "more pairs are near than a cycle can judge"
    NOT_FOLLOWED = (
        "a joint is farther from the plan than its following error; announce a plan "
        "from where the arms are"
    )
    STOPPED = "the guard stops a robot; announce a plan from where the arms are"
    CHANGED = "held objects or checked pairs changed; announce the plan again"


@dataclass(frozen=True, slots=True)
class Ahead:
    """How long the announced plan is proven from a cycle on.

    Attributes:
        reason: What ends the lead.
        lead: Time from the cycle to the first place that is not proven [s]. Infinite if
            all the rest is proven; 0 where nothing is claimed.
        needed: Reaction and stop of the robots concerned, from their present speed in
            the plan [s]: those of the pair, else all. 0 if all the rest is proven;
            infinite where nothing is claimed, or where one has no stopping figures.
        a: One link or object of the pair; empty if no pair ends the lead.
        b: The other.
    """

    reason: AheadReason
    lead: float = 0.0
    needed: float = inf
    a: str = ""
    b: str = ""

    @property
    def enough(self) -> bool:
        """Whether the robots concerned can still come to rest within the lead."""
        return self.lead >= self.needed

    @property
    def sentence(self) -> str:
        """The answer in words."""
        if self.needed == inf and self.lead == 0.0:
            return self.reason.value
        pair = f": {self.a} to {self.b}" if self.a else ""
        lead = "no end" if self.lead == inf else f"{self.lead:.3f} s"
        return (
            f"lead {lead}, reaction and stop {self.needed:.3f} s: "
            f"{self.reason.value}{pair}"
        )

    def to_dict(self) -> dict[str, object]:
        """The answer as plain numbers and strings; infinity stays."""
        return {**asdict(self), "reason": self.reason.name, "enough": self.enough}


NO_PLAN = Ahead(AheadReason.NO_PLAN)
