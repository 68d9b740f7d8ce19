"""A fault: its injection, and what is declared to happen then."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from armguard.chaos.playground import Playground


class Effect(Enum):
    """What arms do in the face of a fault."""

    GOES_ON = "goes on"
    """They go on moving; no stop is commanded."""

    RESTS = "comes to rest"
    """Nothing is requested any more: they come to rest, and are not stopped."""

    STOPS = "stops"
    """The guard stops all of them; they rest until the operator engages them."""

    STOPS_ITSELF = "stops by itself"
    """They hear nothing, and stop by their own watchdog; then as `STOPS`."""

    REPORTED_ONLY = "is ordered to stop"
    """The guard stops all of them, and no controller is there to do so."""


# Does something to a playground for as long as the context lasts.
Injection = Callable[["Playground"], AbstractContextManager[None]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """A row of the table.

    Attributes:
        name: What goes wrong.
        group: Part of the table.
        inject: Does it.
        effect: What is declared to happen.
        reasons: Names of reasons and causes one of which is reported first; none where
            no stop is reported.
        within: Names of the delays that add up to the longest time until a stop is
            reported, or arms stop by themselves, see `Playground.delay`.
        counts: Counters of the service one of which rises.
        hold: How long it lasts [s].
    """

    name: str
    group: str
    inject: Injection
    effect: Effect
    reasons: tuple[str, ...] = ()
    within: tuple[str, ...] = ()
    counts: tuple[str, ...] = ()
    hold: float = 0.3


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What was observed.

    Attributes:
        fault: The fault.
        passed: Whether all of it is as declared.
        observed: The same in words.
        skipped: Why it was not played; "" if it was.
        tries: How often it was played: a machine that was late by itself is given
            another try.
        reason: Name of the reason that was reported first; "" if none was.
        unsafe: Whether something is wrong that no late machine explains.
        waited: The longest wait of a thread for a processor, see
            `Playground.waited` [s].
        reported: From the fault until a stop was reported; NaN if never [s].
        rested: From the fault until all arms rested; NaN if not seen [s].
    """

    fault: Fault
    passed: bool
    observed: str
    skipped: str = ""
    tries: int = 1
    reason: str = ""
    unsafe: bool = False
    waited: float = 0.0
    reported: float = float("nan")
    rested: float = float("nan")


class Unplayable(Exception):
    """A fault cannot be played on this machine; the message says why."""
