"""Proven motions against samples: how many are proven, and whether one fails.

    python benchmarks/batch_proofs.py [motions]

Motions are 0.15 of the way between two random configurations. Each is sampled at 101
places by the checker's own rows, which the tests compare with Coal.
"""

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

import armguard as ag
from armguard.scene import two_pandas_scene
from episodes.campaign import command

MOTIONS = 10_000
SHARE = 0.15
SAMPLES = 101
PART = 500

# Motions that keep this distance from every buffer should be proven [m].
CLEARANCE = 0.005

# Ranges of least headroom in which the share of proven motions is counted [m].
LARGEST = 0.02
EDGES = (0.0, 1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, LARGEST)


def measure(count: int) -> dict[str, dict[str, Any]]:
    """Counts of the bay and of two Pandas."""
    found = {}
    for name, make in (("bay", ag.bay_scene), ("two Pandas", two_pandas_scene)):
        checker = ag.Checker(make())
        rng = np.random.default_rng(11)
        starts, ends = rng.uniform(
            checker.lower, checker.upper, (2, count, len(checker.lower))
        )
        ends = starts + SHARE * (ends - starts)
        proven = checker.prove(starts, ends).proven
        share = np.linspace(0.0, 1.0, SAMPLES)[None, :, None]
        parts = []
        for k in range(0, count, PART):
            way = (ends - starts)[k : k + PART, None]
            rows = (starts[k : k + PART, None] + share * way).reshape(
                -1, starts.shape[1]
            )
            room = checker._found(rows, 2.0 * LARGEST, 1, 0.0)[0]
            parts.append(room.reshape(-1, SAMPLES).min(axis=1))
        room = np.concatenate(parts)
        found[name] = {
            "motions": count,
            "proven": int(proven.sum()),
            "denied": int((proven & ~(room >= 0.0)).sum()),
            "far": int((room >= CLEARANCE).sum()),
            "far and proven": int((proven & (room >= CLEARANCE)).sum()),
            "share by clearance": [
                share_of(proven[(room >= low) & (room < high)])
                for low, high in pairwise(EDGES)
            ],
        }
    return found


def share_of(flags: NDArray[np.bool_]) -> float | None:
    """Share of the flags that are set; None if there are none."""
    return float(flags.mean()) if len(flags) else None


def main() -> None:
    """Print counts."""
    parser = command(__doc__)
    parser.add_argument("motions", nargs="?", type=int, default=MOTIONS)
    count = parser.parse_args().motions
    for name, row in measure(count).items():
        print(
            f"{name}: {row['proven']} of {count} motions proven; samples deny "
            f"{row['denied']} of them; of {row['far']} that stay "
            f"{CLEARANCE * 1e3:g} mm clear {row['far and proven']} are proven"
        )


if __name__ == "__main__":
    main()
