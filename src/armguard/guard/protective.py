"""The protective separation distance: a pair's need in the letters of the standards.

    S_p = S_h + S_r + S_s + C + Z_d + Z_r

ISO/TS 15066 and ISO 10218-2 use these letters for a person; for two arms the other arm
takes the person's place. The sum is what the guard keeps in this cycle, not a number
made beside it. **No certification is claimed**: the terms are for a risk assessment,
and each is only as true as the figure behind it.
"""

from dataclasses import dataclass

from armguard.guard.budget import Budget, whole_tenths


@dataclass(frozen=True, slots=True)
class ProtectiveDistance:
    """What a robot must keep from a person, or from another robot, by cause.

    Attributes:
        robot: The robot.
        other: The person, or the other robot.
        s_h: Way of the other: of a person since it was seen and until all rest, of a
            robot its own reaction and stopping [m].
        s_r: Way of the robot until its stop takes effect [m].
        s_s: Way of the robot from there to rest, along its path [m]. Where the two
            sides' exact shapes are far apart, or the course on the common clock saves
            more than that, it is negative.
        c: Intrusion distance, and all else that is kept at rest: the buffer of the
            pair, set by the object's `buffer` [m].
        z_d: Error of where the person is seen [m]. There is no figure for it, and it
            is 0: whoever sees the person adds it to the person's shape or to `buffer`.
        z_r: Error of where the robot is: measurement, base and model [m].
    """

    robot: str
    other: str
    s_h: float
    s_r: float
    s_s: float
    c: float
    z_d: float
    z_r: float

    @property
    def total(self) -> float:
        """S_p, the sum of the six [m]."""
        return self.s_h + self.s_r + self.s_s + self.c + self.z_d + self.z_r

    @property
    def sentence(self) -> str:
        """The sum in letters and millimetres."""
        letters = ("S_h", "S_r", "S_s", "C", "Z_d", "Z_r")
        values = whole_tenths(
            [self.s_h, self.s_r, self.s_s, self.c, self.z_d, self.z_r]
        )
        parts = " + ".join(
            f"{letter} {value:.1f}"
            for letter, value in zip(letters, values, strict=True)
        )
        return f"S_p {sum(values):.1f} mm = {parts}"


def protective_distance(robot: str, other: str, budget: Budget) -> ProtectiveDistance:
    """The terms of a pair in the letters of the standards.

    Args:
        robot: Robot of the pair's first side.
        other: What its second side belongs to.
        budget: What the pair needs.
    """
    return ProtectiveDistance(
        robot=robot,
        other=other,
        s_h=budget.object + budget.reaction_b + budget.stopping_b,
        s_r=budget.reaction_a,
        s_s=budget.stopping_a + budget.path,
        c=budget.floor,
        z_d=0.0,
        z_r=budget.error + budget.base + budget.model,
    )
