"""What came out of an episode."""

from dataclasses import asdict, dataclass, field
from typing import Any

from closed_loop.watch import Contact


@dataclass(slots=True)
class Stop:
    """One stop of one arm.

    Attributes:
        arm: Its name.
        time: When it was ordered [s].
        reason: Why, in one word of the guard.
        speed: Largest joint speed at the order, in shares of its declared top [-].
        clearance: Least distance of any checked pair at the order [m].
        needless: Whether nothing could have happened without it; None if not asked.
    """

    arm: str
    time: float
    reason: str
    speed: float
    clearance: float
    needless: bool | None = None


@dataclass(slots=True)
class Outcome:
    """Figures of an episode.

    Attributes:
        seed: Number of the episode.
        setting: Name of its setting.
        operator: Its operators.
        worst: Whether the plant used every declared figure up.
        duration: How long it was [s].
        contact: The first contact that counts.
        met_at_rest: How often an object met an arm on its way out that would have met
            it at rest as well.
        least: Least distance of a pair of which an arm moved, no more than what the
            judge sees [m].
        floor: Distance the guard is to keep [m].
        braked_before: Whether an arm of the contact was ordered to brake before it.
        brakes: How many arms were ordered to brake.
        broke: The figure the plant broke, None if it kept all that were checked.
        saturated: Share of the time in which a motor gave all its torque [-].
        rest: Least distance of any checked pair at the end [m].
        rest_q: Positions at the end, in the order of q [rad or m].
        stops: All stops.
        releases: How often an arm was given back.
        cycles: Cycles of the guard.
        judged: States judged.
        levels: Cycles at each level, by arm.
        joint_way: Way of all joints under their operator [rad and m].
        joint_wish: The same of what the operator desired [rad and m].
        tool_way: Way of the last bodies under their operator [m].
        stop_jerk: Greatest jerk of commands to an arm that is to stop; 0 where none
            are sent [rad/s³ or m/s³].
        cycle_times: Median, 99th percentile and longest cycle of the guard [s].
        wall: Time the whole episode took to compute [s].
    """

    seed: int
    setting: str
    operator: str
    worst: bool
    duration: float = 0.0
    contact: Contact | None = None
    met_at_rest: int = 0
    least: float = 0.0
    floor: float = 0.0
    braked_before: bool = False
    brakes: int = 0
    broke: str | None = None
    saturated: float = 0.0
    rest: float = 0.0
    rest_q: list[float] = field(default_factory=list)
    stops: list[Stop] = field(default_factory=list)
    releases: int = 0
    cycles: int = 0
    judged: int = 0
    levels: dict[str, dict[str, int]] = field(default_factory=dict)
    joint_way: float = 0.0
    joint_wish: float = 0.0
    tool_way: float = 0.0
    stop_jerk: float = 0.0
    cycle_times: tuple[float, float, float] = (0.0, 0.0, 0.0)
    wall: float = 0.0

    def to_dict(self) -> dict[str, Any]:
        """As plain numbers, lists and strings."""
        found = asdict(self)
        if self.contact is not None:
            found["contact"] = self.contact._asdict()
        return found
