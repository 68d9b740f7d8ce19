"""Measured stops: how far a joint still turns, and how long, from a given speed."""

from dataclasses import dataclass
from itertools import pairwise
from math import isfinite

from armguard.errors import ModelError


@dataclass(frozen=True, slots=True)
class StopTable:
    """What a joint needs to stop from some speeds, worst case of all that was measured.

    The form in which makers publish it (ISO 10218-1, annex B), reduced to the load and
    extension at hand. Between two speeds both are taken on a straight line, below the
    lowest on the line to rest: stopping distances grow faster than the speed, so
    this errs towards "farther".

    Attributes:
        speeds: Speeds, ascending, all > 0 [rad/s or m/s].
        times: Time from the order to rest at each speed [s].
        travels: Way from the order to rest at each speed [rad or m].
    """

    speeds: tuple[float, ...]
    times: tuple[float, ...]
    travels: tuple[float, ...]

    def __post_init__(self) -> None:
        """Check that it can be what it says.

        Raises:
            ModelError: It cannot.
        """
        columns = (self.speeds, self.times, self.travels)
        if not self.speeds or len({len(c) for c in columns}) != 1:
            raise ModelError(
                "a stopping table needs at least one row, and each row a speed, a "
                "time and a travel"
            )
        for name, column in zip(("speed", "time", "travel"), columns, strict=True):
            if not all(isfinite(x) and x > 0.0 for x in column):
                raise ModelError(f"a {name} of a stopping table is not finite and > 0")
        if any(b <= a for a, b in pairwise(self.speeds)):
            raise ModelError("the speeds of a stopping table must ascend")
        for name, column in (("time", self.times), ("travel", self.travels)):
            if any(b < a for a, b in pairwise(column)):
                raise ModelError(
                    f"a stopping table in which a higher speed needs less {name} is "
                    "mistaken or was measured at other loads"
                )
        for v, time, travel in zip(*columns, strict=True):
            if travel > v * time:
                raise ModelError(
                    f"a joint that starts to stop at {v:g} cannot get {travel:g} far "
                    f"in {time:g} s"
                )
