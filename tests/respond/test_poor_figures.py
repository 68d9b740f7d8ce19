"""Poor measurements and slow drives keep an arm farther away; they do not stop it."""

import numpy as np
import pytest

from approach import PERIOD
from driven import Driven, wall_guard

ERROR = 3e-3
MISSED = 0.04
POOR = {
    "position_error": ERROR,
    "velocity_error": 0.03,
    "tracking_error": 0.05,
    "sensing": 0.003,
    "command": 0.015,
}
START = [0.2, 0.2, 0.1]
WISH = np.array([0.5, 0.0, 0.0])


class Poor(Driven):
    """An arm that is measured wrong, now one way, now the other."""

    def __init__(self, guard, **options):
        super().__init__(guard, **options)
        self.sign = 1.0

    def cycle(self, desired, form="filter"):
        true, self.sign = self.q, -self.sign
        self.q = true + self.sign * ERROR
        command = super().cycle(desired, form)
        self.q = true + self.v * PERIOD
        return command


@pytest.mark.parametrize("delay", [1, 12])
@pytest.mark.parametrize("miss", [-MISSED, 0.0, MISSED])
def test_it_slides_along_a_wall_without_a_stop(delay, miss):
    guard = wall_guard(**POOR)
    loop = Poor(guard, q=START, delay=delay, miss=miss)
    loop.run(WISH, 1500)
    assert loop.stops == []
    # It goes on along the wall, as the other joints give way.
    swept = loop.q[0] - START[0]
    assert swept > 0.15
    headroom = guard.judge_at_rest(loop.q).nearest.headroom
    assert 0.0 < headroom < 0.05
