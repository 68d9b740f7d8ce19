"""What the pair that slows or stops robots lacks, and what each cause adds to that."""

from armguard.guard.answer import Answer
from armguard.guard.levels import Reason
from armguard.guard.near_pair import NearPair
from armguard.guard.nuisance import Delayed, Lack
from armguard.guard.watch import RESTING


def lack_of(reason: Reason, answer: Answer) -> Lack | None:
    """What the pair that decides lacks; None if no near pair lacks anything."""
    k = answer.nearest
    if reason is Reason.SHORT_TIME:
        left = answer.near["time_left"]
        k = int(left.argmin()) if len(left) else -1
    if k < 0:
        return None
    pair = answer.pair(k)
    deficit = -pair.clearance
    if reason is Reason.SHORT_TIME:
        deficit = pair.short_by
    if not deficit > 0.0:
        return None
    return Lack(deficit, envelope_of(k, pair, reason, answer), delays_of(k, answer))


def envelope_of(k: int, pair: NearPair, reason: Reason, answer: Answer) -> float:
    """How much farther apart a pair's surfaces may be than was judged [m]."""
    names, tables = answer.names, answer.names.tables
    if tables is None or not names.robots:
        return pair.model_error
    modes = [tables.robots[r].mode for r in answer.robots_of(k) if r >= 0]
    proven = reason is not Reason.SHORT_TIME and "speed" not in modes
    if not proven or not pair.primitive_distance > 0.0:
        # Primitives were judged, whatever is known of the exact shapes.
        return pair.distance + pair.model_error - pair.primitive_distance
    # The proof asks the exact shapes too, where a link has some.
    has_exact = tables.exact.of_primitive[:, 1] > 0
    return sum(
        float((names.exact_errors if has_exact[i] else names.model_errors)[i])
        for i in answer.primitives(k)
    )


def delays_of(k: int, answer: Answer) -> tuple[Delayed, ...]:
    """What delays cost the sides of a pair, if its terms are known."""
    tables, budget = answer.names.tables, answer.budget
    if tables is None or budget is None or k != answer.nearest:
        return ()
    delays = []
    ways = (budget.reaction_a, budget.reaction_b)
    for r, way in zip(answer.robots_of(k), ways, strict=True):
        figures = None if r < 0 else tables.robots[r].stopping
        if figures is None:
            continue
        row = answer.robots[r]
        age, resting = float(row["age"]), row["phase"] == RESTING
        cycles = (2.0 if resting else 1.0) * (tables.period + tables.late)
        delays.append(
            Delayed(
                robot=tables.robots[r].name,
                way=way,
                time=age + figures.command + cycles,
                excess=max(age - figures.sensing, 0.0),
            )
        )
    return tuple(delays)
