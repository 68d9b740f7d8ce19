"""Names of primitives, made when one is read: a million cost nothing."""

from bisect import bisect_right
from collections.abc import Sequence
from typing import overload

from armguard.scene.blocks import Block


class PrimitiveNames(Sequence[str]):
    """A name for each primitive of a list of blocks.

    Args:
        blocks: The blocks, in the order of the tables.
        numbered: Whether primitives of an owner with several get a number, as in
            'table[3]'; otherwise all have their owner's name.
    """

    def __init__(self, blocks: Sequence[Block], *, numbered: bool) -> None:
        self._owners = [block.owner for block in blocks]
        self._offsets: list[int | None] = [
            block.first if numbered and not block.alone else None for block in blocks
        ]
        self._starts = [0]
        for block in blocks:
            self._starts.append(self._starts[-1] + len(block))

    def __len__(self) -> int:
        """How many primitives."""
        return self._starts[-1]

    @overload
    def __getitem__(self, index: int) -> str: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[str, ...]: ...

    def __getitem__(self, index: int | slice) -> str | tuple[str, ...]:
        """Name of one primitive, or of a slice of them."""
        if isinstance(index, slice):
            return tuple(self[k] for k in range(*index.indices(len(self))))
        place = range(len(self))[index]
        block = bisect_right(self._starts, place) - 1
        offset = self._offsets[block]
        owner = self._owners[block]
        if offset is None:
            return owner
        return f"{owner}[{offset + place - self._starts[block]}]"
