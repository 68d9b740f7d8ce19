"""Which operator an episode gets."""

from typing import Any

import numpy as np

from closed_loop.judge import Judge
from closed_loop.operators import (
    Bools,
    Chase,
    Mixed,
    OneJoint,
    Operator,
    Reversals,
    Rough,
    Smooth,
)

# Operators by name, and how often an episode gets each.
SHARES = {
    "rough": 0.08,
    "smooth": 0.07,
    "one joint": 0.06,
    "reversals": 0.09,
    "chase any": 0.20,
    "chase arms": 0.20,
    "chase fixtures": 0.14,
    "chase movers": 0.16,
}

# How those who chase go about it, and how often.
PACES = {"full": 0.45, "feint": 0.3, "creep": 0.25}

# Shares of the top speed an episode is driven at, and how often.
SPEEDS = {1.0: 0.6, 0.5: 0.2, 0.2: 0.12, 0.05: 0.08}

# How often the arms have different operators.
MIXED = 0.25

# How often an operator slows down as much as the guard asks for.
OBEDIENT = 0.4


def cast(
    rng: np.random.Generator,
    judge: Judge,
    movers: tuple[str, ...],
    first_arm: Bools,
    attack: bool,
) -> tuple[str, Operator]:
    """The operator of an episode, and its name.

    Args:
        rng: Of the episode.
        judge: The judge.
        movers: Names of objects that move.
        first_arm: Which joints are the first arm's, shape (n,).
        attack: Whether it must be one who chases; at moving objects, if there are any.
    """
    name, operator = one_of(rng, judge, movers, attack)
    if attack or first_arm.all() or rng.random() > MIXED:
        return name, operator
    other_name, other = one_of(rng, judge, movers, False)
    return f"{name} + {other_name}", Mixed(operator, other, first_arm)


def one_of(
    rng: np.random.Generator, judge: Judge, movers: tuple[str, ...], attack: bool
) -> tuple[str, Operator]:
    """An operator for all arms, and its name."""
    shares = {
        name: share
        for name, share in SHARES.items()
        if fits(name, bool(movers), attack)
    }
    name = drawn(rng, shares)
    if name.startswith("chase"):
        pace = drawn(rng, PACES)
        kind = name.removeprefix("chase ")
        return f"{name}, {pace}", Chase(rng, judge, kind, movers, pace)
    kinds = {
        "rough": Rough,
        "smooth": Smooth,
        "one joint": OneJoint,
        "reversals": Reversals,
    }
    return name, kinds[name](rng, judge)


def fits(name: str, movers: bool, attack: bool) -> bool:
    """Whether an operator is one for the episode."""
    if attack and movers:
        return name == "chase movers"
    return name.startswith("chase" if attack else "") and (
        movers or name != "chase movers"
    )


def drawn(rng: np.random.Generator, shares: dict[Any, float]) -> Any:
    """One of some things, by weight."""
    weights = np.array(list(shares.values()))
    return list(shares)[int(rng.choice(len(weights), p=weights / weights.sum()))]
