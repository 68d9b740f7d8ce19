"""Measured stops: how far a joint still turns, and how long, from a given speed."""

from bisect import bisect_left
from dataclasses import dataclass
from itertools import pairwise
from math import isfinite

from armguard.errors import ModelError


@dataclass(frozen=True, slots=True)
class StopTable:
    """What a joint needs to stop from some speeds, worst case of all that was measured.

    The form in which makers publish it (ISO 10218-1, annex B), reduced to the load and
    extension at hand. Between two speeds the travel is taken on a straight line, below
    the lowest on the line to rest: stopping distances grow faster than the speed, so
    this errs towards "farther". The time is that of the next higher speed, since a
    delay does not shrink with the speed. Beyond the highest speed the travel grows with
    the square of the speed, the time with the speed.

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

    def at(self, speed: float) -> tuple[float, float]:
        """Time [s] and travel [rad or m] of a stop from a speed.

        Args:
            speed: Speed when the stop is ordered, >= 0 [rad/s or m/s].

        Example:
            >>> table = StopTable((1.0, 2.0), (0.2, 0.3), (0.1, 0.4))
            >>> table.at(1.5)
            (0.3, 0.25)
            >>> table.at(4.0)
            (0.6, 1.6)
        """
        top = self.speeds[-1]
        if not speed <= top:
            ratio = speed / top
            return self.times[-1] * ratio, self.travels[-1] * ratio**2
        if speed <= 0.0:
            return 0.0, 0.0
        k = bisect_left(self.speeds, speed)
        v0, s0 = (self.speeds[k - 1], self.travels[k - 1]) if k else (0.0, 0.0)
        share = (speed - v0) / (self.speeds[k] - v0)
        return self.times[k], s0 + share * (self.travels[k] - s0)

    @property
    def deceleration(self) -> float:
        """Least constant deceleration no measured stop falls short of.

        It takes no less time and no less way than any row [rad/s² or m/s²].
        """
        return min(
            min(v / time, v**2 / (2.0 * travel))
            for v, time, travel in zip(
                self.speeds, self.times, self.travels, strict=True
            )
        )
