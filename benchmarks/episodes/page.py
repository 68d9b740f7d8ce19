"""Pages of campaigns of episodes, from templates and the figures of their rows."""

from collections.abc import Mapping

from episodes import kernels
from episodes.classes import percentile
from episodes.records import Figures, rows_of
from pages import rendered


def page(name: str, results: Mapping[str, Figures]) -> str:
    """The page of a campaign.

    Args:
        name: Its results' file in docs, without the ending; also its template's.
        results: Figures of all its rows.
    """
    text = rendered(
        name,
        results=results,
        rows=[(kind, r) for kind, found in results.items() for r in rows_of(found)],
        note=kernels.note(),
        listed=listed,
        percentile=percentile,
    )
    return text.rstrip() + "\n"


def listed(counts: Mapping[str, int]) -> str:
    """Counts in words, the most frequent first."""
    first = sorted(counts.items(), key=lambda item: -item[1])
    return ", ".join(f"{n} {name}" for name, n in first) or "none"
