"""Seals, beside a second implementation that reads docs/zenoh.md."""

import hashlib
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from armguard.bridges.zenoh_bridge.schema import DroppedError
from armguard.bridges.zenoh_bridge.seal import ROLES, Sealer, check, mark_of
from armguard.recording.rights import Role

KEYS = {role: bytes([65 + role]) * 20 for role in Role}
NAME, PAYLOAD = "armguard/guard/command", b'{"cycle": 1}'


def test_a_seal_has_the_bytes_that_the_page_says():
    sealer = Sealer(0, [KEYS[role] for role in ROLES])
    sealer.seal("other", b"", 0)
    seal = sealer.seal(NAME, PAYLOAD, 123_456_789, b"r" * 16)
    assert len(seal) == 56 + 4 * 16
    header = (
        b"AGZ1"
        + struct.pack("<HHQq", 0, len(NAME), 2, 123_456_789)
        + sealer.sender.session
        + b"r" * 16
    )
    assert seal[:56] == header
    for k, role in enumerate((Role.OBSERVE, Role.SENSE, Role.COMMAND, Role.ADMINISTER)):
        found = hashlib.blake2s(
            header + NAME.encode() + PAYLOAD, key=KEYS[role], digest_size=16
        )
        assert seal[56 + 16 * k :][:16] == found.digest()
    mark = mark_of(seal, 4)
    assert mark == (sealer.sender, 2, 123_456_789, b"r" * 16)


@given(st.integers(0, 8 * 72 - 1))
def test_no_bit_of_a_seal_can_be_changed(bit):
    seal = bytearray(Sealer(3, [KEYS[Role.COMMAND]]).seal(NAME, PAYLOAD, 1))
    check(bytes(seal), 0, KEYS[Role.COMMAND], NAME, PAYLOAD)
    seal[bit // 8] ^= 1 << bit % 8
    with pytest.raises(DroppedError) as found:
        mark_of(bytes(seal), 1)
        check(bytes(seal), 0, KEYS[Role.COMMAND], NAME, PAYLOAD)
    assert found.value.cause == "seal"


@pytest.mark.parametrize(
    ("key", "name", "payload"),
    [
        (KEYS[Role.OBSERVE], NAME, PAYLOAD),
        (b"", NAME, PAYLOAD),
        (KEYS[Role.COMMAND], "armguard/guard/verdict", PAYLOAD),
        (KEYS[Role.COMMAND], NAME, PAYLOAD + b" "),
        # What the key loses at its end the payload gains at its beginning.
        (KEYS[Role.COMMAND], NAME[:-1], b"d" + PAYLOAD),
    ],
)
def test_a_seal_fits_one_key_one_name_and_one_payload(key, name, payload):
    seal = Sealer(3, [KEYS[Role.COMMAND]]).seal(NAME, PAYLOAD, 1)
    with pytest.raises(DroppedError):
        check(seal, 0, key, name, payload)


def test_a_role_without_a_key_has_no_seal():
    """The bridge may have fewer keys than there are: zeros are not taken for a MAC."""
    seal = Sealer(0, [KEYS[Role.OBSERVE], b"", b"", b""]).seal(NAME, PAYLOAD, 1)
    check(seal, 0, KEYS[Role.OBSERVE], NAME, PAYLOAD)
    for slot in (1, 2, 3):
        for key in (b"", KEYS[Role.OBSERVE], KEYS[Role.COMMAND]):
            with pytest.raises(DroppedError):
                check(seal, slot, key, NAME, PAYLOAD)
