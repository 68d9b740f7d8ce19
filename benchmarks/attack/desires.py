"""Desired motion that comes late: it is counted, and no arm moves because of it."""

import tempfile
import time
from collections.abc import Callable
from math import inf
from pathlib import Path

from armguard.chaos.relay import Relay, Tamper
from attack.raw import PATIENCE, Kind, Raw, Role
from attack.row import Row
from attack.target import Arms, Target

# Delays of all messages that desire motion [s].
DELAYS = (0.15, 0.3, 2.0)

# Delays that grow, in seconds a second, to a longest one: the first is still short
# enough for motion when the operator lets go, the second is not.
GROWING = ((0.025, 0.085), (1.0, 2.0))

# How often the operator says what is desired, and for how long [s].
EVERY, PRESSES = 0.02, 3.0

# The speed that is desired [rad/s].
SPEED = 0.3

# From the last desire that counts until arms rest: its age, then by the figures of the
# bay the delay of commands, the ramp, the deceleration and the time to settle [s].
AGE = 0.1
STOPS = 0.003 + 0.020 + SPEED / 4.0 + 0.2


def delayed(target: Target, arms: Arms, delay: float) -> Row:
    """All messages of an operator are late by the same."""
    relay = Relay(target.port)
    try:
        with operator(target, relay) as raw:
            relay.tamper = later(lambda: delay)
            before = target.counters.values()
            moving, sent = arms.moving, 0
            end = time.monotonic() + max(0.6, delay)
            while time.monotonic() < end:
                press(raw, arms)
                sent += 1
            wait_for(
                target, "dropped_wish_late", before["dropped_wish_late"] + sent, delay
            )
            after = target.counters.values()
    finally:
        relay.close()
    counted = after["dropped_wish_late"] - before["dropped_wish_late"]
    obeyed = after["wishes"] - before["wishes"] + arms.moving - moving
    return Row(
        attack=f"desired motion that comes {delay} s late",
        tried=sent,
        had=obeyed,
        unit="obeyed",
        target="0, all counted",
        passed=obeyed == 0 and counted == sent > 0,
        note=f"{counted} of {sent} counted as late",
        figures={"counted": counted},
    )


def growing(target: Target, arms: Arms, times: int) -> Row:
    """The delay grows while the operator drives; how long motion outlasts it."""
    longest, tried, moved = -inf, 0, 0
    for k in range(times):
        pace, most = GROWING[k % len(GROWING)]
        relay = Relay(target.port)
        try:
            with operator(target, relay) as raw:
                began = time.monotonic()
                relay.tamper = later(grows(began, pace, most))
                before = arms.moving
                while time.monotonic() < began + PRESSES:
                    press(raw, arms)
                    tried += 1
                released = time.monotonic()
                while time.monotonic() < released + most + 0.5:
                    raw.say(Kind.HEARTBEAT)
                    time.sleep(EVERY)
                moved += arms.moving > before
                longest = max(longest, arms.moved_at - released)
        finally:
            relay.close()
    return Row(
        attack="desired motion whose delay grows, to 0.085 s and to 2 s",
        tried=tried,
        had=int(longest > AGE + STOPS),
        unit="motions too long",
        target=f"0; motion ends {AGE + STOPS:.2f} s after release",
        passed=longest <= AGE + STOPS and moved == times,
        note=f"the last motion ended {longest:.3f} s after release",
        figures={"longest_s": longest},
    )


def later(delay: Callable[[], float]) -> Tamper:
    """All that goes to the service is late, in the order in which it was sent."""
    return lambda message, up: ((delay() if up else 0.0, message),)


def grows(began: float, pace: float, most: float) -> Callable[[], float]:
    """A delay that grows [s]."""
    return lambda: min(pace * (time.monotonic() - began), most)


def operator(target: Target, relay: Relay) -> Raw:
    """A commander behind a relay."""
    raw = Raw(relay.port, target.keys[Role.COMMAND], Role.COMMAND)
    raw.connect()
    end = time.monotonic() + PATIENCE
    while not raw.claim():
        if time.monotonic() > end:
            raise ConnectionError("the command was not granted")
    return raw


def press(raw: Raw, arms: Arms) -> None:
    """Desire motion once: to and fro, so that nothing is in the way."""
    found = [0.0] * len(arms.q)
    found[0] = SPEED if int(2.0 * time.monotonic()) % 2 else -SPEED
    raw.say(Kind.WISH, raw.desired(found))
    time.sleep(EVERY)


def wait_for(target: Target, name: str, value: int, delay: float) -> None:
    """Wait until a counter has a value, or for much longer than messages are late."""
    end = time.monotonic() + delay + 5.0
    while target.counters.value(name) < value and time.monotonic() < end:
        time.sleep(0.01)


def run(times: int) -> list[Row]:
    """All delays.

    Args:
        times: How often the delay grows.
    """
    with tempfile.TemporaryDirectory() as name, Target(Path(name)) as target:
        with Arms(target.raw(Role.COMMAND), commands=False, still=7) as arms:
            arms.wait_until(lambda _: True)
            rows = [delayed(target, arms, delay) for delay in DELAYS]
            rows.append(growing(target, arms, times))
    return rows
