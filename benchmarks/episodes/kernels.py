"""Which kernels figures were measured with."""

from collections.abc import Mapping
from functools import cache
from typing import Any

from armguard.kernel import kernel_digest

# Folders of the package that decide what a guard does; stations and benchmarks have
# kernels of their own, which change no episode.
GUARD = ("geometry", "robot", "scene", "index", "motion", "prove", "guard", "respond")

# In a row whose kernels were not written down.
UNKNOWN = "not recorded"


@cache
def kernels_of(*folders: str) -> str:
    """Hash of the kernels of some folders, of what they import, and of Numba's version.

    Args:
        folders: Folders of the package; those of the guard if none is named.
    """
    return kernel_digest(*(folders or GUARD))


def is_todays(run: Mapping[str, Any]) -> bool:
    """Whether a row was measured with the kernels of today."""
    return bool(run.get("kernels") == kernels_of(*run.get("of", ())))


def cell_of(run: Mapping[str, Any]) -> str:
    """A cell of a table: the kernels of a row, marked where they are not today's."""
    kernels = str(run.get("kernels", UNKNOWN))
    text = kernels if kernels == UNKNOWN else kernels[:8]
    for earlier in reversed(run.get("carried", ())):
        text += f" = {earlier['kernels'][:8]} in {earlier['compared']}"
    return text if is_todays(run) else f"{text} *"


def note() -> str:
    """What the mark in the tables of a page means."""
    return (
        "Rows marked * were measured with other kernels than "
        f"{kernels_of()[:8]}, the guard's when this page was written. Kernels "
        "*a = b in 50*: some episodes were run with b; 50 of them, run again with a, "
        "are the same."
    )


def kernels_in_words(results: Mapping[str, Any], *names: str) -> str:
    """The kernels of the runs of a page that has no column for them.

    Args:
        results: Figures with their `runs`, see `records.keep`.
        names: The runs; all if none is named.
    """
    runs = results.get("runs", {})
    chosen = names or [name for name in results if name != "runs"]
    by_kernels: dict[str, list[str]] = {}
    for name in chosen:
        by_kernels.setdefault(cell_of(runs.get(name, {})), []).append(name)
    cells = "; ".join(f"{k} of {', '.join(of)}" for k, of in by_kernels.items())
    return f"Kernels: {cells}. Marked *: other ones than when this page was written."
