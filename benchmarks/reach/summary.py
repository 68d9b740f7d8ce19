"""From trials to figures, of the same trials for all guards and peers; and the page."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch

from episodes import kernels
from episodes.records import Digest, Figures, Records, versions_of
from pages import rendered
from plots import drawn
from reach.answers import ANSWERS
from reach.arena import SCENES

Rows = Sequence[Mapping[str, Any]]
Results = Mapping[str, Mapping[str, Any]]

# How goals are reached: straight where that is certified; straight where only a bent
# way is; led along that way. Titles of plots and sections of the page.
ROADS = {
    "straight": (
        "straight way certified",
        "The operator's own way is certified",
    ),
    "bends": (
        "only a bent way certified; steers straight",
        "Only a bent way is certified, and the operator steers straight",
    ),
    "led": (
        "the same goals, along the certified way",
        "The same goals, the operator following the certified way",
    ),
}

WHATS = ("goals", "slides")

# Digits of the numbers of a trial that are kept.
DIGITS = 4

# What begins the outcome of a trial that says nothing.
LEFT_OUT = "left out: "

COLOURS = ("#0072B2", "#009E73", "#E69F00", "#56B4E9", "#D55E00", "#CC79A7")
COLOUR_OF = dict(zip(ANSWERS, COLOURS, strict=True))


def digest(trial: Mapping[str, Any]) -> Digest:
    """What came of a trial, in short."""
    slide = trial.get("slide")
    runs = trial["runs"] if slide is None else {"slide": slide}
    numbers = {
        f"{road} {name}": float(f"{value:.{DIGITS}g}")
        for road, run in runs.items()
        for name, value in numbers_of(run).items()
    }
    touched = any(run["contact"] is not None for run in runs.values())
    kind = "slide" if slide is not None else trial["kind"]
    least = 1e3 * min(run["least"] for run in runs.values())
    return Digest(trial["seed"], kind + ", contact" * touched, least, numbers)


def numbers_of(run: Mapping[str, Any]) -> dict[str, float]:
    """What is kept of a run; what did not happen is 0."""
    return {
        "reached": run["reached"] or 0.0,
        "stops": len(run["stops"]),
        "contacts": int(run["contact"] is not None),
        "least": 1e3 * run["least"],
        "jerk_told": run["jerk_told"][0],
        "jerk_true": run["jerk_true"][0],
        "call": 1e6 * run["call"][0],
        "call_p999": 1e6 * run["call"][1],
        **{name: run[name] for name in ("nominal", "chatter", "blocked")},
        **{f"share {k}": share for k, share in enumerate(run.get("share", ()))},
    }


def runs_of(digests: Sequence[Digest], road: str) -> Rows:
    """Runs of trials by one road, as they were kept."""
    return [
        {"kind": digest.outcome.split(",")[0]}
        | {
            name.removeprefix(f"{road} "): value
            for name, value in digest.counts.items()
            if name.startswith(f"{road} ")
        }
        for digest in digests
        if f"{road} nominal" in digest.counts
    ]


def compared(records: Records) -> Iterator[tuple[str, str, Figures]]:
    """Figures of goals or slides that all guards and peers of a scene had.

    Yields:
        Whether "goals" or "slides", the scene, and by answer its figures. Rows of which
        no trials are kept are given as they are.
    """
    for what, scene in ((what, scene) for what in WHATS for scene in SCENES):
        rows: dict[str | None, dict[str, Figures]] = {}
        for answer in ANSWERS:
            known = records.kinds.get(f"{scene}/{answer}/{what}")
            for row in [] if known is None else versions_of(known):
                key = row["kernels"] if "seeds" in row else None
                rows.setdefault(key, {})[answer] = row
        # What was run with the kernels of today comes first.
        for key in sorted(rows, key=lambda key: key != kernels.kernels_of()):
            some = rows[key]
            same = some if key is None else on_the_same(records, scene, what, some)
            yield what, scene, same


def on_the_same(records: Records, scene: str, what: str, rows: Figures) -> Figures:
    """Figures by answer, of the trials that all of them had."""
    trials = {
        answer: records.digests(f"{scene}/{answer}/{what}", row["version"])
        for answer, row in rows.items()
    }
    seeds = set.intersection(*map(set, trials.values()))
    beside = set.union(*map(set, trials.values())) - seeds
    figures: Figures = {}
    for answer, row in rows.items():
        found = [trials[answer][seed] for seed in sorted(seeds)]
        kept = [d for d in found if not d.outcome.startswith(LEFT_OUT)]
        out = [d.outcome.removeprefix(LEFT_OUT) for d in found if d not in kept]
        figures[answer] = {
            "drawn": len(found),
            "left_out": dict(Counter(out)),
            "not_by_all": len(beside),
            "kernels": row["kernels"],
        }
        if what == "goals":
            figures[answer] |= {r: figures_of(runs_of(kept, r)) for r in ROADS}
        else:
            slides = slid_far(runs_of(kept, "slide"))
            figures[answer] |= {**slides, "first": row.get("first")}
    return figures


def figures_of(runs: Rows) -> Figures | None:
    """Figures of some runs; None if there are none."""
    if not runs:
        return None
    reached = [r for r in runs if r.get("reached") and not r.get("contacts")]
    return {
        "goals": len(runs),
        "reached": len(reached),
        "reached_without_stop": sum(not r.get("stops") for r in reached),
        **shared_figures(runs),
        "time_by_nominal": median([r["reached"] / r["nominal"] for r in reached]),
        "jerk_told_rms": median(all_of(runs, "jerk_told")),
        "jerk_true_rms": median(all_of(runs, "jerk_true")),
        "blocked": float(np.mean(all_of(runs, "blocked"))),
        # Median and 99.9th percentile of a call, medians over trials [us].
        "call_us": {
            kind: [median(all_of(some, key)) for key in ("call", "call_p999")]
            for kind in ("joints", "tools")
            if (some := [r for r in runs if r["kind"] == kind])
        },
    }


def slid_far(runs: Rows) -> Figures:
    """Figures of slides."""
    if not runs:
        return {"slides": 0}
    shares = [v for r in runs for key, v in r.items() if key.startswith("share ")]
    far = {"share_median": median(shares), "share_least": min(shares)}
    return {"slides": len(runs), **far, **shared_figures(runs)}


def shared_figures(runs: Rows) -> Figures:
    """What figures of goals and of slides have in common."""
    return {
        "contacts": int(sum(all_of(runs, "contacts"))),
        "stops": int(sum(all_of(runs, "stops"))),
        "least_mm": min(all_of(runs, "least")),
        "chatter_median": median(all_of(runs, "chatter")),
    }


def all_of(runs: Rows, name: str) -> list[float]:
    """A number of all runs."""
    return [r.get(name, 0.0) for r in runs]


def median(values: Sequence[float]) -> float | None:
    """The median; None of nothing."""
    return float(np.median(values)) if len(values) else None


def draw_goals(goals: Results, path: Path) -> None:
    """Goals reached without a stop, and those with one, in shares of the goals."""
    scenes = [s for s in SCENES if s in goals]
    answers = [a for a in ANSWERS if any(a in goals[scene] for scene in scenes)]
    wide = 0.8 / len(answers)
    with drawn(path, (10.0, 3.6), len(ROADS), share_y=True) as places:
        for axes, (road, (title, _)) in zip(places, ROADS.items(), strict=True):
            for k, answer in enumerate(answers):
                found = [goals[s].get(answer, {}).get(road) for s in scenes]
                known = {i: row for i, row in enumerate(found) if row}
                at = [i + (k - 0.5 * (len(answers) - 1)) * wide for i in known]
                after, clean = (
                    [100.0 * row[name] / row["goals"] for row in known.values()]
                    for name in ("reached", "reached_without_stop")
                )
                axes.bar(at, after, wide, color=COLOUR_OF[answer], alpha=0.3)
                axes.bar(at, clean, wide, color=COLOUR_OF[answer], label=answer)
            axes.set_title(title, fontsize=10)
            axes.set_xticks(np.arange(len(scenes)), scenes, rotation=20, fontsize=8)
            axes.axhline(95.0, color="black", linewidth=0.7, linestyle=":")
        places[0].set_ylabel("goals reached [%]\n(pale: after a stop)")
        legend(places)


def draw_slides(slides: Results, path: Path) -> None:
    """How far tools get along, over time; the first slide of each scene."""
    first = {
        scene: {a: rows[a]["first"] for a in ANSWERS if rows.get(a, {}).get("first")}
        for scene, rows in sorted(slides.items(), key=lambda s: SCENES.index(s[0]))
    }
    known = {scene: rows for scene, rows in first.items() if rows}
    count = max(len(known), 1)
    with drawn(path, (2.6 * count, 3.6), count, axes__axisbelow="line") as places:
        for axes, (scene, rows) in zip(places, known.items(), strict=False):
            for answer, slide in rows.items():
                ways = 1e3 * np.array(slide["along_m"]).T
                times = np.arange(len(ways)) * slide["step_s"]
                lines = axes.plot(times, ways, color=COLOUR_OF[answer])
                lines[0].set_label(answer)
            axes.set_title(scene, fontsize=10)
            axes.set_xlabel("time [s]")
            axes.grid(True)
        places[0].set_ylabel("way along the surface [mm]")
        legend(places)


def legend(places: Sequence[Axes]) -> None:
    """A legend of all responses drawn in any of some places, in their order."""
    labels = {label for axes in places for label in axes.get_legend_handles_labels()[1]}
    names = [answer for answer in ANSWERS if answer in labels]
    if names:
        patches = [Patch(color=COLOUR_OF[name]) for name in names]
        above = {"loc": "outside upper center", "fontsize": 8, "frameon": True}
        places[0].figure.legend(patches, names, ncols=len(names), **above)


def write_page(records: Records, docs: Path) -> None:
    """Write the page and its plots."""
    same: dict[str, dict[str, Any]] = {what: {} for what in WHATS}
    others: dict[str, dict[str, Any]] = {what: {} for what in WHATS}
    for what, scene, rows in compared(records):
        kept = all("not_by_all" in row for row in rows.values())
        into = same if kept and scene not in same[what] else others
        into[what].setdefault(scene, {}).update(rows)
    # What is drawn is what can be compared, where there is any.
    goals, slides = ({**others[what], **same[what]} for what in WHATS)
    draw_goals(goals, docs / "images" / "reach_goals.png")
    draw_slides(slides, docs / "images" / "reach_slides.png")
    shown = {scene: goals[scene] for scene in SCENES if goals.get(scene)}
    calls = [
        (scene, answer, next(f[r] for r in ROADS if f.get(r))["call_us"])
        for scene, answer, f in each(goals)
        if any(f.get(road) for road in ROADS)
    ]
    text = rendered(
        "reach",
        note=kernels.note(),
        same=same,
        others=others,
        counts=[line for what in WHATS for line in counts(same[what], what)],
        roads=ROADS,
        each=each,
        numbers="; ".join(f"{s} {goals_of(rows)}" for s, rows in shown.items()),
        alike=", ".join(s for s, r in shown.items() if "not_by_all" in first_of(r)),
        missing=", ".join(
            a for a in ANSWERS if all(a not in rows for rows in slides.values())
        ),
        calls=calls,
    )
    (docs / "reach.md").write_text(text, encoding="utf-8")


def counts(results: Results, what: str) -> Iterator[str]:
    """Goals or slides of each scene that are compared, and how many are left out."""
    for scene in [s for s in SCENES if s in results]:
        one = first_of(results[scene])
        left = [f"{n} ({why})" for why, n in one["left_out"].items()]
        if one["not_by_all"]:
            left.append(f"{one['not_by_all']} (not run with all responses)")
        answers, none = ", ".join(results[scene]), ", ".join(left) or "none"
        yield (
            f"{scene}: {one['drawn']} {what} with each of {answers}; left out {none}."
        )


def first_of(rows: Mapping[str, Any]) -> Mapping[str, Any]:
    """Figures of the first response of a scene."""
    found: Mapping[str, Any] = next(iter(rows.values()))
    return found


def goals_of(rows: Mapping[str, Any]) -> str:
    """Fewest and most goals of the responses of a scene."""
    numbers = {
        sum(figures[road]["goals"] for road in [*ROADS][:2] if figures.get(road))
        for figures in rows.values()
    }
    return " to ".join(map(str, sorted({min(numbers), max(numbers)})))


def each(results: Results, road: str | None = None) -> list[tuple[str, str, Any]]:
    """Scenes and responses in order, with their figures; with goals by a road only."""
    return [
        (scene, answer, results[scene][answer])
        for scene in SCENES
        for answer in ANSWERS
        if answer in results.get(scene, {})
        if road is None or results[scene][answer].get(road)
    ]
