"""What many episodes of getting out of the way came to, in figures and on a page."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from closed_loop.judge import SIGHT
from episodes import kernels
from episodes.classes import classes, counted, percentile
from episodes.records import TOLD, Digest, rows_of

Figures = dict[str, Any]

# Least share of the things that can be evaded that are to be [-].
SHARE = 0.95

# How two figures of one name are put together that are no sums.
EXTREME: Mapping[str, Callable[[float, float], float]] = {
    "nearest_evaded_mm": min,
    "nearest_else_mm": min,
    "slowest_cycle_us": max,
}

# Ends of classes of speeds [m/s], and of closest distances [mm].
SPEEDS = (0.4, 0.7, 1.0)
DISTANCES = (5, 20, 60)

# Width of a class of cycle times [us].
CLASS = 10

# From this share on, the way of what was hit counts as along the thing's [-].
ALONG = 0.7


def summed_up(episodes: list[Figures]) -> Figures:
    """Figures of episodes, all of which but extremes are sums."""
    can = [e for e in episodes if e["evadable"]]
    out = [e for e in can if e["evaded"]]
    hit = [e for e in can if not e["evaded"]]
    times = [t for e in episodes for t in e["cycle_times"]]
    secondary = [e for e in episodes if e["touched"]]
    return {
        "episodes": len(episodes),
        "evadable": len(can),
        "evaded": len(out),
        "evadable_hit": len(hit),
        "other_evaded": sum(e["evaded"] and not e["evadable"] for e in episodes),
        "other_hit": sum(not (e["evaded"] or e["evadable"]) for e in episodes),
        "secondary": len(secondary),
        "secondary_seeds": [[e["seed"], *e["touched"][0]] for e in secondary[:TOLD]],
        "evadable_by": counted(sorts(can)),
        "evaded_by": counted(sorts(out)),
        "why": counted(e["why"] for e in hit),
        "went_along": sum((e["along"] or 0.0) >= ALONG for e in hit),
        "hit_seeds": [[e["seed"], e["why"], e["hit"]] for e in hit[:TOLD]],
        "stops": counted(reason for e in episodes for reason in e["stops"]),
        "episodes_with_a_stop": sum(bool(e["stops"]) for e in episodes),
        "closest": counted(near(e["mover_least"]) for e in out),
        "nearest_evaded_mm": 1e3 * min((e["mover_least"] for e in out), default=SIGHT),
        "nearest_else_mm": 1e3 * min(e["others_least"] for e in episodes),
        "cycle_us": classes((1e6 * t for t in times), CLASS),
        "slowest_cycle_us": 1e6 * max(times),
        "ways_tried": sum(e["ways_tried"] for e in episodes),
        "simulated_s": sum(e["simulated_s"] for e in episodes),
        "worked_s": sum(e["worked_s"] for e in episodes),
    }


def digest(episode: Figures) -> Digest:
    """What came of an episode, in short."""
    if episode["touched"]:
        outcome = "secondary contact"
    else:
        evadable = "" if episode["evadable"] else ", not evadable"
        outcome = ("evaded" if episode["evaded"] else "hit") + evadable
    least = 1e3 * min(episode["mover_least"], episode["others_least"])
    return Digest(episode["seed"], outcome, least, {"stops": len(episode["stops"])})


def sorts(episodes: list[Figures]) -> Iterable[str]:
    """What each episode is counted as: by speed, and by what the arm does."""
    for episode in episodes:
        end = next(s for s in SPEEDS if episode["speed"] <= s)
        yield f"up to {end} m/s"
        yield "at work" if episode["works"] else "at rest"


def near(distance: float) -> str:
    """The class of a closest distance [m]."""
    end = next((d for d in DISTANCES if 1e3 * distance < d), None)
    return f"{DISTANCES[-1]} mm or more" if end is None else f"less than {end} mm"


def share(figures: Figures) -> float:
    """Share of the things that can be evaded that were [-]."""
    return float(figures["evaded"] / max(figures["evadable"], 1))


def is_broken(figures: Figures) -> bool:
    """Whether a promise is broken."""
    return figures["secondary"] > 0 or share(figures) < SHARE


def sentence(place: str, figures: Figures) -> str:
    """The figures that matter."""
    return (
        f"{place}: {figures['episodes']} episodes, {figures['evadable']} evadable, "
        f"{figures['evaded']} of these evaded ({100.0 * share(figures):.1f} %), "
        f"{figures['secondary']} with a secondary contact, "
        f"{figures['episodes_with_a_stop']} with a stop"
    )


def page(results: Mapping[str, Figures]) -> str:
    """docs/evading.md."""
    head = f"| {' | '.join(COLUMNS)} |\n|{' --- |' * len(COLUMNS)}"
    return PAGE.format(
        head=head,
        rows="\n".join(
            row(p, f) for p, found in results.items() for f in rows_of(found)
        ),
        more="\n".join(more(*item) for item in results.items() if item[1]["episodes"]),
        note=kernels.note(),
    )


def row(place: str, figures: Figures) -> str:
    """A row of the table."""
    times = figures["cycle_us"]
    return (
        f"| {place} | {figures['episodes']:,} | {figures['evadable']} | "
        f"{figures['evaded']} ({100.0 * share(figures):.1f} %) | "
        f"{figures['evadable_hit']} | {figures['other_hit']} | "
        f"{figures['secondary']} | {figures['nearest_evaded_mm']:.1f} | "
        f"{figures['nearest_else_mm']:.1f} | {percentile(times, 0.5)} / "
        f"{percentile(times, 0.99)} / {figures['slowest_cycle_us']:.0f} | "
        f"{kernels.told(figures)} |"
    )


def more(place: str, figures: Figures) -> str:
    """What there is to say beside the table."""
    can, out = figures["evadable_by"], figures["evaded_by"]
    by = ", ".join(f"{out.get(k, 0)} of {n} {k}" for k, n in can.items())
    cost = figures["worked_s"] / figures["episodes"]
    lines = [
        f"**{place}**: evaded {by}. Closest of what was evaded: "
        f"{listed(figures['closest'])}. What the search found no way out of was hit "
        f"{figures['other_hit']} times and evaded {figures['other_evaded']} times. "
        f"Episodes with a stop before a hit: {figures['episodes_with_a_stop']}; "
        f"stops: {listed(figures['stops'])}. {cost:.1f} s of a core each. Not "
        f"evadable: {figures['episodes'] - figures['evadable']}."
    ]
    if figures["evadable_hit"]:
        lines.append(
            f"Why {figures['evadable_hit']} were hit that could have evaded: "
            f"{listed(figures['why'])}. In {figures['went_along']} of them what was "
            "hit had gone along with the thing."
        )
        seeds = "; ".join(f"{s}: {why}, {hit}" for s, why, hit in figures["hit_seeds"])
        lines.append(f"Some of their seeds: {seeds}.")
    if figures.get("left_out"):
        lines.append(f"Left out: {listed(figures['left_out'])}.")
    if figures["secondary"]:
        seeds = "; ".join(
            f"{s}: {a} and {b} at {t:.2f} s"
            for s, a, b, t in figures["secondary_seeds"]
        )
        lines.append(f"Secondary contacts: {seeds}.")
    return " ".join(lines) + "\n"


def listed(counts: Mapping[str, int]) -> str:
    """Counts in words, the most frequent first."""
    first = sorted(counts.items(), key=lambda item: -item[1])
    return ", ".join(f"{n} {name}" for name, n in first) or "none"


COLUMNS = (
    "place",
    "episodes",
    "evadable",
    "of these evaded",
    "of these hit",
    "others hit",
    "secondary contacts",
    "closest of what was evaded [mm]",
    "closest of all else [mm]",
    "cycle, median / 99 % / slowest [us]",
    "kernels",
)

PAGE = """# Evading: many things thrown and pushed at arms

