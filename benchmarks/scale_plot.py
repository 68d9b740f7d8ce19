"""The figure of `armguard bench scale`.

armguard bench scale --json --output scale.json
python benchmarks/scale_plot.py scale.json
"""

import json
import sys
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

IMAGE = Path(__file__).parents[1] / "docs" / "images" / "bench_scale.png"

NAMES = {
    "brute_force": "brute force",
    "coal_dynamic_aabb_tree": "Coal, dynamic AABB tree (from Python)",
}


def main() -> None:
    """Draw the figure of the results in the file named on the command line."""
    result = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    plot_scale(result, IMAGE)


def plot_scale(result: dict[str, Any], path: Path) -> None:
    """Cycle, build and bytes against the number of primitives.

    Args:
        result: Answer of `bench_scale`.
        path: File to write.
    """
    rows = result["against_primitives"]
    sizes = [row["primitives"] for row in rows]
    figure = Figure(figsize=(14, 4.2), dpi=90)
    FigureCanvasAgg(figure)
    cycle, build, memory = figure.subplots(1, 3)

    ours = [row["ours"] for row in rows]
    cycle.loglog(sizes, [t["median_us"] for t in ours], "o-", label="octree")
    cycle.loglog(sizes, [t["p99_us"] for t in ours], ":", c="C0", label="octree, p99")
    for k, (name, label) in enumerate(NAMES.items(), start=1):
        found = [(n, r["peers"][name]) for n, r in zip(sizes, rows, strict=True)]
        points = [(n, p["median_us"]) for n, p in found if "median_us" in p]
        if points:
            cycle.loglog(*zip(*points, strict=True), "o-", c=f"C{k}", label=label)
    cycle.set_ylabel("a cycle in the bay [µs], medians")

    index = [row["index_build_s"] for row in rows]
    build.loglog(sizes, index, "o-", label="octree")
    whole = [row["guard_s"] for row in rows]
    build.loglog(sizes, whole, "o:", c="C0", label="guard, from the scene")
    coal = [
        (n, r["peers"]["coal_dynamic_aabb_tree"])
        for n, r in zip(sizes, rows, strict=True)
    ]
    points = [(n, p["build_s"]) for n, p in coal if "build_s" in p]
    if points:
        build.loglog(*zip(*points, strict=True), "o-", c="C2", label="Coal")
    build.set_ylabel("building [s]")

    total = [row["bytes_per_primitive"] for row in rows]
    tree = [row["tree_bytes_per_primitive"] for row in rows]
    memory.loglog(sizes, total, "o-", label="octree and world")
    memory.loglog(sizes, tree, "o:", c="C0", label="octree")
    memory.axhline(300.0, color="0.7", linewidth=0.8)
    memory.set_ylabel("bytes a primitive")

    for axes in (cycle, build, memory):
        axes.set_xlabel("primitives")
        axes.grid(True, which="major", alpha=0.3)
        axes.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(path)


if __name__ == "__main__":
    main()
