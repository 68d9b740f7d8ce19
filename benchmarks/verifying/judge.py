"""A proof of a plan against dense samples of Coal."""

from time import process_time
from typing import Any

import numpy as np

from armguard.prove.paving import NearInterval
from armguard.prove.tube import Tube
from arrays import Floats
from verifying.oracle import positions
from verifying.plans import Case

# Ends of intervals are this exact [s].
RESOLUTION = 5e-5

# Dense samples of a plan.
SAMPLES = 800

# What ends of intervals may be off, and first contacts [s].
ENDS, FIRST = 1e-4, 1e-3

# How far Coal's distances may be off [m].
ACCURACY = 1e-6


def intervals_of(case: Case, tube: Tube) -> list[NearInterval]:
    """What is not proven of a tube."""
    paver = case.world.paver
    return paver.intervals(paver.pave(tube, RESOLUTION), tube, RESOLUTION)


def off_rows(case: Case, times: Floats, rng: np.random.Generator) -> Floats:
    """Positions that are off by the declared errors, each joint to either side."""
    span = case.curves.times[[0, -1]]
    rows = positions(case.curves, times)
    for robot, skew in case.skew.items():
        late = np.clip(times + skew * rng.choice([-1.0, 1.0]), *span)
        own = [n.startswith(f"{robot}/") for n in case.world.scene.q_names]
        rows[:, own] = positions(case.curves, late)[:, own]
    side = rng.choice([-1.0, 1.0], rows.shape[1])
    return np.asarray(rows + case.following * side)


def too_near(
    case: Case, found: list[NearInterval], times: Floats, distances: Floats
) -> int:
    """Pairs that are below their buffer at a time outside all their intervals."""
    count = 0
    for k, pair in enumerate(case.world.oracle.pairs):
        below = distances[:, k] < case.world.oracle.buffer(*pair) - ACCURACY
        for one in found if below.any() else ():
            if pair == tuple(sorted((one.nearest.a, one.nearest.b))):
                below &= ~((times >= one.start) & (times <= one.end))
        count += bool(below.any())
    return count


def end_errors(case: Case, found: list[NearInterval]) -> list[bool]:
    """Whether each end within the plan is farther off than it may be."""
    first, last = case.curves.times[[0, -1]]
    wrong = []
    for one in found:
        if one.end - one.start < 4.0 * ENDS or one.nearest.distance > (
            one.buffer - 1e-5
        ):
            continue
        pair = one.nearest.a, one.nearest.b
        for end, inwards in ((one.start, ENDS), (one.end, -ENDS)):
            if not first < end < last:
                continue
            near = np.array([end, end + inwards])
            gaps = case.world.oracle.distance(positions(case.curves, near), *pair)
            outside, inside = gaps - one.buffer
            wrong.append(not (outside >= -ACCURACY and inside <= ACCURACY))
    return wrong


def first_contact_error(
    case: Case, found: list[NearInterval], times: Floats, distances: Floats
) -> float | None:
    """How far the first contact is from that of samples, beyond their step [s].

    Returns:
        None where samples see none.
    """
    least = distances.min(axis=1)
    contacts = [one.contact for one in found if one.contact is not None]
    touching = least <= -1e-5
    if not touching.any():
        return None
    if not contacts:
        return float(np.inf)
    at, step = int(np.argmax(touching)), float(times[1] - times[0])
    dense = np.linspace(max(times[at] - step, times[0]), times[at], 60)
    gaps = case.world.oracle.near_distances(positions(case.curves, dense)).min(axis=1)
    exact = float(dense[np.argmax(gaps <= 0.0)])
    if min(contacts) < exact - FIRST:
        # A contact shorter than the step of the samples; it is looked for there.
        soon = min(contacts) + np.linspace(0.0, FIRST, 100)
        near = case.world.oracle.near_distances(positions(case.curves, soon)).min(
            axis=1
        )
        if near.min() <= ACCURACY:
            return max(0.0, float(soon[np.argmax(near <= ACCURACY)]) - min(contacts))
    return max(0.0, abs(min(contacts) - exact) - float(dense[1] - dense[0]))


def judged(case: Case, seed: int) -> dict[str, Any]:
    """A proof, what dense samples say of it, and what samples of equal cost miss."""
    rng = np.random.default_rng([seed, 76])
    # The first proof in a world fills its cells.
    intervals_of(case, case.tube)
    start = process_time()
    found = intervals_of(case, case.tube)
    seconds = process_time() - start
    span = case.curves.times[[0, -1]]
    times = np.linspace(*span, SAMPLES)
    oracle, alone = case.world.oracle, not case.tube.wide.any()
    distances = oracle.near_distances(positions(case.curves, times))
    missed = too_near(case, found, times, distances)
    without = dict.fromkeys(case.without, 0)
    if not alone:
        some = times[::2]
        shifted = oracle.near_distances(off_rows(case, some, rng))
        missed += too_near(case, found, some, shifted)
        for name in ("following error", "skew"):
            if name in case.without:
                left = intervals_of(case, case.without[name])
                without[name] = int(too_near(case, left, some, shifted) > 0)
    if "bow" in case.without:
        left = intervals_of(case, case.without["bow"])
        without["bow"] = int(too_near(case, left, times, distances) > 0)
    ends = end_errors(case, found) if alone else []
    first = first_contact_error(case, found, times, distances) if alone else None
    return {
        "intervals": len(found),
        "missed": missed,
        "ends": len(ends),
        "ends_off": sum(ends),
        "first_off": int(first is not None and not first <= FIRST),
        "firsts": int(first is not None),
        "without": without,
        "seconds": seconds,
        **samples_of_equal_cost(case, found, seconds),
    }


def samples_of_equal_cost(
    case: Case, found: list[NearInterval], seconds: float
) -> dict[str, int]:
    """Whether samples that take as long see each interval of the curves."""
    oracle, span = case.world.oracle, case.curves.times[[0, -1]]
    start, count = process_time(), 8
    oracle.near_distances(positions(case.curves, np.linspace(*span, count)))
    cost = (process_time() - start) / count
    number = max(int(seconds / cost), 2)
    times = np.linspace(*span, number)
    unseen = 0
    for one in found:
        real = one.nearest.distance < one.buffer - 1e-5
        seen = ((times >= one.start) & (times <= one.end)).any()
        unseen += int(real and not seen)
    return {"samples": number, "unseen": unseen}
