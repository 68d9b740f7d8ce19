"""The long run: every benchmark at full length, results and plots into docs/.

make campaign                              all of it, about twenty minutes
make campaign ARGS="--only cycle scale"    these anew, the others as they were
"""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from armguard.benchmark import run
from armguard.benchmark.index import agree_on_random_states
from armguard.cli.console import say
from episodes.kernels import told_of
from episodes.records import keep, read
from scale_plot import IMAGE as SCALE_IMAGE
from scale_plot import plot_scale

DOCS = Path(__file__).parents[1] / "docs"

# Row 24 of the paper's systems: the verdict after so many cycles is a fresh start's.
DRIFT_CYCLES = 10_000_000
RANDOM_STATES = 1_000_000


RESULTS = DOCS / "results.json"

PARTS: dict[str, Callable[[], dict[str, Any]]] = {
    "cycle": lambda: run("cycle", progress=say),
    "index": lambda: run("index", progress=say),
    "random_states": lambda: agree_on_random_states(RANDOM_STATES, say),
    "distance": lambda: run("distance", progress=say),
    "scale": lambda: run("scale", progress=say),
    "memory": lambda: run("memory", cycles=DRIFT_CYCLES, progress=say),
}


def main() -> None:
    """Run, write docs/results.json and docs/benchmarks.md, draw the plots."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS))
    for part in parser.parse_args().only:
        # All are run at full length, or not at all.
        keep(RESULTS, part, PARTS[part](), 1.0)
    results = read(RESULTS)
    (DOCS / "benchmarks.md").write_text(page(results), encoding="utf-8")
    plot(results["index"], DOCS / "images" / "bench_index.png")
    plot_scale(results["scale"], SCALE_IMAGE)
    say("wrote docs/results.json, docs/benchmarks.md and its images")


def page(results: dict[str, Any]) -> str:
    """The figures as a page."""
    cycle, index, memory = (results[k] for k in ("cycle", "index", "memory"))
    machine = cycle["machine"]
    row1 = index["row_1"]
    states = results["random_states"]
    lines = [
        "# Benchmarks",
        "",
        "Written by `make campaign`; every figure is from one run on one machine: "
        f"{machine['cpu']}, {machine['cores']} cores, Python {machine['python']}. "
        "`armguard bench NAME --json` prints them for yours. Times are wall times of "
        "calls from Python on one core, collector off, the contestants in turns.",
        "",
        "## A cycle in the bay, all 14 links moving",
        "",
        "| who | median | p99 | p99.9 | max | ratio of medians |",
        "| --- | --- | --- | --- | --- | --- |",
        time_row("`Guard.step`", cycle["ours"], 1.0),
        time_row("… level and nearest read", cycle["ours_with_report_read"], None),
        time_row("… least of five passes", cycle["ours_undisturbed"], None),
        *(
            time_row(name, peer, cycle["ratio"][name])
            for name, peer in cycle["peers"].items()
        ),
        "",
        f"{cycle['pairs_tested_mean']:.1f} of {cycle['pairs_checkable']} pairs are "
        f"measured a cycle. p99.9 is {cycle['p999_over_median']:.1f} × the median, "
        f"without the noise {cycle['p999_over_median_undisturbed']:.1f} ×. On "
        f"{cycle['agreement']['configurations']} configurations, "
        f"{cycle['agreement']['with_near_pairs']} of them with near pairs, the peers "
        "find the same near pairs as the guard: "
        + ", ".join(
            f"{name} {cycle['agreement'][name]['same']}" for name in cycle["peers"]
        )
        + ".",
        "",
        "## The octree",
        "",
        "| N | median [µs] | p99 [µs] | nodes | pairs sharing a leaf | measured | "
        "link-cycles that change leaf |",
        "| --- | --- | --- | --- | --- | --- | --- |",
        *(
            f"| {r['leaf_capacity']} | {r['median_us']:.2f} | {r['p99_us']:.1f} | "
            f"{r['nodes']} | {r['share_sharing_leaf']:.1%} | "
            f"{r['share_measured']:.1%} | {r['link_cycles_that_change_leaf']:.3%} |"
            for r in index["time_against_N"]
        ),
        "",
        "| links moving | median [µs] | links checked | pairs measured |",
        "| --- | --- | --- | --- |",
        *(
            f"| {r['links_moving']} | {r['median_us']:.2f} | {r['links_checked']} | "
            f"{r['pairs_tested']:.1f} |"
            for r in index["time_against_links_moving"]
        ),
        "",
        "| primitives | octree [µs] | p99 | brute force [µs] | ratio | same verdicts |",
        "| --- | --- | --- | --- | --- | --- |",
        *(
            f"| {r['primitives']} | {r['octree']['median_us']:.1f} | "
            f"{r['octree']['p99_us']:.1f} | {r['brute_force']['median_us']:.1f} | "
            f"{r['ratio']:.1f} | {'yes' if r['same_verdicts'] else 'NO'} |"
            for r in index["octree_against_brute_force"]
        ),
        "",
        "![time against N, links moving and primitives](images/bench_index.png)",
        "",
        f"At N = 5 and 1 ms steps {row1['share_of_pairs_sharing_a_leaf_at_N5']:.1%} of "
        "the checkable pairs share a leaf and "
        f"{row1['share_of_pairs_measured_at_N5']:.1%} are measured; "
        f"{row1['share_of_link_cycles_that_change_leaf_1ms']:.3%} of link-cycles "
        f"change leaf. N = 4 … 12 spread by {row1['N4_to_N12_spread']:.0%}. When only "
        f"the last link moves, {row1['links_checked_when_only_the_last_moves']} is "
        f"checked. The tree changes in {index['changes_of_leaf']['1ms']['cycles']:.2%} "
        f"of the cycles at 1 ms, in {index['changes_of_leaf']['30ms']['cycles']:.0%} "
        "at the paper's 30 ms. The octree is faster from "
        f"{row1['octree_overtakes_at']} primitives on.",
        "",
        f"On {states['states']:,} random joint states, jumps and walks between them, "
        f"{states['too_close']:,} of them too close, the verdicts of octree and brute "
        f"force differ {states['verdicts_that_differ']} times.",
        "",
        *distance_section(results["distance"]),
        *scale_section(results["scale"]),
        "## Memory, drift, start",
        "",
        f"- {memory['cycles']:,} cycles: {memory['kernel_allocations']} allocations in "
        f"the kernel; resident memory grew by {memory['resident_growth_kib']} KiB.",
        "- Verdicts identical, bit for bit, to a fresh guard's on "
        f"{memory['configurations_compared']} configurations: "
        f"{'yes' if memory['verdicts_identical_to_a_fresh_guard'] else 'NO'}.",
        "- Composing rotations for 10⁵ steps, at a lever of 1 m: float32 "
        f"{memory['drift']['composed_float32_m'] * 1e3:.3f} mm, float64 "
        f"{memory['drift']['composed_float64_m'] * 1e3:.1e} mm, from angles 0.",
        f"- `import armguard` {memory['start_s']['import']:.2f} s; a warm start to the "
        f"first verdict {memory['start_s']['warm_first_verdict']:.2f} s; the first "
        f"start ever, compiling, {memory['start_s']['first_ever_verdict']:.0f} s.",
        "",
        told_of(results),
        "",
    ]
    return "\n".join(lines)


def distance_section(distance: dict[str, Any]) -> list[str]:
    """Single distances beside Coal's."""
    return [
        "## One distance",
        "",
        "Signed distance, witness points and normal, in compiled code on one core; "
        "shapes of a robot link's size in random poses, most of them apart. Coal with "
        "its own tolerance of 1e-6, ours is 1e-9; what its call from Python adds, "
        f"{distance['call_overhead_taken_off_ns']:.0f} ns, is taken off. The median of "
        f"the ratios is {distance['ratio']['coal']:.2f}.",
        "",
        "| pair | ours [ns] | p99 | Coal [ns] | p99 | ratio | apart | overlapping |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
        *(
            f"| {r['pair']} | {r['ours_ns']:.0f} | {r['ours_p99_ns']:.0f} | "
            f"{r['coal_ns']:.0f} | {r['coal_p99_ns']:.0f} | {r['ratio']:.2f} | "
            f"{r['ratio_apart']:.2f} | {r['ratio_overlapping']:.2f} |"
            for r in distance["by_pair"]
        ),
        "",
    ]


