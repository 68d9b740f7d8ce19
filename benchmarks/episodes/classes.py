"""Values counted by classes, so that figures of more episodes can be added."""

from collections import Counter
from collections.abc import Iterable, Mapping
from math import ceil

import numpy as np


def counted(names: Iterable[str]) -> dict[str, int]:
    """How often each name is there, by name."""
    return dict(sorted(Counter(names).items()))


def classes(values: Iterable[float], width: int = 1) -> dict[str, int]:
    """How many values are in each class, by the class's upper end.

    Args:
        values: The values.
        width: Width of a class.
    """
    return counted(str(width * ceil(value / width)) for value in values)


def percentile(counts: Mapping[str, int], part: float) -> int:
    """A percentile of values that were counted, no less than it is."""
    ends = sorted(int(end) for end in counts)
    before = np.cumsum([counts[str(end)] for end in ends])
    return ends[int(np.searchsorted(before, part * before[-1]))]
