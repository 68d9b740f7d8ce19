"""What a network, a driver or an enemy may do to messages."""

import random
from collections.abc import Callable, Sequence
from struct import pack_into, unpack_from

from armguard.station.faults.relay import Tamper
from armguard.station.wire import Kind, Seal
from armguard.station.wire.layout import HAS_VELOCITY, HEADER, SEAL, STATE

Handed = Sequence[tuple[float, bytes]]

# Where a message's kind is, and a STATE's flags, its stamp and its first position.
KIND_AT = 5
FLAGS_AT = HEADER.size + 4
STAMP_AT = HEADER.size + 8
POSITIONS_AT = HEADER.size + STATE.size

STATES = (Kind.STATE,)
WISHES = (Kind.WISH,)


def kind_of(message: bytes) -> int:
    """Kind of a message; 0 of what is none."""
    return message[KIND_AT] if len(message) > KIND_AT else 0


def on(
    kinds: Sequence[int], change: Callable[[bytes], Handed], *, up: bool = True
) -> Tamper:
    """Do something to messages of some kinds, one way, and leave all others alone."""

    def tamper(message: bytes, goes_up: bool) -> Handed:
        if goes_up is up and kind_of(message) in kinds:
            return change(message)
        return ((0.0, message),)

    return tamper


def lost(message: bytes) -> Handed:
    """It never arrives."""
    return ()


def lost_sometimes(share: float, seed: int = 0) -> Callable[[bytes], Handed]:
    """A share of them never arrives."""
    rng = random.Random(seed)
    return lambda message: () if rng.random() < share else ((0.0, message),)


def late(delay: float) -> Callable[[bytes], Handed]:
    """All arrive late [s]."""
    return lambda message: ((delay, message),)


def doubled(message: bytes) -> Handed:
    """Each arrives twice."""
    return ((0.0, message), (0.0, message))


def reordered(delay: float) -> Callable[[bytes], Handed]:
    """Every third arrives after those that were sent behind it."""
    count = 0

    def change(message: bytes) -> Handed:
        nonlocal count
        count += 1
        return ((delay if count % 3 == 0 else 0.0, message),)

    return change


def replayed(behind: int) -> Callable[[bytes], Handed]:
    """With each arrives once more one of long ago."""
    past: list[bytes] = []

    def change(message: bytes) -> Handed:
        past.append(message)
        old = past.pop(0) if len(past) > behind else None
        return ((0.0, message),) if old is None else ((0.0, old), (0.0, message))

    return change


def corrupted(seed: int = 0) -> Callable[[bytes], Handed]:
    """Some bits of each are turned round."""
    rng = random.Random(seed)

    def change(message: bytes) -> Handed:
        wrong = bytearray(message)
        for _ in range(rng.randint(1, 8)):
            wrong[rng.randrange(len(wrong))] ^= 1 << rng.randrange(8)
        # The same bit twice is as it was.
        return ((0.0, bytes(wrong)),) if wrong != message else ()

    return change


def cut(seed: int = 0) -> Callable[[bytes], Handed]:
    """Each is cut short."""
    rng = random.Random(seed)
    return lambda message: ((0.0, message[: rng.randrange(len(message))]),)


def grown(message: bytes) -> Handed:
    """Each has something behind it."""
    return ((0.0, message + bytes(64)),)


def spliced() -> Callable[[bytes], Handed]:
    """Each has the end of the one before."""
    before: list[bytes] = []

    def change(message: bytes) -> Handed:
        other = before.pop() if before else message
        before.append(message)
        half = POSITIONS_AT + 8
        return ((0.0, message[:half] + other[half:]),)

    return change


def rewritten(seal: Seal, edit: Callable[[bytearray], None]) -> Callable[
    [bytes], Handed
]:  # fmt: skip
    """Each says something else, and is sealed as if its sender had meant it."""

    def change(message: bytes) -> Handed:
        other = bytearray(message)
        edit(other)
        seal.put(memoryview(other))
        return ((0.0, bytes(other)),)

    return change


def position(message: bytearray, joint: int) -> float:
    """A position a STATE tells [rad or m]."""
    value: float = unpack_from("<d", message, POSITIONS_AT + 8 * joint)[0]
    return value


def put_position(message: bytearray, joint: int, value: float) -> None:
    """Have a STATE tell another position [rad or m]."""
    pack_into("<d", message, POSITIONS_AT + 8 * joint, value)


def shift_stamp(message: bytearray, by: float) -> None:
    """Have a STATE be measured at another time, by some seconds."""
    stamp: float = unpack_from("<d", message, STAMP_AT)[0]
    pack_into("<d", message, STAMP_AT, stamp + by)


def joints_of(message: bytes | bytearray) -> int:
    """How many joints a STATE without a wish tells."""
    flags: int = unpack_from("<I", message, FLAGS_AT)[0]
    both = 2 if flags & HAS_VELOCITY else 1
    return (len(message) - POSITIONS_AT - SEAL) // (8 * both)