def scale_section(scale: dict[str, Any]) -> list[str]:
    """Up to a million primitives."""
    return [
        "## Up to a million boxes around the bay",
        "",
        "| primitives | cycle [µs] | against 35 | brute force [µs] | Coal's tree [µs] "
        "| build [s] | Coal's | bytes a primitive |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
        *(
            f"| {r['primitives']:,} | {r['ours']['median_us']:.1f} | "
            f"{r['over_first_size']:.2f} | {peer_time(r, 'brute_force')} | "
            f"{peer_time(r, 'coal_dynamic_aabb_tree')} | {r['index_build_s']:.2g} | "
            f"{r['peers']['coal_dynamic_aabb_tree'].get('build_s', 0.0):.2g} | "
            f"{r['bytes_per_primitive']:.0f} |"
            for r in scale["against_primitives"]
        ),
        "",
        "![cycle, build and memory](images/bench_scale.png)",
        "",
        *(
            f"- {r['moving']:,} boxes moving among {r['standing']:,} that stand: "
            f"{r['us_per_moving']:.1f} µs each a cycle."
            for r in scale["moving"]
        ),
        "",
    ]


def peer_time(row: dict[str, Any], name: str) -> str:
    """Median of a peer in microseconds, or a dash where it was left out."""
    peer = row["peers"][name]
    return f"{peer['median_us']:.0f}" if "median_us" in peer else "-"


def time_row(name: str, times: dict[str, float], ratio: float | None) -> str:
    """A row of times in microseconds."""
    cells = " | ".join(
        f"{times[key]:.1f}" for key in ("median_us", "p99_us", "p999_us", "max_us")
    )
    return f"| {name} | {cells} | {'' if ratio is None else f'{ratio:.1f}'} |"


def plot(index: dict[str, Any], path: Path) -> None:
    """Time against N, against links moving, against the number of primitives."""
    figure = Figure(figsize=(13, 4), dpi=90)
    FigureCanvasAgg(figure)
    left, middle, right = figure.subplots(1, 3)
    rows = index["time_against_N"]
    left.plot([r["leaf_capacity"] for r in rows], [r["median_us"] for r in rows], "o-")
    left.set_yscale("log")
    left.set_xlabel("N, objects a leaf may hold")
    left.set_ylabel("median cycle [µs]")
    rows = index["time_against_links_moving"]
    middle.plot([r["links_moving"] for r in rows], [r["median_us"] for r in rows], "o-")
    middle.set_ylim(bottom=0)
    middle.set_xlabel("links moving")
    rows = index["octree_against_brute_force"]
    for key, label in (("octree", "octree"), ("brute_force", "brute force")):
        right.plot(
            [r["primitives"] for r in rows],
            [r[key]["median_us"] for r in rows],
            "o-",
            label=label,
        )
    right.set_xscale("log")
    right.set_yscale("log")
    right.set_xlabel("primitives")
    right.legend()
    for axes in (left, middle, right):
        axes.grid(alpha=0.3)
    figure.tight_layout()
    figure.savefig(path)


if __name__ == "__main__":
    main()
