"""Frames as a recording keeps them: one after another, most cycles without all pairs.

Of most cycles the verdict is cut to its header and its nearest pair, poses are left
out, and a digest of the whole answer takes their place: enough to report the cycle and
to know whether a replay gives the same bits. Frames of one length that
follow each other make a block. A block is stored column by column, each number as what
differs from the last one, which a compressor makes a quarter of.

    count (uint32) | words of a frame (uint32) | compressed frames
"""

import struct
from collections.abc import Iterator
from hashlib import blake2b

import numpy as np
import zstandard
from numpy.typing import NDArray

from armguard.guard import layout
from armguard.guard.layout import IN_HEADER
from armguard.recording.frames import IN_FRAME, put_text, sections, words
from armguard.recording.mcap_file import unpacked

Floats = NDArray[np.float64]

HEAD = struct.Struct("<II")

# Frames in a block at most: they wait in memory until it is full.
MOST_FRAMES = 64

# Bytes of the frames of a block; more is damage, and gets no memory.
MOST_BYTES = 64 << 20

# Bytes of a digest.
DIGEST = 8


def digest_of(verdict: Floats, sent: Floats) -> bytes:
    """Digest of the answer of a cycle."""
    digest = blake2b(verdict.tobytes(), digest_size=DIGEST)
    digest.update(sent.tobytes())
    return digest.digest()


def kept_cycle(row: Floats, first_row: int, whole: bool) -> Floats:
    """The frame of a cycle as a recording keeps it, with its digest.

    Args:
        row: The frame as it was in the ring.
        first_row: Where the near pairs of its verdict start.
        whole: Whether all near pairs and poses are kept.
    """
    *_, sent, verdict, poses, text = sections(row)
    size = words(int(row[IN_FRAME.text]))
    digest = digest_of(row[verdict:poses], row[sent:verdict])
    tail = np.zeros(1)
    put_text(digest, tail)
    if whole:
        kept = np.concatenate((row[: text + size], tail))
    else:
        first = verdict + min(first_row, poses - verdict)
        pair = np.zeros(layout.NEAR_WIDTH)
        nearest = int(row[verdict + IN_HEADER.nearest])
        start = first + nearest * layout.NEAR_WIDTH
        if nearest >= 0 and start + layout.NEAR_WIDTH <= poses:
            pair = row[start : start + layout.NEAR_WIDTH]
        rest = row[text : text + size]
        kept = np.concatenate((row[:first], pair, rest, tail))
        kept[IN_FRAME.verdict] = first - verdict + layout.NEAR_WIDTH
        kept[IN_FRAME.poses] = 0.0
        if nearest >= 0:
            kept[verdict + IN_HEADER.nearest] = 0.0
            kept[verdict + IN_HEADER.near_count] = 1.0
    kept[IN_FRAME.data] = DIGEST
    return kept


def pack_block(rows: list[Floats]) -> bytes:
    """A block of frames of one length."""
    bits = np.array(rows).view(np.int64)
    changes = bits.copy()
    changes[1:] ^= bits[:-1]
    columns = changes.view(np.uint8).reshape(len(rows), -1, 8).transpose(1, 2, 0)
    data = zstandard.ZstdCompressor(level=3).compress(columns.tobytes())
    return HEAD.pack(len(rows), bits.shape[1]) + data


def unpack_block(data: bytes) -> Iterator[Floats]:
    """The frames of a block.

    Raises:
        ValueError: It is damaged.
    """
    if len(data) < HEAD.size:
        raise ValueError("a block of frames has no head")
    count, width = HEAD.unpack_from(data)
    size = count * width * 8
    if not (0 < count <= MOST_FRAMES and 0 < size <= MOST_BYTES):
        raise ValueError(f"a block holds {count} frames of {width} words")
    try:
        raw = unpacked(data[HEAD.size :], size)
    except ValueError as error:
        raise ValueError(f"a block of frames is damaged: {error}") from error
    columns = np.frombuffer(raw, np.uint8).reshape(width, 8, count)
    changes = np.ascontiguousarray(columns.transpose(2, 0, 1)).view(np.int64)
    bits = np.bitwise_xor.accumulate(changes.reshape(count, width), axis=0)
    yield from bits.view(np.float64)
