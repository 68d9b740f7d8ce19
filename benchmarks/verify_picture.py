"""Draws docs/images/verify_interval.png: a pair along a plan, by Coal, and its proof.

python benchmarks/verify_picture.py
"""

from collections.abc import Callable
from itertools import count

import numpy as np

from armguard.prove.paving import NearInterval
from pages import DOCS
from plots import drawn
from verifying.judge import RESOLUTION, intervals_of
from verifying.oracle import positions
from verifying.plans import Case, cubic, skewed

SAMPLES = 1500

# Kinds of plans.
PLANS = {"curves alone": cubic, "with following error and skew": skewed}

# Intervals shorter than this are no more than a line [s].
LEAST = 0.02


def first_with_an_interval(kind: Callable[[int], Case]) -> tuple[Case, NearInterval]:
    """The first plan of a kind with an interval that can be seen, and that interval."""
    for seed in count(1):
        case = kind(seed)
        found = [
            o
            for o in intervals_of(case, case.tube)
            if LEAST < o.end - o.start < 10.0 * LEAST
            and case.tube.times[0] < o.start < o.end < case.tube.times[-1]
        ]
        if found:
            return case, found[0]
    raise AssertionError


def main() -> None:
    """Draw both."""
    path = DOCS / "images" / "verify_interval.png"
    with drawn(path, (9.0, 3.6), 2) as places:
        for axes, (name, kind) in zip(places, PLANS.items(), strict=True):
            case, first = first_with_an_interval(kind)
            pair = first.nearest.a, first.nearest.b
            times = np.linspace(*case.curves.times[[0, -1]], SAMPLES)
            gaps = case.world.oracle.distance(positions(case.curves, times), *pair)
            axes.plot(times, 1e3 * gaps, color="tab:blue", label="Coal, curves")
            buffer = 1e3 * case.world.oracle.buffer(*pair)
            axes.axhline(buffer, color="black", lw=0.8, ls="--", label="buffer")
            own = [
                o
                for o in intervals_of(case, case.tube)
                if {o.nearest.a, o.nearest.b} == set(pair)
            ]
            for k, one in enumerate(own):
                # One entry of the legend for all of them.
                label = "_" * (k > 0) + "may be too near"
                axes.axvspan(
                    one.start, one.end, color="tab:orange", alpha=0.4, label=label
                )
            middle = 0.5 * (first.start + first.end)
            wide = 4.0 * (first.end - first.start)
            shown = np.abs(times - middle) < wide
            axes.set(
                xlim=(middle - wide, middle + wide),
                ylim=(min(gaps[shown].min() * 1e3, 0.0) - 5.0, buffer + 80.0),
                xlabel="time [s]",
                ylabel="distance [mm]",
                title=f"{pair[0]} to {pair[1]}\n{name}",
            )
            axes.legend(fontsize=8)
    print(f"wrote {path.name}; ends are within {1e3 * RESOLUTION:g} ms")


if __name__ == "__main__":
    main()
