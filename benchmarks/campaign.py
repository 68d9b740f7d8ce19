"""The long run: every benchmark at full length, results and plots into docs/.

make campaign                              all of it, about twenty minutes
make campaign ARGS="--only cycle scale"    these anew, the others as they were
make campaign ARGS=--only                  the page from the last results
"""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes

from armguard.cli.console import say
from bench import run
from episodes.kernels import kernels_in_words
from episodes.records import keep, read
from pages import DOCS, rendered
from plots import FRAMED, drawn
from speed.index import agree_on_random_states

RESULTS = DOCS / "results.json"

# Row 24 of the paper's systems: the verdict after so many cycles is a fresh start's.
DRIFT_CYCLES = 10_000_000
RANDOM_STATES = 1_000_000

PARTS: dict[str, Callable[[], dict[str, Any]]] = {
    "cycle": lambda: run("cycle", progress=say),
    "robots": lambda: run("robots", progress=say),
    "index": lambda: run("index", progress=say),
    "random_states": lambda: agree_on_random_states(RANDOM_STATES, say),
    "distance": lambda: run("distance", progress=say),
    "scale": lambda: run("scale", progress=say),
    "memory": lambda: run("memory", cycles=DRIFT_CYCLES, progress=say),
}

NAMES = {
    "brute_force": "brute force",
    "coal_dynamic_aabb_tree": "Coal, dynamic AABB tree (from Python)",
}

Rows = list[dict[str, Any]]


def main() -> None:
    """Run, write docs/results.json and docs/benchmarks.md, draw the plots."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="*", choices=PARTS, default=list(PARTS))
    for part in parser.parse_args().only:
        # All are run at full length, or not at all.
        keep(RESULTS, part, PARTS[part](), 1.0)
    write_page(read(RESULTS), DOCS)
    say("wrote docs/results.json, docs/benchmarks.md and its images")


def write_page(results: dict[str, Any], docs: Path) -> None:
    """Write the page and its plots."""
    text = rendered("benchmarks", **results, kernels=kernels_in_words(results))
    (docs / "benchmarks.md").write_text(text, encoding="utf-8")
    plot_index(results["index"], docs / "images" / "bench_index.png")
    plot_scale(results["scale"], docs / "images" / "bench_scale.png")


def draw(axes: Axes, rows: Rows, x: str, y: str, style: str = "o-", **how: Any) -> None:
    """A line through figures of the rows that have them."""
    known = [row for row in rows if y in row]
    axes.plot([row[x] for row in known], [row[y] for row in known], style, **how)


# Plots with a frame and a grid, packed tightly.
BOXED = {
    **dict.fromkeys(("axes__spines__top", "axes__spines__right"), True),
    **{"axes__axisbelow": "line", "figure__constrained_layout__use": False},
    **{"figure__autolayout": True, "figure__dpi": 90},
}


def plot_index(index: dict[str, Any], path: Path) -> None:
    """Time against N, against links moving, against the number of primitives."""
    grid = {"axes__grid": True, **BOXED, **FRAMED}
    with drawn(path, (13, 4), 3, **grid) as (left, middle, right):
        draw(left, index["time_against_N"], "leaf_capacity", "median_us")
        left.set(yscale="log", xlabel="N, objects a leaf may hold")
        left.set_ylabel("median cycle [µs]")
        moving = index["time_against_links_moving"]
        draw(middle, moving, "links_moving", "median_us")
        middle.set_ylim(bottom=0)
        middle.set_xlabel("links moving")
        for key, label in (("octree", "octree"), ("brute_force", "brute force")):
            rows = [{**r, **r[key]} for r in index["octree_against_brute_force"]]
            draw(right, rows, "primitives", "median_us", label=label)
        right.set(xscale="log", yscale="log", xlabel="primitives")
        right.legend()


def plot_scale(result: dict[str, Any], path: Path) -> None:
    """Cycle, build and bytes against the number of primitives."""
    rows = result["against_primitives"]
    lighter = {"style": ":", "c": "C0"}
    with drawn(path, (14, 4.2), 3, **BOXED, **FRAMED) as (cycle, build, memory):
        ours = [{**row, **row["ours"]} for row in rows]
        draw(cycle, ours, "primitives", "median_us", label="octree")
        draw(cycle, ours, "primitives", "p99_us", **lighter, label="octree, p99")
        peers = {name: [{**r, **r["peers"][name]} for r in rows] for name in NAMES}
        for k, (name, label) in enumerate(NAMES.items(), start=1):
            draw(cycle, peers[name], "primitives", "median_us", c=f"C{k}", label=label)
        cycle.set_ylabel("a cycle in the bay [µs], medians")

        lighter["style"] = "o:"
        whole = {**lighter, "label": "guard, from the scene"}
        draw(build, rows, "primitives", "index_build_s", label="octree")
        draw(build, rows, "primitives", "guard_s", **whole)
        coal = peers["coal_dynamic_aabb_tree"]
        draw(build, coal, "primitives", "build_s", c="C2", label="Coal")
        build.set_ylabel("building [s]")

        tree, both = "tree_bytes_per_primitive", "octree and world"
        draw(memory, rows, "primitives", "bytes_per_primitive", label=both)
        draw(memory, rows, "primitives", tree, **lighter, label="octree")
        memory.axhline(300.0, color="0.7", linewidth=0.8)
        memory.set_ylabel("bytes a primitive")
        for axes in (cycle, build, memory):
            axes.set(xscale="log", yscale="log", xlabel="primitives")
            axes.grid(True, which="major")
        # Room for the legend below the curves.
        cycle.set_ylim(bottom=0.05)
        for axes in (cycle, build, memory):
            axes.legend(fontsize=8)


if __name__ == "__main__":
    main()
