"""Plots of docs/, all drawn in one way."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.figure import Figure

# Of all plots.
STYLE = {
    "figure.dpi": 110,
    "figure.constrained_layout.use": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "grid.alpha": 0.3,
    "legend.frameon": False,
}

# Legends in a frame.
FRAMED = {"legend__frameon": True}


@contextmanager
def drawn(
    path: Path,
    size: tuple[float, float],
    columns: int = 1,
    rows: int = 1,
    *,
    share_y: bool = False,
    **style: Any,
) -> Iterator[list[Any]]:
    """Places of a figure, row by row, that is written once they are drawn.

    Args:
        path: Where it is written.
        size: Its width and height [in].
        columns: Places beside each other.
        rows: Places above each other.
        share_y: Whether their y axes are one.
        style: Settings of Matplotlib, with `__` for a dot.
    """
    with rc_context({**STYLE, **{k.replace("__", "."): v for k, v in style.items()}}):
        figure = Figure(figsize=size)
        yield list(figure.subplots(rows, columns, sharey=share_y, squeeze=False).flat)
        figure.savefig(path)
