"""What a network, a driver or an enemy may do to messages."""

import random
from collections.abc import Callable, Sequence
from struct import pack_into, unpack_from

from armguard.chaos.relay import Tamper
from armguard.service.wire import Kind, Seal
from armguard.service.wire.layout import HEADER, SEAL, STATE, WISH

Handed = Sequence[tuple[float, bytes]]

# Changes a message in place.
Edit = Callable[[bytearray], None]

# Where fields of a message's head are, and a STATE's stamp and its first position.
VERSION_AT, KIND_AT, LENGTH_AT, SESSION_AT, SCENE_AT = 4, 5, 6, 8, 16
STAMP_AT = HEADER.size + 8
POSITIONS_AT = HEADER.size + STATE.size

STATES = (Kind.STATE,)
DESIRED = (Kind.WISH,)
# All that a commander sends.
COMMANDS = (*DESIRED, Kind.CLAIM, Kind.CALL, Kind.HEARTBEAT)


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


def rewritten(seal: Seal, edit: Edit) -> Callable[[bytes], Handed]:
    """Each says something else, and is sealed as by its sender."""

    def change(message: bytes) -> Handed:
        other = bytearray(message)
        edit(other)
        seal.put(memoryview(other))
        return ((0.0, bytes(other)),)

    return change


def only_the_first() -> Callable[[bytes], Handed]:
    """In place of each the first one arrives again."""
    kept: list[bytes] = []

    def change(message: bytes) -> Handed:
        if not kept:
            kept.append(message)
        return ((0.0, kept[0]),)

    return change


def joint_missing(seal: Seal) -> Callable[[bytes], Handed]:
    """Each lacks its last number, and declares the length it has."""

    def change(message: bytes) -> Handed:
        other = bytearray(message[: -SEAL - 8] + bytes(SEAL))
        pack_into("<H", other, LENGTH_AT, len(other))
        seal.put(memoryview(other))
        return ((0.0, bytes(other)),)

    return change


def as_it_is(message: bytearray) -> None:
    """Change nothing."""


def put_first(value: float) -> Edit:
    """Have a STATE report another first position [rad or m]."""
    return lambda message: pack_into("<d", message, POSITIONS_AT, value)


def shift_first(by: float) -> Edit:
    """Have a STATE report a first position that is farther by so much [rad or m]."""

    def edit(message: bytearray) -> None:
        value: float = unpack_from("<d", message, POSITIONS_AT)[0]
        pack_into("<d", message, POSITIONS_AT, value + by)

    return edit


def shift_stamp(by: float) -> Edit:
    """Have a STATE be measured at another time, by some seconds."""

    def edit(message: bytearray) -> None:
        stamp: float = unpack_from("<d", message, STAMP_AT)[0]
        pack_into("<d", message, STAMP_AT, stamp + by)

    return edit


def frozen() -> Edit:
    """Have every STATE say what the first one said, in a message of its own."""
    kept: list[bytes] = []

    def edit(message: bytearray) -> None:
        if not kept:
            kept.append(bytes(message[HEADER.size : -SEAL]))
        message[HEADER.size : -SEAL] = kept[0]

    return edit


def positions_frozen() -> Edit:
    """Have every STATE repeat the positions of the first one, and all else as it is."""
    kept: list[bytes] = []

    def edit(message: bytearray) -> None:
        # Behind the positions are as many velocities.
        end = POSITIONS_AT + (len(message) - SEAL - POSITIONS_AT) // 2
        if not kept:
            kept.append(bytes(message[POSITIONS_AT:end]))
        message[POSITIONS_AT:end] = kept[0]

    return edit


def velocities_changed(change: Callable[[Sequence[float]], Sequence[float]]) -> Edit:
    """Have every STATE report other velocities, and positions as they are."""

    def edit(message: bytearray) -> None:
        count = (len(message) - SEAL - POSITIONS_AT) // 16
        form, start = f"<{count}d", POSITIONS_AT + 8 * count
        pack_into(form, message, start, *change(unpack_from(form, message, start)))

    return edit


def negative(values: Sequence[float]) -> Sequence[float]:
    """All have the other sign."""
    return [-value for value in values]


def tenth(values: Sequence[float]) -> Sequence[float]:
    """All are a tenth as large."""
    return [0.1 * value for value in values]


def turned_round(values: Sequence[float]) -> Sequence[float]:
    """Each is another joint's."""
    return values[::-1]


def nothing(values: Sequence[float]) -> Sequence[float]:
    """All are 0."""
    return [0.0] * len(values)


def other_robots(message: bytearray) -> None:
    """Have a STATE be of robots that do not exist."""
    pack_into("<I", message, HEADER.size, 1 << 30)


def nan_desired(message: bytearray) -> None:
    """Have a desired motion begin with NaN."""
    pack_into("<d", message, HEADER.size + WISH.size, float("nan"))


def other_version(message: bytearray) -> None:
    """Have a message be of another version."""
    message[VERSION_AT] += 1


def other_session(message: bytearray) -> None:
    """Have a message be of another session."""
    message[SESSION_AT] ^= 0xFF


def other_scene(message: bytearray) -> None:
    """Have a message be made for another scene."""
    message[SCENE_AT] ^= 0xFF
