"""Hooks of the site: links to files that are no pages, units in docstrings."""

import re

import griffe

# A link from docs/ to a file beside it, with the text of the link.
OUTSIDE = re.compile(r"\[([^\]]*)\]\(\.\./([^)#]*)[^)]*\)")


def on_page_markdown(markdown: str, **_: object) -> str:
    """Page in which such a file is named in place of the link."""
    return OUTSIDE.sub(
        lambda found: (
            found[1] if found[2] in found[1] else f"{found[1]} (`{found[2]}`)"
        ),
        markdown,
    )


class Units(griffe.Extension):
    """Units in brackets after other brackets, which Markdown reads as links."""

    def on_object(self, *, obj: griffe.Object, **_: object) -> None:
        """Escape the units in the docstring of one object."""
        if obj.docstring:
            obj.docstring.value = obj.docstring.value.replace("] [", r"] \[")
