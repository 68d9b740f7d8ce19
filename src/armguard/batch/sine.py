"""Sine and cosine in lanes."""

from math import factorial
from typing import Any

import numpy as np
from numba.extending import register_jitable

from armguard.lanes import either, floor, size

# Half of pi in three parts. Whole numbers below 2^20 times the first two are exact.
HALF_PI_HIGH = float.fromhex("0x1.921fb544p+0")
HALF_PI_MIDDLE = float.fromhex("0x0.42d18469p-32")
HALF_PI_LOW = float.fromhex("0x0.898cc51701b83ap-64")
QUADRANTS = 2.0 / np.pi

# The series of sine and cosine, from the term of order 3 and 4.
SINE = tuple((-1.0) ** k / factorial(2 * k + 1) for k in range(1, 9))
COSINE = tuple((-1.0) ** k / factorial(2 * k) for k in range(2, 10))


@register_jitable  # type: ignore[untyped-decorator]
def sincos(angle: Any) -> tuple[Any, Any]:
    """Sine and cosine of each lane, for angles up to 10^5 rad either way."""
    turns = floor(angle * QUADRANTS + 0.5)
    first = angle - turns * HALF_PI_HIGH
    x = first - turns * HALF_PI_MIDDLE
    rest = ((first - x) - turns * HALF_PI_MIDDLE) - turns * HALF_PI_LOW
    z = x * x
    sine = z * SINE[7]
    cosine = z * COSINE[7]
    for k in (6, 5, 4, 3, 2, 1):
        sine = z * (SINE[k] + sine)
        cosine = z * (COSINE[k] + cosine)
    sine = x + (x * (z * (SINE[0] + sine)) + rest * (1.0 - 0.5 * z))
    half = 0.5 * z
    whole = 1.0 - half
    cosine = whole + (
        ((1.0 - whole) - half) + (z * (z * (COSINE[0] + cosine)) - x * rest)
    )
    quadrant = turns - 4.0 * floor(turns * 0.25)
    odd = turns - 2.0 * floor(turns * 0.5) == 1.0
    a = either(odd, cosine, sine)
    b = either(odd, sine, cosine)
    upper = quadrant >= 2.0
    middle = size(quadrant - 1.5) < 1.0
    return either(upper, -a, a), either(middle, -b, b)
