"""Proven motions against samples: how many are proven, and whether one fails.

    python benchmarks/batch_proofs.py [motions]

Motions are 0.15 of the way between two random configurations. Each is sampled at 101
places by the checker's own rows, which the tests compare with Coal.
"""

import sys

import numpy as np

import armguard as ag
from armguard.scene import two_pandas_scene
from armguard.scene.compile import compile_scene

MOTIONS = 10_000
SHARE = 0.15
SAMPLES = 101
PART = 500

# Motions that keep this distance from every buffer should be proven [m].
CLEARANCE = 0.005


def main() -> None:
    """Print counts of the bay and of two Pandas."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else MOTIONS
    for name, make in (("bay", ag.bay_scene), ("two Pandas", two_pandas_scene)):
        scene = make()
        tables, checker = compile_scene(scene), ag.Checker(scene)
        rng = np.random.default_rng(11)
        size = (2, count, len(tables.lower))
        starts, ends = rng.uniform(tables.lower, tables.upper, size)
        ends = starts + SHARE * (ends - starts)
        found = checker.prove(starts, ends)
        share = np.linspace(0.0, 1.0, SAMPLES)[None, :, None]
        parts = []
        for k in range(0, count, PART):
            way = (ends - starts)[k : k + PART, None]
            rows = (starts[k : k + PART, None] + share * way).reshape(-1, size[2])
            room = checker._found(rows, 2.0 * CLEARANCE, 1.0, 0.0)[:, 0]
            parts.append(room.reshape(-1, SAMPLES).min(axis=1))
        room = np.concatenate(parts)
        kept, far = room >= 0.0, room >= CLEARANCE
        print(
            f"{name}: {found.proven.sum()} of {count} motions proven; samples deny "
            f"{(found.proven & ~kept).sum()} of them; of {far.sum()} that stay "
            f"{CLEARANCE * 1e3:g} mm clear {found.proven[far].mean():.4f} are proven"
        )


if __name__ == "__main__":
    main()
