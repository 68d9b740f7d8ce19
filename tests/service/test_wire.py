"""Each record of a message is declared once; page and C header have the same bytes."""

import re
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest

from armguard.guard.levels import Level
from armguard.respond import Action
from armguard.service.wire import Kind, layout
from armguard.service.wire.layout import Layout

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "service.md").read_text(encoding="utf-8")
HEADER = (ROOT / "examples" / "armguard.h").read_text(encoding="utf-8")

LAYOUTS = {name: one for name, one in vars(layout).items() if isinstance(one, Layout)}

# Titles of tables that are not the name of their record.
TITLES = {"HEADER": "header", "ROBOT": "of each robot"}

C_TYPES = {
    "double": "<f8",
    "float": "<f4",
    "int64_t": "<i8",
    "uint8_t": "u1",
    "uint16_t": "<u2",
    "uint32_t": "<u4",
    "uint64_t": "<u8",
}


def words_of(dtype: np.dtype) -> str:
    """A type as the page names it: u32, f64[3]."""
    base = dtype.base
    count = f"[{dtype.shape[0]}]" if dtype.shape else ""
    return f"{base.kind}{8 * base.itemsize}{count}"


def table_on_page(title: str) -> list[tuple[str, str]]:
    """Offset and type of each row of a table."""
    _, found, rest = PAGE.partition(
        f"| offset | type | {title} |\n| --- | --- | --- |\n"
    )
    assert found, f"the page has no table '{title}'"
    lines = rest.partition("\n\n")[0].splitlines()
    return [tuple(cell.strip() for cell in line.split("|")[1:3]) for line in lines]


# Hash of the fields and offsets of all records of this version.
OF_VERSION = {2: "292c41928079326c"}


def test_other_bytes_have_another_version():
    fields = [(name, one.dtype.descr) for name, one in sorted(LAYOUTS.items())]
    found = sha256(repr(fields).encode()).hexdigest()[:16]
    assert OF_VERSION.get(layout.VERSION) == found


@pytest.mark.parametrize("name", LAYOUTS)
def test_the_page_has_every_field_of_a_record_where_it_is(name):
    one = LAYOUTS[name]
    rows = table_on_page(TITLES.get(name, name))
    fields = [one.dtype.fields[field] for field in one.record._fields]
    expected = [(str(offset), words_of(dtype)) for dtype, offset in fields]
    assert rows[: len(fields)] == expected
    if rows[len(fields) :]:
        assert rows[len(fields)][0] == str(one.size)


def test_the_rows_of_a_command_are_as_long_as_the_page_says():
    size = layout.COMMAND.size
    assert (f"{size}", f"{layout.ROBOT.size} r bytes") in table_on_page("COMMAND")
    assert f"| {size} + {layout.ROBOT.size} r | f64[n] |" in PAGE


@pytest.mark.parametrize("name", LAYOUTS)
def test_offsets_are_multiples_so_that_c_and_numpy_read_it_in_place(name):
    one = LAYOUTS[name]
    fields = [(f, one.dtype.fields[f][0]) for f in one.record._fields]
    assert np.dtype(fields, align=True) == np.dtype(one.dtype, align=True)
    assert one.size % 8 == 0
    assert one._struct.size == one.size


def structs_of_c() -> dict[str, np.dtype]:
    """Structs of the C header, as a compiler aligns them."""
    found = {}
    for name, body in re.findall(r"struct armguard_(\w+) \{(.*?)\n\};", HEADER, re.S):
        fields = []
        for kind, members in re.findall(r"(\w+) ([\w\[\], ]+);", body):
            for member in members.split(", "):
                field, count = re.fullmatch(r"(\w+)(?:\[(\d+)\])?", member).groups()
                one = C_TYPES[kind]
                fields.append((field, one, (int(count),)) if count else (field, one))
        found[name] = np.dtype(fields, align=True)
    return found


def test_the_c_header_has_the_same_records():
    structs = structs_of_c()
    assert len(structs) == 10
    for name, found in structs.items():
        expected = LAYOUTS[name.upper()].dtype
        offsets = {f: found.fields[f][:2] for f in found.names}
        assert offsets == {f: expected.fields[f][:2] for f in expected.names}, name
        assert found.itemsize == expected.itemsize, name


def test_the_c_header_has_the_same_numbers():
    for name, number in re.findall(r"ARMGUARD_(\w+) = (\d+)", HEADER):
        if name in Kind.__members__ and name != "STOP":
            assert Kind[name] == int(number)
    assert f"guard->own.magic = {layout.MAGIC:#x}" in HEADER
    assert f"guard->own.version = {layout.VERSION};" in HEADER
    assert f"ARMGUARD_MESSAGE = {layout.MOST}, ARMGUARD_SEAL = {layout.SEAL}" in HEADER


def test_a_record_is_read_as_it_was_written():
    rng = np.random.default_rng(0)
    for one in LAYOUTS.values():
        data = bytes(rng.integers(0, 127, one.size, dtype=np.uint8))
        record = one.unpack_from(b"head" + data, 4)
        assert one.pack(*record) == data
        assert one.pack(**record._asdict()) == data
        buffer = bytearray(one.size + 3)
        one.pack_into(buffer, 3, *record)
        assert buffer[3:] == data
        assert one.rows(data + data) == (record, record)
        row = np.frombuffer(data, one.dtype)[0]
        for field, value in record._asdict().items():
            found = row[field]
            assert (found.tobytes() if found.shape else found) == value


def test_levels_and_actions_of_a_stop_are_those_of_the_guard():
    stop = layout.STOPPED_ROW
    assert (stop.level, stop.action) == (Level.STOP, Action.STOP)
    assert (layout.STOP_LEVEL, layout.STOP_ACTION) == (Level.STOP, Action.STOP)
    assert layout.HOLD_ACTION == Action.HOLD
    assert layout.STOPPED.level == Level.STOP
    assert layout.STOPPED.action == Action.STOP
