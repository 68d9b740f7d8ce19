"""Prose of the pages, and how easy it is to read."""

import re
from pathlib import Path

import textstat

ROOT = Path(__file__).parents[1]

# README, start page, and the six pages that a new user reads first.
FIRST_PAGES = (
    ROOT / "README.md",
    *(
        ROOT / "docs" / f"{name}.md"
        for name in (
            "index",
            "install",
            "your-robot",
            "your-loop",
            "when-it-stops",
            "concepts",
            "reference",
        )
    ),
)

# Code of a page: fenced blocks, indented ones, and words in a sentence.
FENCED = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)
INDENTED = re.compile(r"(?<=\n\n)(?:    .*\n)+")
INLINE = re.compile(r"`[^`]*`")
LINK = re.compile(r"!?\[([^\]]*)\]\([^)]*\)")


def without_code(text: str) -> str:
    """Text of a page without code; its lines keep their numbers."""
    for code in (FENCED, INDENTED):
        text = code.sub(lambda found: "\n" * found[0].count("\n"), text)
    return INLINE.sub(lambda found: "code" + "\n" * found[0].count("\n"), text)


def prose(text: str) -> str:
    """Sentences of a page: no code, no tables, no headings, no targets of links."""
    text = LINK.sub(r"\1", without_code(text))
    return re.sub(r"^(?:\||#|:::).*$", "", text, flags=re.MULTILINE)


def reading_ease(page: Path) -> float:
    """Flesch reading ease of a page; 50 or more is fairly easy [-]."""
    text = prose(page.read_text(encoding="utf-8"))
    return float(textstat.flesch_reading_ease(text))


if __name__ == "__main__":
    for first_page in FIRST_PAGES:
        name = first_page.relative_to(ROOT)
        print(f"Flesch reading ease {reading_ease(first_page):5.1f}  {name}")
