"""Plays a fault against a running guard; judges what happened by what is declared."""

import time
from dataclasses import replace
from itertools import count
from math import inf, isnan, nan

from armguard.chaos.fault import Effect, Fault, Outcome, Unplayable
from armguard.chaos.playground import Playground
from armguard.errors import ArmguardError

# A machine that was late by itself, which these reasons show, is given so many tries.
TRIES = 4
LATE = ("CYCLE_LATE", "STATE_STALE", "DEADLINE_MISSED", "SERVICE_SILENT")

# For so long a fault is played again where a thread waited for a processor, by at least
# this share of what a cycle may be late: a state passes through three of them [s], [-].
PATIENCE, SHARE = 120.0, 0.5

# Arms that rest are watched for so long, whether they set out again by themselves [s].
LINGER = 0.15

HELD = (Effect.STOPS, Effect.STOPS_ITSELF)


def play(ground: Playground, fault: Fault) -> Outcome:
    """Play a fault; a try that the machine itself was too late for does not count."""
    end = time.monotonic() + PATIENCE
    for tries in count(1):
        outcome = replace(play_once(ground, fault), tries=tries)
        named = outcome.reason in LATE and outcome.reason not in fault.reasons
        late = named and tries < TRIES
        if outcome.waited >= SHARE * ground.late and time.monotonic() < end:
            late = True
        if outcome.passed or outcome.unsafe or not late:
            break
    return outcome


def play_once(ground: Playground, fault: Fault) -> Outcome:
    """Play a fault once."""
    try:
        ground.settle()
        ground.begin()
        with fault.inject(ground):
            ground.watch(fault.hold)
            if fault.effect in (Effect.RESTS, *HELD):
                ground.watch_until(lambda: came_to_rest(ground, fault), limit(ground))
            seen = judge(ground, fault)
        if fault.effect in HELD:
            # The fault is over; they must not set out again by themselves.
            ground.watch(LINGER)
            seen = judge(ground, fault)
        ground.settle()
    except Unplayable as error:
        return Outcome(
            fault=fault, passed=True, observed="not played", skipped=str(error)
        )
    except (ArmguardError, AssertionError) as error:
        seen = Outcome(
            fault=fault,
            passed=False,
            observed=str(error),
            unsafe=isinstance(error, AssertionError),
            waited=ground.waited(),
        )
        # Whatever state it left behind, the next one begins with a guard of its own.
        ground.restart()
    return seen


def limit(ground: Playground) -> float:
    """Longest time that is waited for arms to rest [s]."""
    return ground.stopping_time + 1.0


def came_to_rest(ground: Playground, fault: Fault) -> bool:
    """Whether all arms rest, or are held where they are to be stopped."""
    if not ground.truth:
        return False
    row = ground.truth[-1]
    return ground.rests(row) and (fault.effect is Effect.RESTS or ground.held(row))


def first_report(ground: Playground) -> tuple[float, str]:
    """When a stop was first reported since a fault began, and why; inf if never."""
    for answer in ground.answers:
        if answer.stops and answer.sent >= ground.began:
            return answer.sent - ground.began, answer.reason.name
    return inf, ""


def judge(ground: Playground, fault: Fault) -> Outcome:
    """What happened beside what is declared."""
    reported, reason = first_report(ground)
    reported_by = sum(ground.delay(name) for name in fault.within) + ground.slack
    rested = rest_time(ground, fault)
    rest_by = reported_by + ground.stopping_time
    wrong, unsafe = [], []
    words = []
    if fault.effect is Effect.GOES_ON:
        words.append("goes on" if reported == inf else f"{reason} after {ms(reported)}")
        if reported < inf:
            wrong.append("a stop was reported")
        elif not ground.truth or ground.rests(ground.truth[-1]):
            wrong.append("arms rest")
    elif fault.effect is Effect.RESTS:
        causes = {answer.cause.name for answer in ground.answers}
        words.append(f"rests after {ms(rested)}")
        if reported < inf:
            words.append(f"{reason} after {ms(reported)}")
            wrong.append("a stop was reported")
        if fault.reasons and not causes & set(fault.reasons):
            wrong.append("the answer does not say " + " or ".join(fault.reasons))
        if not rested <= rest_by:
            wrong.append(f"not at rest within {ms(rest_by)}")
    else:
        if reported < inf:
            words.append(f"{reason} after {ms(reported)}")
        if fault.effect is not Effect.STOPS_ITSELF:
            if not reported <= reported_by:
                wrong.append(f"not reported within {ms(reported_by)}")
        if fault.reasons and reason not in fault.reasons:
            wrong.append(f"reported {reason or 'nothing'}")
        if fault.effect in HELD:
            words.append(f"held after {ms(rested)}")
            if not rested <= rest_by:
                wrong.append(f"not held within {ms(rest_by)}")
            elif not ground.held(ground.truth[-1]):
                unsafe.append("set out again by itself")
    counted = ground.risen(fault.counts)
    words += [f"{name} +{count}" for name, count in counted.items() if count]
    if fault.counts and not any(count > 0 for count in counted.values()):
        wrong.append("not counted as " + " or ".join(fault.counts))
    if not ground.least > 0.0:
        unsafe.append("something touched")
    wrong += unsafe
    observed = ", ".join(words) + ("; " + ", ".join(wrong) if wrong else "")
    return Outcome(
        fault=fault,
        passed=not wrong,
        observed=observed,
        reason=reason,
        unsafe=bool(unsafe),
        waited=ground.waited(),
        reported=reported if reported < inf else nan,
        rested=rested,
    )


def rest_time(ground: Playground, fault: Fault) -> float:
    """From the fault until all arms rested for good, or were held; NaN if never [s]."""
    held = fault.effect in HELD
    since = nan
    for row in ground.truth:
        if row[0] < ground.began:
            continue
        if ground.rests(row) and (ground.held(row) or not held):
            since = row[0] - ground.began if isnan(since) else since
        elif not held:
            # A joint that turns round rests for a moment.
            since = nan
    return float(since)


def ms(time: float) -> str:
    """A time in words."""
    return "never" if isnan(time) else f"{time * 1e3:.0f} ms"
