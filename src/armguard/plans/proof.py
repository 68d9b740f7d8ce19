"""What is proven of a plan, as data and in words."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

from armguard.plans.stop_order import StopOrder
from armguard.prove.paving import NearestPlace, NearInterval


@dataclass(frozen=True, slots=True)
class PlanProof:
    """Result of the proof of a plan.

    Attributes:
        source: Where the plan is from.
        timed: Whether it has times; else times are numbers of rows, from 0.
        start: Time of its first row [s].
        end: Time of its last row [s].
        interpolation: What its controllers make of the rows.
        following_error: Greatest declared one of any joint [rad or m].
        skew: Greatest declared one of any robot [s].
        resolution: Ends of intervals are this exact [s].
        intervals: Every interval in which a pair may be nearer than its buffer, in the
            order of their starts. At all other times every pair is proven to keep it.
        planned: Whether the curves alone lead there, of each interval; else it takes
            the declared errors.
        least: The nearest place of the plan; None if no pair is checked.
        order: Latest order of a stop before the first interval; None without any, if
            it begins at once, or if no robot of it has stopping figures.
        notes: What the reader of the plan had to decide.
    """

    source: str
    timed: bool
    start: float
    end: float
    interpolation: str
    following_error: float
    skew: float
    resolution: float
    intervals: tuple[NearInterval, ...]
    planned: tuple[bool, ...]
    least: NearestPlace | None
    order: StopOrder | None
    notes: tuple[str, ...]

    @property
    def clear(self) -> bool:
        """Whether every pair is proven to keep its buffer all the time."""
        return not self.intervals

    @property
    def first_contact(self) -> float | None:
        """First time at which any pair may touch; None if all are proven apart [s]."""
        times = [one.contact for one in self.intervals if one.contact is not None]
        return min(times, default=None)

    @property
    def deepest(self) -> NearestPlace | None:
        """The nearest place of all intervals; None if there is none."""
        places = [one.nearest for one in self.intervals]
        return min(places, key=lambda place: place.distance, default=None)

    @property
    def sentence(self) -> str:
        """The result in words and millimetres, one line for each interval."""
        return "\n".join(self._lines())

    def to_dict(self) -> dict[str, Any]:
        """The result as plain numbers and strings, ready for JSON."""
        found = asdict(self)
        for interval, planned in zip(
            found["intervals"], found.pop("planned"), strict=True
        ):
            interval["planned"] = planned
        found["clear"], found["first_contact"] = self.clear, self.first_contact
        found["deepest"] = None if self.deepest is None else asdict(self.deepest)
        return found

    def _lines(self) -> Iterator[str]:
        what = "touches" if self.first_contact is not None else "nearer than its buffer"
        if self.clear:
            yield f"{self.source}: OK, every pair keeps its buffer all the way, proven"
        else:
            count = len({(one.nearest.a, one.nearest.b) for one in self.intervals})
            pairs = "1 pair" if count == 1 else f"{count} pairs"
            when = (
                ""
                if self.first_contact is None
                else (f" first at {self._time(self.first_contact)}")
            )
            yield f"{self.source}: {pairs} too near; one {what}{when}"
        for one, planned in zip(self.intervals, self.planned, strict=True):
            yield f"  {self._interval(one, planned)}"
        if self.order is not None:
            yield f"  {self._order(self.order)}"
        if self.least is not None:
            place = self.least
            yield (
                f"  least distance {_mm(place.distance)} mm, {place.a} to {place.b}, "
                f"at {self._time(place.time)}; proven never below {_mm(place.bound)} mm"
            )
        yield f"  {self._assumed()}"

    def _interval(self, one: NearInterval, planned: bool) -> str:
        near = one.nearest
        at_once = one.start <= self.start
        text = f"{near.a} to {near.b}: {self._time(one.start)} to {self._time(one.end)}"
        if at_once:
            text += ", from the start"
        if one.contact is None:
            depth = f"{_mm(near.distance)} mm, less than its {_mm(one.buffer)} mm"
            text += f": nearer than its buffer, {depth}"
        else:
            depth = (
                f"{_mm(-near.distance)} mm deep"
                if near.distance < 0.0
                else (f"{_mm(near.distance)} mm apart, too near to decide")
            )
            text += f": contact from {self._time(one.contact)}, {depth}"
        text += f" at {self._time(near.time)}"
        return text if planned else text + "; only with the declared errors"

    def _order(self, order: StopOrder) -> str:
        robots = " and ".join(order.robots)
        needs = (
            f"{order.reaction:.3f} s until the drives obey and {order.stop:.3f} s to "
            "rest, by the scene's figures"
        )
        if order.time is None:
            return (
                f"too late to stop from the start: {robots} would be too near after "
                f"{order.lead:.3f} s and takes {needs}"
            )
        return (
            f"the guard has to stop {robots} by {self._time(order.time)}, "
            f"{order.lead:.3f} s before: {needs}"
        )

    def _assumed(self) -> str:
        parts = [f"proven for {self.interpolation} curves between the rows"]
        if self.interpolation == "linear":
            parts = ["proven for straight lines between the rows"]
        if self.following_error:
            parts.append(f"joints up to {self.following_error:g} rad or m off them")
        if self.skew:
            parts.append(f"clocks up to {self.skew:g} s off")
        return ", ".join(parts)

    def _time(self, time: float) -> str:
        return f"{time:.4f} s" if self.timed else f"row {time + 1.0:.3f}"


def _mm(metres: float) -> str:
    """A length in millimetres."""
    return f"{1e3 * metres:.2f}"
