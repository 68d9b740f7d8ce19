"""The paper's stops, and the buffer they require: numbers and plot of docs/paper.md.

python benchmarks/paper_buffer.py

C. A. Shaffer, Real-time robot arm collision detection for telerobotics, section 4.
Speeds are those of the tool; the arm is taken as one joint that slides.
"""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from scipy.optimize import brentq

from armguard.robot.stopping import (
    StoppingFigures,
    StopTravel,
    stop_travel,
    stopping_figures,
)
from pages import DOCS
from plots import FRAMED, drawn
from robots import carriage

IMAGE = DOCS / "images" / "buffer_by_speed.png"

INCH = 0.0254  # [m]
TOP, TYPICAL = 24.0 * INCH, 6.0 * INCH  # [m/s]
FIXED = 1.2 * INCH  # [m]

# Delivery, detection and brake of a braked stop: quick ones, and the slowest [s].
QUICK = (0.003, 0.030, 0.010)
SLOWEST = (0.050, 0.060, 0.020)

# One set of figures that reproduces both controlled stops of the paper: latency,
# acceleration until the drives obey, deceleration, its ramp, and a swing from top speed
# with the time it takes to die; the swing of a slower stop is less in proportion.
LATENCY = 0.025  # [s]
ACCELERATION = 100.0 * INCH  # [m/s²]
DECELERATION = 400.0 * INCH  # [m/s²]
RAMP = 0.010  # [s]
SWING = 4.9 * INCH  # [m]
SWING_TIME = 0.85  # [s]

BLUE, ORANGE, GREEN, GREY = "#4477aa", "#ee8866", "#66aa77", "#555555"


def main() -> None:
    """Print the stops and draw the plot."""
    for speed in (TYPICAL, TOP):
        stop = controlled_stop(speed)
        ways = (stop.reaction, stop.braking, stop.settle, stop.travel)
        parts = ", ".join(f"{way / INCH:.2f}" for way in ways)
        print(
            f"{speed / INCH:.0f} in/s: latency, ramp and deceleration, swing, all: "
            f"{parts} in; {stop_time(stop):.2f} s"
        )
    print(f"the fixed buffer covers it up to {enough_up_to() / INCH:.1f} in/s")
    draw(IMAGE)


def paper_figures() -> StoppingFigures:
    """The set above as stopping figures of one joint."""
    return stopping_figures(
        carriage(None, 1.0),
        velocity=TOP,
        acceleration=ACCELERATION,
        deceleration=DECELERATION,
        ramp=RAMP,
        settle=SWING,
        settle_time=SWING_TIME,
        sensing=0.0,
        stale=0.0,
        command=0.0,
    )


def controlled_stop(speed: float) -> StopTravel:
    """Controlled stop from a speed of the tool, by that set.

    Args:
        speed: Speed [m/s].
    """
    return stop_travel(paper_figures(), 0, speed, period=LATENCY)


def stop_time(stop: StopTravel) -> float:
    """Time to rest, the swing's in proportion to the swing [s].

    `StopTravel.time` is a bound and takes the longest.
    """
    swing = stop.settle_time * stop.settle / SWING
    return stop.reaction_time + stop.braking_time + swing


def enough_up_to() -> float:
    """Speed up to which a controlled stop needs no more than the fixed buffer [m/s]."""
    return float(brentq(lambda v: controlled_stop(v).travel - FIXED, 0.0, TOP))


def draw(path: Path) -> None:
    """Buffer against speed, split by cause: controlled and braked stops."""
    speeds = np.linspace(0.0, TOP, 200)
    stops = [controlled_stop(v) for v in speeds]
    parts = 1e3 * np.array([(s.reaction, s.braking, s.settle) for s in stops]).T
    controlled = ("latency", "ramp and deceleration", "swing")
    braked = ("delivery of joint angles, 50 ms", "detection, 60 ms", "brake, 20 ms")
    causes = {"colors": (BLUE, ORANGE, GREEN)}
    with drawn(path, (11, 4.4), 2, axes__axisbelow="line", **FRAMED) as places:
        left, right = places
        left.stackplot(speeds / INCH, parts, **causes, alpha=0.85, labels=controlled)
        left.errorbar(
            [6.0, 24.0],
            [3.0 * INCH * 1e3, 6.0 * INCH * 1e3],
            yerr=[[1.0 * INCH * 1e3, 0.0], [1.0 * INCH * 1e3, 0.0]],
            **{"fmt": "o", "color": "black", "capsize": 4, "zorder": 5},
            clip_on=False,
            label="the paper: 2 to 4 in, about 6 in",
        )
        left.set(title="a controlled stop", ylim=(0.0, 180.0))
        ways = [1e3 * speeds * part for part in SLOWEST]
        right.stackplot(speeds / INCH, ways, **causes, alpha=0.85, labels=braked)
        quick = {"lw": 1.2, "label": "the same with 3 + 30 + 10 ms"}
        right.plot(speeds / INCH, 1e3 * speeds * sum(QUICK), "k--", **quick)
        right.set_title("a braked stop, the paper's figures at their slowest")
        right.set_ylim(0.0, 90.0)
        mark_fixed(left, enough_up_to())
        mark_fixed(right, FIXED / sum(SLOWEST))


def mark_fixed(axes: Axes, good: float) -> None:
    """Mark the fixed buffer, and up to which speed it is enough [m/s]; the axes."""
    height = axes.get_ylim()[1]
    axes.plot([good / INCH] * 2, [0.0, FIXED * 1e3], color="black", lw=1.0, ls=":")
    axes.annotate(
        f"enough up to\n{good / INCH:.1f} in/s",
        (good / INCH, FIXED * 1e3),
        (max(good / INCH - 4.6, 2.6), FIXED * 1e3 + 0.2 * height),
        fontsize=9,
        ha="center",
        arrowprops={"arrowstyle": "->", "lw": 0.8},
    )
    axes.axhline(FIXED * 1e3, color=GREY, lw=1.6, label="the paper's buffer, 1.2 in")
    axes.set(
        xlim=(0.0, 24.5), xticks=range(0, 25, 6), xlabel="speed of the tool [in/s]"
    )
    axes.set_ylabel("way until it rests [mm]")
    handles, labels = axes.get_legend_handles_labels()
    axes.legend(handles[::-1], labels[::-1], loc="upper left", fontsize=8.5)
    both = (lambda x: x * INCH, lambda x: x / INCH)
    metres = axes.secondary_xaxis("top", functions=both)
    metres.set_xlabel("[m/s]", fontsize=8.5)
    metres.tick_params(labelsize=8.5)


if __name__ == "__main__":
    main()
