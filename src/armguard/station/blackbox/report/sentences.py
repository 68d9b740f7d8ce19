"""A recording in one sentence, and what a report is not."""

from datetime import UTC, datetime
from math import isfinite

import numpy as np

from armguard.guard.levels import Level
from armguard.station.blackbox.report.figures import LOOKED
from armguard.station.blackbox.report.findings import Findings
from armguard.station.blackbox.report.spoken import Sense
from armguard.station.blackbox.report.words import (
    clock,
    count,
    duration,
    millimetres,
    share,
)

NOT = (
    "This page is no certificate and no safety assessment. It tells what one program "
    "on one computer measured and ordered, by a model of the robots and of what stands "
    "around them. It knows nothing of what is not in that model, of what the robots "
    "did beyond what their measured positions show, or of what happens next time. Its "
    "proofs are as good as the stopping figures that were declared, and some of these "
    "may be assumptions, which are counted below. Whoever puts the robots to work "
    "remains to assess the risk."
)


def summary(findings: Findings) -> str:
    """A recording in a sentence or two."""
    series = findings.series
    if not len(series.t):
        return "There is no cycle in this recording."
    robots = findings.everyone
    who = count(len(robots), "robot")
    stops = findings.stops
    near = len(findings.near_misses)
    parts = [
        f"In {duration(series.duration)} {who} {'was' if len(robots) == 1 else 'were'} "
        f"judged {len(series.t):,} times: {count(len(stops), 'stop')}"
    ]
    if stops:
        needless = len(findings.stops_that_were(Sense.NEEDLESS))
        parts.append(f" ({needless or 'none'} of them needless)")
    parts.append(f", {count(near, 'near miss', 'near misses')}. ")
    parts.append(nearest_sentence(findings))
    if findings.faults:
        parts.append(
            f" In {count(findings.faults, 'cycle')} the input could not be believed."
        )
    if findings.problems or series.missing:
        parts.append(" The recording is not whole; see below.")
    if len(series.gaps):
        parts.append(
            f" There is {count(len(series.gaps), 'gap')} in it."
            if len(series.gaps) == 1
            else f" There are {count(len(series.gaps), 'gap')} in it."
        )
    return "".join(parts)


def nearest_sentence(findings: Findings) -> str:
    """Who came nearest to whom, and whether anything touched."""
    free = findings.free
    if not free:
        return "Nothing came within the margin in which pairs are reported."
    pair = free[0]
    who = f"{pair.a} and {pair.b}"
    when = clock(pair.at - findings.begin)
    if pair.distance <= 0.0:
        return (
            f"The modelled surfaces of {who} overlapped by "
            f"{millimetres(-pair.distance)} at {when}."
        )
    touched = [p for p in findings.contracts if p.distance <= 0.0]
    but = " but what a contract let touch" if touched else ""
    return (
        f"Nothing touched{but}; nearest were {who}, {millimetres(pair.distance)} apart "
        f"at {when}."
    )


def advice(findings: Findings) -> str:
    """What would have moved the most stops; "" where nothing tells."""
    early = [c for c in findings.causes if c.cause is not None and c.stops and c.remedy]
    if not early:
        return ""
    most = early[0]
    assert most.cause is not None
    return (
        f"Most stops ({most.stops} of {len(findings.stops)}) were made by "
        f"{most.cause.value}. For the one that lacked most, {most.remedy}."
    )


def when(findings: Findings) -> str:
    """When a recording was made, on the wall clock of its machine."""
    if not isfinite(findings.wall):
        return "at a time that is not known"
    made = datetime.fromtimestamp(findings.wall, UTC)
    return f"{made:%Y-%m-%d %H:%M:%S} UTC"


def moving_share(findings: Findings) -> str:
    """Share of the time in which nobody was stopped."""
    series = findings.series
    stopped = series.held[series.level >= Level.STOP].sum()
    return share(series.judged - float(stopped), series.judged)


def more_left(findings: Findings) -> str:
    """For how long there was more left than is drawn."""
    series = findings.series
    far = float(series.held[~(series.slack < LOOKED)].sum())
    alone = float(series.held[np.isinf(series.clearance)].sum())
    return (
        f"The guard looks {LOOKED * 1e3:.0f} ms ahead: for {duration(far)} "
        f"({share(far, series.judged)}) more than that was left. No pair was within "
        f"the margin for {duration(alone)} ({share(alone, series.judged)})."
    )
