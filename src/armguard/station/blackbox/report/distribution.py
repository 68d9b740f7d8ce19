"""A column of numbers as what people ask of it: median, tails, worst."""

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Distribution:
    """Numbers, in short.

    Attributes:
        count: How many there are; those that are NaN or infinite are left out.
        p50: Median.
        p99: 99 in 100 are no greater.
        p999: 999 in 1000 are no greater.
        most: The greatest.
    """

    count: int
    p50: float
    p99: float
    p999: float
    most: float

    def to_dict(self) -> dict[str, float]:
        """The same by name."""
        return asdict(self)


def distribution(values: NDArray[np.floating]) -> Distribution | None:
    """Median and tails, each a number that is there; None if there are none."""
    known = np.sort(values[np.isfinite(values)])
    if not len(known):
        return None

    def at(share: float) -> float:
        return float(known[min(int(np.ceil(share * len(known))), len(known)) - 1])

    return Distribution(len(known), at(0.5), at(0.99), at(0.999), float(known[-1]))
