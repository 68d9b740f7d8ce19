"""One term of the budget is told wrong: the guard must fail, or the test is blind."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from closed_loop.settings import PROFILES, Setting

# Told in place of zero where a figure must be > 0.
NONE = 1e-6

# What the plant really does while the guard is told that the term is zero: large enough
# to stand out from what the guard adds for reasons of its own.
ENLARGED: Mapping[str, Mapping[str, Any]] = {
    "command": {"command": 0.03},
    "sensing": {"sensing": 0.015, "stale": 0.05},
    "period": {},
    "position_error": {"position_error": 0.01},
    "velocity_error": {"velocity_error": 0.2},
    "acceleration": {"acceleration": 40.0},
    "ramp": {"ramp": 0.06},
    "settle": {"settle": 0.03, "settle_time": 0.1},
    "deceleration": {},
    "model_error": {"model_error": 0.015},
    "base_error": {"base_error": 0.015},
    "top_speed": {},
    # A drive that can miss so fast that the stop comes too late.
    "tracking_error": {"tracking_error": 0.25, "acceleration": 40.0},
}

# Terms that only matter where commands go through the guard.
FILTERED = ("tracking_error",)

TERMS = tuple(ENLARGED)

# Period and lateness of the plant where these are the term [s].
SLOW = (0.015, 0.005)

# Speed of the objects where that is the term [m/s].
FAST = 1.5

# How much stronger the guard is told the stops are [-].
TOO_STRONG = 1.6


def enlarged(setting: Setting, term: str) -> Setting:
    """The setting as it truly is when a term is attacked: that term large, no floor.

    Args:
        setting: Setting of the episode.
        term: One of `TERMS`.
    """
    changes = {**setting.changes, **ENLARGED[term]}
    truth = replace(setting, profile="even", floor=0.0, changes=changes)
    if term == "period":
        truth = replace(truth, period=SLOW[0], late=SLOW[1])
        return replace(truth, changes={**changes, "stale": 0.05})
    if term == "top_speed":
        return replace(truth, top_speed=FAST)
    return truth


def told(setting: Setting, term: str) -> Setting:
    """What the guard is told: the same, with one term as if it were nothing.

    Args:
        setting: The true setting.
        term: One of `TERMS`.
    """
    if term == "period":
        return replace(setting, period=NONE, late=0.0)
    if term == "top_speed":
        return replace(setting, top_speed=0.0)
    return replace(setting, changes={**setting.changes, **UNTOLD[term](setting)})


def nothing(term: str, value: float = 0.0) -> Callable[[Setting], dict[str, Any]]:
    """A figure told as nothing."""
    return lambda setting: {term: value}


def stronger(setting: Setting) -> dict[str, Any]:
    """Stops told stronger than they are."""
    figures = PROFILES[setting.profile]
    least = TOO_STRONG * figures["deceleration"]
    return {
        "deceleration": least,
        "deceleration_most": max(least, figures["deceleration_most"]),
    }


UNTOLD: Mapping[str, Callable[[Setting], dict[str, Any]]] = {
    "acceleration": nothing("acceleration", NONE),
    "deceleration": stronger,
    **{
        term: nothing(term)
        for term in TERMS
        if term not in ("acceleration", "deceleration", "period", "top_speed")
    },
}
