"""Pictures of maps: diagrams with a schedule, time lines of robots, and slices."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from armguard.maps.cell_plan import CoordinationError, Segment
from armguard.maps.coordination import CoordinationMap
from armguard.maps.diagram import Diagram, Grid
from armguard.maps.schedule import Schedule
from armguard.maps.slices import Slice
from armguard.prove.tile_search import TOUCHING, UNKNOWN

Side = Literal["left", "right"]

# Times that differ by less are the same [s].
ROUNDING = 1e-9

# Colours that differ for the colour-blind as well.
FORBIDDEN, OPEN, DEADLOCK, WAY = "#b5483a", "#f0b73f", "#b9c4d6", "#1f5fa8"
WORDS = {TOUCHING: ("forbidden", FORBIDDEN), UNKNOWN: ("not proven", OPEN)}

SEGMENTS = ("#9dbfe3", "#c9dcef")

# Share of a time line that a letter takes [-].
ROOM = 0.011

# Share of a picture below which a region has no word [-].
LEAST = 2e-4

# How much longer a word is than half of its height [-].
WORD = 8

# Waits of less than this share of the whole time have no word [-].
SHORT = 0.04

# Names of segments above this count would cover each other.
MOST_NAMES = 24


@contextmanager
def figure_at(path: Path, width: float, height: float) -> Iterator[Any]:
    """A figure that is written once it is drawn.

    Raises:
        CoordinationError: Matplotlib is missing.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        raise CoordinationError(
            "pictures need matplotlib: pip install 'armguard[plot]'"
        ) from None
    figure = Figure(figsize=(width, height), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    yield figure
    figure.savefig(path)


def draw_map(cell: CoordinationMap, schedule: Schedule | None, path: Path) -> None:
    """Draw the diagrams of a map, and below the time lines of a schedule.

    Args:
        cell: The map.
        schedule: Its schedule, if there is one.
        path: File to write, PNG or SVG.

    Raises:
        CoordinationError: Matplotlib is missing.
    """
    count = len(cell.diagrams)
    rows = 0.6 * len(cell.robots) + 1.2
    with figure_at(path, 7.0 * count, 6.4 + rows * (schedule is not None)) as figure:
        heights = [6.4] if schedule is None else [6.4, rows]
        grid = figure.add_gridspec(len(heights), count, height_ratios=heights)
        for k, diagram in enumerate(cell.diagrams):
            axes = figure.add_subplot(grid[0, k])
            draw_diagram(axes, cell, diagram, schedule)
        if schedule is not None:
            draw_time_lines(figure.add_subplot(grid[1, :]), cell, schedule)


def draw_diagram(
    axes: Any, cell: CoordinationMap, diagram: Diagram, schedule: Schedule | None
) -> None:
    """Draw one diagram: what is forbidden, where no way is left, and the schedule."""
    one, other = diagram.robots
    ends = [
        start + time
        for start, time in zip(diagram.starts, diagram.durations, strict=True)
    ]
    locked = cell.deadlocks(diagram), DEADLOCK, "no way out"
    draw_cells(axes, diagram.labels, [locked], diagram.starts, diagram.step)
    if schedule is not None:
        r, s = (schedule.robots.index(name) for name in diagram.robots)
        x, y = schedule.plan_times[:, r], schedule.plan_times[:, s]
        axes.plot(x, y, color=WAY, lw=2.0)
        for wait in schedule.waits:
            long = wait.duration > SHORT * schedule.makespan
            if wait.robot in diagram.robots and long:
                mark_wait(axes, wait.robot, schedule.at(wait.start)[[r, s]], one)
    axes.set(
        xlim=(diagram.starts[0], ends[0]),
        ylim=(diagram.starts[1], ends[1]),
        xlabel=f"time of {one}'s plan [s]",
        ylabel=f"time of {other}'s plan [s]",
        title=f"{one} and {other}: white parts may be executed together",
    )
    name_segments(axes, cell.segments[one], cell.segments[other])


def mark_wait(axes: Any, robot: str, place: NDArray[np.float64], one: str) -> None:
    """Write at a place of the way that a robot waits there."""
    axes.plot(*place, "o", color=WAY, ms=5)
    shift = (-6, 6) if robot == one else (6, -6)
    axes.annotate(
        f"{robot} waits",
        place,
        xytext=shift,
        textcoords="offset points",
        fontsize=8,
        color=WAY,
        ha="right" if robot == one else "left",
        va="bottom" if robot == one else "top",
    )


def draw_cells(
    axes: Any,
    labels: Grid,
    layers: list[tuple[NDArray[np.bool_], str, str]],
    starts: tuple[float, float],
    step: float,
) -> None:
    """Draw the cells of a grid that are not free, and a word for each kind of them.

    Args:
        axes: Where to.
        labels: See `Diagram.labels`.
        layers: Further kinds below these: cells, colour and word of each.
        starts: Where the grid begins on both axes.
        step: Side of a cell.
    """
    from matplotlib.colors import to_rgba

    k, m = labels.shape
    shown = np.full((m, k, 4), 1.0)
    layers = layers + [
        (labels == label, colour, word) for label, (word, colour) in WORDS.items()
    ]
    for where, colour, _ in layers:
        shown[where.T] = to_rgba(colour)
    x, y = starts
    extent = [x, x + k * step, y, y + m * step]
    axes.imshow(shown, origin="lower", extent=extent, aspect="equal")
    for where, colour, word in layers:
        if where.mean() < LEAST:
            continue
        place, has_room = roomiest(where, len(word))
        at = np.array(starts) + step * place
        if has_room:
            ink = "white" if colour == FORBIDDEN else "black"
            axes.text(*at, word, color=ink, ha="center", va="center", fontsize=9)
        else:
            axes.annotate(
                word,
                at,
                xytext=(30, -28) if at[1] > y + 0.2 * m * step else (-90, 40),
                textcoords="offset points",
                arrowprops={"arrowstyle": "-", "lw": 0.6},
                fontsize=9,
            )


def roomiest(
    where: NDArray[np.bool_], letters: int
) -> tuple[NDArray[np.float64], bool]:
    """The place in cells with most room for a word, and whether there is enough."""
    best, place = 0, np.zeros(2)
    for j in np.flatnonzero(where.any(axis=0)):
        edges = np.flatnonzero(np.diff(np.pad(where[:, j], 1).astype(int)))
        for first, end in edges.reshape(-1, 2):
            room = rows_about(where[(first + end) // 2], int(j))
            size = min(end - first, WORD * room)
            if size > best:
                best, place = size, np.array([0.5 * (first + end), j + 0.5])
    return place, best >= ROOM * letters * max(where.shape)


def rows_about(column: NDArray[np.bool_], j: int) -> int:
    """How many cells of a column are set on either side of one that is."""
    up, down = np.flatnonzero(~column[j:]), np.flatnonzero(~column[: j + 1][::-1])
    above = int(up[0]) if len(up) else len(column) - j
    return min(above, int(down[0]) if len(down) else j + 1)


def name_segments(
    axes: Any, first: tuple[Segment, ...], second: tuple[Segment, ...]
) -> None:
    """Draw where named segments begin, with their names beside the diagram."""
    for one in first[1:]:
        axes.axvline(one.start, color="black", lw=0.4, alpha=0.35)
    for one in second[1:]:
        axes.axhline(one.start, color="black", lw=0.4, alpha=0.35)
    top, right = axes.secondary_xaxis("top"), axes.secondary_yaxis("right")
    for axis, segments, turn in ((top, first, 45), (right, second, 0)):
        shown = segments if len(segments) <= MOST_NAMES else ()
        axis.tick_params(length=0, labelsize=8, labelrotation=turn)
        ticks = [0.5 * (one.start + one.end) for one in shown]
        set_ticks = axis.set_xticks if axis is top else axis.set_yticks
        set_ticks(ticks, [one.name for one in shown])


def draw_time_lines(axes: Any, cell: CoordinationMap, schedule: Schedule) -> None:
    """Draw when each robot executes which segment, and when it waits."""
    count, whole = len(schedule.robots), schedule.makespan
    for r, robot in enumerate(schedule.robots):
        y = count - 1 - r
        waits = [one for one in schedule.waits if one.robot == robot]
        for n, segment in enumerate(cell.segments[robot]):
            start = time_at(schedule, r, segment.start, "right")
            end = time_at(schedule, r, segment.end, "left")
            free = [one.start for one in waits if start < one.start < end]
            until = min(free, default=end)
            draw_bar(axes, y, start, end, SEGMENTS[n % 2])
            name_bar(axes, y, start, until, segment.name, whole)
        for wait in waits:
            over = wait.start + wait.duration
            draw_bar(axes, y, wait.start, over, OPEN)
            name_bar(axes, y, wait.start, over, "waits", whole)
    one_by_one = f"{cell.one_after_another:.1f} s one after the other"
    axes.set(
        yticks=range(count),
        xlim=(0.0, whole),
        xlabel="time [s]",
        title=f"{whole:.1f} s together, {one_by_one}",
    )
    axes.set_yticklabels(schedule.robots[::-1])


def time_at(schedule: Schedule, r: int, time: float, side: Side) -> float:
    """When a robot is at a time of its plan: the first such time, or the last [s].

    Args:
        schedule: The schedule.
        r: The robot.
        time: The time of its plan [s].
        side: "left" for the first, "right" for the last.
    """
    own, times = schedule.plan_times[:, r], schedule.times
    at = int(np.searchsorted(own, time - ROUNDING, side))
    if side == "right":
        at = int(np.searchsorted(own, time + ROUNDING, side)) - 1
        return float(np.interp(time, own[at : at + 2], times[at : at + 2]))
    return float(
        np.interp(time, own[max(at - 1, 0) : at + 1], times[max(at - 1, 0) : at + 1])
    )


def draw_bar(axes: Any, y: int, start: float, end: float, colour: str) -> None:
    """Draw a bar from one time to another."""
    axes.barh(y, end - start, left=start, height=0.6, color=colour)


def name_bar(
    axes: Any, y: int, start: float, end: float, word: str, whole: float
) -> None:
    """Write a word between two times of a line, if there is room.

    Args:
        axes: Where to.
        y: The line.
        start: Where the room begins [s].
        end: Where it ends [s].
        word: The word.
        whole: Length of the line [s].
    """
    if end - start > ROOM * len(word) * whole:
        middle = 0.5 * (start + end)
        axes.text(middle, y, word, ha="center", va="center", fontsize=8)


def draw_slice(found: Slice, path: Path) -> None:
    """Draw a slice of configurations.

    Args:
        found: The slice.
        path: File to write, PNG or SVG.

    Raises:
        CoordinationError: Matplotlib is missing.
    """
    with figure_at(path, 7.0, 6.8) as figure:
        axes = figure.add_subplot()
        draw_cells(axes, found.labels, [], found.lower, found.step)
        axes.set(
            xlim=(found.lower[0], found.upper[0]),
            ylim=(found.lower[1], found.upper[1]),
            xlabel=f"{found.joints[0]} [{found.units[0]}]",
            ylabel=f"{found.joints[1]} [{found.units[1]}]",
            aspect="auto",
        )
        axes.set_title(
            f"white configurations are free, {found.others}: {found.shares}", fontsize=9
        )
