"""Hooks of the site: links to files that are no pages; docstrings."""

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


class Docstrings(griffe.Extension):
    """Docstrings of this package as the site's reader of docstrings takes them."""

    def on_object(self, *, obj: griffe.Object, **_: object) -> None:
        """Name the section of examples; escape units, which Markdown reads as links."""
        if obj.docstring:
            text = obj.docstring.value.replace("] [", r"] \[")
            text = re.sub("^Example:$", "Examples:", text, flags=re.MULTILINE)
            obj.docstring.value = text
