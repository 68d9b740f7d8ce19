"""HTML tables, as notebooks show them."""

from collections.abc import Iterable, Sequence
from html import escape


def html_table(
    caption: str, head: Sequence[str], rows: Iterable[Sequence[object]]
) -> str:
    """A small table; all text is escaped.

    Args:
        caption: Line above the table.
        head: Names of the columns.
        rows: Cells of each row.
    """
    lines = ["".join(f"<th>{escape(name)}</th>" for name in head)]
    lines += ["".join(f"<td>{escape(str(cell))}</td>" for cell in row) for row in rows]
    body = "".join(f"<tr>{line}</tr>" for line in lines)
    return f"<table><caption>{escape(caption)}</caption>{body}</table>"