`make evading` writes this page, and goes on where it was left: episodes of one version
of kernels, plant, throws and judge are added up. Asked for are no secondary contacts,
and that of what can be evaded 95 % is.

Two arms of the bay, or two Pandas face to face, stand anywhere 40 mm off everything;
half of those thrown at are at work, swaying at up to a tenth of their top speeds. A
ball or a box of 30 to 80 mm half a side comes straight at a link, at 0.1 to 1 m/s, and
is seen 0.6 to 2 s before it would touch. Its way, which ends 0.4 m behind the place
where it would touch, is free of all that stands and 0.1 m off the other arm. The guard
is told its pose and velocity every 4 to 20 ms, up to 8 ms late, and a top speed of up
to 1.3 times its speed. The arms have `response: {{evade: true}}`, all else as it is if
left out: half of their top speeds, 1 s before, or up to 2 s if they know no good way.
A cycle is 4 ms.

The plant is late and misses what it is told by all that the scene declares: delays,
errors of position, of velocity and of tracking, the same for up to 0.3 s. It does not
swing. A thing that hits an arm goes on through it, and does not move it.

True states are judged, every cycle, by MuJoCo: an arm and the thing, and an arm and
anything else (secondary). The scenes have no unknown space to go into. Distances are
seen up to 60 mm. Cycle times are those of the machine the episodes ran on, whatever
else it did meanwhile.

*Evadable* is what an off-line search finds a way out of: of some 440 straight ways in
joint space, sped up and slowed down as declared, at the speed the arm may evade at,
begun with the declared delays after the thing is first seen, one keeps 5 mm to it and
to all else, from then on until its way is over, by the same judge. So the search may
begin earlier than the arm. It knows where the thing will be, and errors of
tracking do not trouble it. What it does not find may still be evadable.

Of an arm that was hit and could have evaded is told why: *it never began* to; *it began
too late*, as the same search finds no way out of where it was when it began; *it was
stopped* in between; or *its way did not lead out*, though there was one. What was hit
had gone *along with the thing* if 0.7 of its way till then was along that of the
thing.

{head}
{rows}

{note}

{more}"""
