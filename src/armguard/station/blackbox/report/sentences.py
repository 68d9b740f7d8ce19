"""A recording in one or two sentences."""

from armguard.station.blackbox.report.findings import Findings
from armguard.station.blackbox.report.formatting import (
    clock,
    count,
    duration,
    millimetres,
)
from armguard.station.blackbox.report.incidents import Sense


def summary(findings: Findings) -> str:
    """A recording in a sentence or two."""
    series, robots, stops = findings.series, len(findings.everyone), findings.stops
    if not len(series.t):
        return "There is no cycle in this recording."
    text = (
        f"In {duration(series.duration)} {count(robots, 'robot')} "
        f"{'was' if robots == 1 else 'were'} judged {len(series.t):,} times: "
        f"{count(len(stops), 'stop')}"
    )
    if stops:
        needless = len(findings.stops_that_were(Sense.NEEDLESS))
        text += f" ({needless or 'none'} of them needless)"
    misses = count(len(findings.near_misses), "near miss", "near misses")
    text += f", {misses}. {nearest_sentence(findings)}"
    if faults := findings.faults:
        text += f" In {count(faults, 'cycle')} the input could not be believed."
    if findings.problems or series.missing:
        text += " The recording is not whole; see below."
    if gaps := len(series.gaps):
        text += f" There {'is' if gaps == 1 else 'are'} {count(gaps, 'gap')} in it."
    return text


def nearest_sentence(findings: Findings) -> str:
    """The nearest pair, and whether anything touched."""
    if not findings.free:
        return "Nothing came within the margin in which pairs are reported."
    pair = findings.free[0]
    names, at = f"{pair.a} and {pair.b}", clock(pair.at - findings.begin)
    if pair.distance <= 0.0:
        overlap = millimetres(-pair.distance)
        return f"The modelled surfaces of {names} overlapped by {overlap} at {at}."
    touched = any(contract.distance <= 0.0 for contract in findings.contracts)
    but = " but what a contract let touch" if touched else ""
    apart = millimetres(pair.distance)
    return f"Nothing touched{but}; nearest were {names}, {apart} apart at {at}."


def advice(findings: Findings) -> str:
    """What would have let the most stops pass; "" if that is not known."""
    for cause in findings.causes:
        if cause.cause is not None and cause.stops and cause.remedy:
            return (
                f"Most stops ({cause.stops} of {len(findings.stops)}) were made by "
                f"{cause.cause.value}. For the one that lacked most, {cause.remedy}."
            )
    return ""
