"""The records of messages as docs/service.md and examples/armguard.h publish them.

    python -m armguard.service.wire.published --write

Rows of the page's tables and structs of the C header follow from the records of
`layout`; the comment of a field there is its text on the page. Rows of parts with a
variable length are the page's own, and so is all other text.
"""

import inspect
import re
import sys
from collections.abc import Iterator, Mapping
from hashlib import sha256
from itertools import groupby
from pathlib import Path
from textwrap import dedent
from typing import Any

import numpy as np

from armguard.errors import ArmguardError
from armguard.service.wire import layout, sensing

ROOT = Path(__file__).parents[4]
PAGE, HEADER = Path("docs/service.md"), Path("examples/armguard.h")
COMMAND = "python -m armguard.service.wire.published --write"

LAYOUTS = {
    name: one
    for name, one in (vars(layout) | vars(sensing)).items()
    if isinstance(one, layout.Layout)
}

# Titles of tables that are not the name of their record.
TITLES = {"HEADER": "header", "ROBOT": "of each robot", "SENSOR": "of each sensor"}
TITLES |= {"CHANGE": "of each change"}

C_TYPES = {"f8": "double", "f4": "float", "i4": "int32_t", "i8": "int64_t"}
C_TYPES |= {f"u{n}": f"uint{8 * n}_t" for n in (1, 2, 4, 8)}

# Longest line of the C header.
WIDTH = 92

FIELD = re.compile(r"    (\w+): .*?  # (.+)")
MORE = re.compile(r"    # (.+)")
VERSION = re.compile(r"version (\d+), records ([0-9a-f]{16})")


class PublishedError(ArmguardError):
    """Records have other bytes and the same version, or a field has no text."""


def digest(layouts: Mapping[str, layout.Layout[Any]] = LAYOUTS) -> str:
    """Hash of the fields and offsets of all records."""
    fields = [(name, one.dtype.descr) for name, one in sorted(layouts.items())]
    return sha256(repr(fields).encode()).hexdigest()[:16]


def texts(record: type) -> dict[str, str]:
    """Text of each field of a record: the comment at its declaration.

    Raises:
        PublishedError: A field has none.
    """
    found: dict[str, str] = {}
    name = ""
    for line in dedent(inspect.getsource(record)).splitlines():
        if field := FIELD.fullmatch(line):
            name, found[field[1]] = field[1], field[2]
        elif (more := MORE.fullmatch(line)) and name:
            found[name] += f" {more[1]}"
        else:
            name = ""
    for field_name in inspect.get_annotations(record):
        if field_name not in found:
            raise PublishedError(
                f"{record.__name__}.{field_name} has no text for {PAGE}; write it as "
                "a comment behind the field in layout.py"
            )
    return found


def rows(one: layout.Layout[Any]) -> Iterator[str]:
    """Rows of the page's table of a record, with their ends."""
    for name, text in texts(one.record).items():
        dtype, offset = one.dtype[name], one.dtype.fields[name][1]  # type: ignore[index]
        count = f"[{dtype.shape[0]}]" if dtype.shape else ""
        base = dtype.base
        yield f"| {offset} | {base.kind}{8 * base.itemsize}{count} | {text} |\n"


def struct(name: str, dtype: np.dtype[Any]) -> str:
    """Struct of a record in C; fields of one type share a line."""
    lines = []
    kinds = ((C_TYPES[dtype[f].base.str[1:]], f) for f in dtype.names or ())
    for kind, fields in groupby(kinds, lambda field: field[0]):
        line = f"    {kind}"
        for _, field in fields:
            count = f"[{dtype[field].shape[0]}]" if dtype[field].shape else ""
            if len(line) + len(field + count) + 3 > WIDTH:
                lines.append(f"{line};\n")
                line = f"    {kind}"
            line += f"{',' if line != f'    {kind}' else ''} {field}{count}"
        lines.append(f"{line};\n")
    return f"struct armguard_{name} {{\n{''.join(lines)}}};"


def new_page(page: str) -> str:
    """The page with the rows of today's records.

    Raises:
        PublishedError: The records have other bytes than those of this version.
    """
    known = VERSION.search(page)
    if known and known[1] == f"{layout.VERSION}" and known[2] != digest():
        raise PublishedError(
            f"records changed, but VERSION is {layout.VERSION} as before; set it to "
            f"{layout.VERSION + 1} in layout.py, then run: {COMMAND}"
        )
    page = VERSION.sub(f"version {layout.VERSION}, records {digest()}", page)
    for name, one in LAYOUTS.items():
        head = f"| offset | type | {TITLES.get(name, name)} |\n| --- | --- | --- |\n"
        before, found, rest = page.partition(head)
        if not found:
            raise PublishedError(f"{PAGE} has no table '{TITLES.get(name, name)}'")
        # Rows of fields have a number and a type of a fixed length.
        kept = re.sub(r"\A(\| \d+ \| [uif]\d+(\[\d+\])? \| .*\n)+", "", rest)
        kept = re.sub(r"\A\| \d+ \|", f"| {one.size} |", kept)
        page = before + head + "".join(rows(one)) + kept
    size = layout.ROBOT.size
    page = re.sub(r"\| \d+ r bytes \|", f"| {size} r bytes |", page)
    after = f"| {layout.COMMAND.size} + {size} r |"
    return re.sub(r"\| \d+ \+ \d+ r \|", after, page)


def new_header(header: str) -> str:
    """The C header with the structs of those of today's records that it has."""

    def today(found: re.Match[str]) -> str:
        return struct(found[1], LAYOUTS[found[1].upper()].dtype)

    header = re.sub(r"struct armguard_(\w+) \{\n.*?\n\};", today, header, flags=re.S)
    own = rf"\g<1>{layout.VERSION};"
    return re.sub(r"(guard->own\.version = )\d+;", own, header)


def stale(root: Path = ROOT) -> dict[Path, str]:
    """Files of a checkout that differ from the records, with their new text.

    Args:
        root: Folder of the checkout.

    Raises:
        PublishedError: See `new_page` and `texts`.
    """
    found = {}
    for path, renew in ((PAGE, new_page), (HEADER, new_header)):
        text = (root / path).read_text("utf-8")
        if (new := renew(text)) != text:
            found[root / path] = new
    return found


def main(words: list[str]) -> int:
    """Write the files that are stale, or name them; 1 if there is one left."""
    try:
        found = stale()
    except PublishedError as error:
        print(error, file=sys.stderr)
        return 1
    for path, text in found.items():
        if words == ["--write"]:
            path.write_text(text, "utf-8")
            print(f"wrote {path}")
        else:
            print(f"{path} is stale; run: {COMMAND}", file=sys.stderr)
    return int(bool(found) and words != ["--write"])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
