"""Each record of a message is declared once; page and C header have the same bytes."""

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from armguard.guard.levels import Level
from armguard.respond import Action
from armguard.service.wire import Kind, layout, published
from armguard.service.wire.layout import Layout

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "service.md").read_text(encoding="utf-8")
HEADER = (ROOT / "examples" / "armguard.h").read_text(encoding="utf-8")

LAYOUTS = dict(published.LAYOUTS)

C_TYPES = {
    "double": "<f8",
    "float": "<f4",
    "int64_t": "<i8",
    "uint8_t": "u1",
    "uint16_t": "<u2",
    "uint32_t": "<u4",
    "uint64_t": "<u8",
}


def test_page_and_c_header_are_those_of_the_records():
    stale = [str(path) for path in published.stale()]
    assert not stale, f"run: {published.COMMAND}"


@pytest.fixture
def longer_hello(monkeypatch):
    """A record with one field more, before the name that follows it."""

    class Hello(NamedTuple):
        role: layout.U32  # role whose key seals it
        every: layout.U32  # cycles to each COMMAND
        cookie: layout.Cookie  # cookie of the CHALLENGE
        lag: layout.F64  # greatest delay that the client expects,
        # one way [s]

    monkeypatch.setitem(published.LAYOUTS, "HELLO", Layout(Hello))


def test_other_bytes_need_another_version(longer_hello):
    with pytest.raises(published.PublishedError, match="set it to 4 in layout"):
        published.new_page(PAGE)


def test_a_field_more_is_a_row_and_a_member_more(longer_hello, monkeypatch):
    monkeypatch.setattr(layout, "VERSION", layout.VERSION + 1)
    page = published.new_page(PAGE)
    assert (
        "| 24 | f64 | greatest delay that the client expects, one way [s] |\n"
        "| 32 | u8[] | a name in UTF-8, up to 64 bytes |\n"
    ) in page
    header = published.new_header(HEADER)
    assert "    uint8_t cookie[16];\n    double lag;\n};" in header
    assert f"guard->own.version = {layout.VERSION};" in header
    # Nothing else differs.
    assert len(page.splitlines()) == len(PAGE.splitlines()) + 1
    assert len(header.splitlines()) == len(HEADER.splitlines()) + 1


def test_a_field_without_a_text_is_an_error():
    class Silent(NamedTuple):
        length: layout.U32

    with pytest.raises(published.PublishedError, match=r"Silent\.length has no text"):
        published.texts(Silent)


def test_a_stale_checkout_is_named_and_written(tmp_path, monkeypatch, capsys):
    for path, text in ((published.PAGE, PAGE), (published.HEADER, HEADER)):
        (tmp_path / path).parent.mkdir()
        (tmp_path / path).write_text(text.replace("f64", "f32").replace("sender", "s"))
    monkeypatch.setattr(published.stale, "__defaults__", (tmp_path,))
    assert published.main([]) == 1
    assert published.COMMAND in capsys.readouterr().err
    assert published.main(["--write"]) == 0
    assert published.main([]) == 0
    assert (tmp_path / published.HEADER).read_text().count("sender") == 2


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
    assert len(structs) == 13
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
