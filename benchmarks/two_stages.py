"""What exact shapes buy: how often primitives alone would have stopped a clear arm.

python benchmarks/two_stages.py FOLDER    FOLDER: planning scenes with motion requests

The straight line in joint space from the start to the goal of each request is walked in
steps of 0.02 rad, grippers kept within their limits. A cycle in which a pair of
primitives does not keep its buffer would have been a stop with primitives alone; it is
one only if the exact shapes do not keep it either.
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from armguard.cli.console import say
from armguard.guard import Guard, Level, Reason
from armguard.scene import load_scene, load_trajectory
from armguard.scene.trajectory import densify

STEP = 0.02


def main() -> None:
    """Walk every motion, print one JSON object."""
    root = Path(sys.argv[1])
    totals = {"cycles": 0, "primitives_would_stop": 0, "stops": 0, "refined": 0}
    scenes: dict[str, dict[str, Any]] = {}
    for path in sorted(root.glob("*/request*.yaml")):
        number = path.stem.removeprefix("request")
        scene = path.with_name(f"scene{number}.yaml")
        if not scene.exists():
            continue
        counts = walk(scene, path)
        say(f"{path.parent.name}/{path.stem}: {counts}")
        scenes[f"{path.parent.name}/{path.stem}"] = counts
        for key in totals:
            totals[key] += counts[key]
    totals["let_pass_by_exact_shapes"] = (
        totals["primitives_would_stop"] - totals["stops"]
    )
    print(json.dumps({"step": STEP, "totals": totals, "scenes": scenes}, indent=1))


def walk(scene_file: Path, path: Path) -> dict[str, int]:
    """Levels along one motion, with and without the second stage."""
    scene = load_scene(scene_file)
    motion = load_trajectory(path)
    home = dict(zip(scene.q_names, scene.home.tolist(), strict=True))
    guard = Guard(scene)
    ends = motion.for_scene(scene, home)
    q = densify(np.clip(ends, guard.tables.lower, guard.tables.upper), STEP)
    counts = {"cycles": 0, "primitives_would_stop": 0, "stops": 0, "refined": 0}
    for row in q:
        verdict = guard.step(row)
        if verdict.level is Level.STOP and verdict.reason is not Reason.TOO_CLOSE:
            continue
        counts["cycles"] += 1
        counts["stops"] += verdict.reason is Reason.TOO_CLOSE
        counts["refined"] += verdict.counts.pairs_refined
        counts["primitives_would_stop"] += any(
            near.primitive_distance < near.buffer for near in verdict.near
        )
    return counts


if __name__ == "__main__":
    main()
