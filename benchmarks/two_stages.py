"""What exact shapes buy: how often primitives alone would have stopped a clear arm.

python benchmarks/two_stages.py FOLDER    FOLDER: planning scenes with motion requests

Walked in steps of 0.02 rad, pairs of fingers not counted: the published paths,
which planners found free of collisions, and the straight lines in joint space from the
start to the goal of each request. A cycle in which a pair of primitives does not keep
its buffer would have been a stop with primitives alone; it is one only if the exact
shapes do not keep it either. Counted for the buffer of the scene and for none at all.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

from armguard.cli.console import say
from armguard.guard import Level, Reason
from armguard.respond import Guard
from armguard.scene import load_scene, load_trajectory
from armguard.scene.trajectory import densify
from episodes.campaign import command

STEP = 0.02

# Required distances that are tried: the paper's, and none [m].
BUFFERS = (0.03048, 0.0)

NOTHING = {"cycles": 0, "primitives_would_stop": 0, "stops": 0, "refined": 0}


def main() -> None:
    """Walk every motion, print one JSON object."""
    parser = command(__doc__)
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    root = parser.parse_args().folder
    totals: dict[str, dict[str, Any]] = {}
    for path in sorted([*root.glob("*/path*.csv"), *root.glob("*/request*.yaml")]):
        kind = path.stem.rstrip("0123456789")
        scene = path.with_name(f"scene{path.stem.removeprefix(kind)}.yaml")
        for buffer in BUFFERS:
            counts = walk(scene, path, buffer)
            name = f"{path.parent.name}, {kind}s, buffer {buffer * 1e3:.0f} mm"
            total = totals.setdefault(name, {"motions": 0, **NOTHING})
            total["motions"] += 1
            for key, value in counts.items():
                total[key] += value
        say(f"{path.parent.name}/{path.stem}")
    for total in totals.values():
        total["let_pass_by_exact_shapes"] = (
            total["primitives_would_stop"] - total["stops"]
        )
    print(json.dumps({"step": STEP, "totals": totals}, indent=1))


def walk(scene_file: Path, path: Path, buffer: float) -> dict[str, int]:
    """Levels along one motion, with and without the second stage."""
    scene = load_scene(scene_file)
    scene.buffer = buffer
    motion = load_trajectory(path)
    home = dict(zip(scene.q_names, scene.home.tolist(), strict=True))
    guard = Guard(scene)
    ends = motion.for_scene(scene, home)
    q = densify(np.clip(ends, guard.tables.lower, guard.tables.upper), STEP)
    counts = dict(NOTHING)
    for row in q:
        verdict = guard.step(row)
        if verdict.level is Level.STOP and verdict.reason is not Reason.TOO_CLOSE:
            continue
        near = [pair for pair in verdict.near if "finger" not in pair.a + pair.b]
        counts["cycles"] += 1
        counts["stops"] += any(pair.headroom < 0.0 for pair in near)
        counts["refined"] += verdict.counts.pairs_refined
        counts["primitives_would_stop"] += any(
            pair.primitive_distance < pair.buffer for pair in near
        )
    return counts


if __name__ == "__main__":
    main()
