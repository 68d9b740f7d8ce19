"""What was found so far, kept on disk: figures of each kind, and of which seeds.

Episodes that were run with other kernels, or with another plant, operator or judge, are
episodes of something else: they are never added to.
"""

import fcntl
import json
import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import Any

from armguard.cli.console import jsonable
from armguard.kernel import kernel_digest

Figures = dict[str, Any]

# So many seeds in which something was found are told.
TOLD = 20


def version(what: str, files: Iterable[Path]) -> str:
    """Hash of the kernels and of all files that decide what comes of an episode.

    Args:
        what: What the episodes are of.
        files: The files.
    """
    digest = sha256(what.encode() + kernel_digest().encode())
    for path in files:
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def joined(ranges: list[list[int]]) -> list[list[int]]:
    """Ranges of seeds, each with its end, where one follows another as one."""
    found: list[list[int]] = []
    for first, end in sorted(ranges):
        if found and found[-1][1] == first:
            found[-1] = [found[-1][0], end]
        else:
            found.append([first, end])
    return found


def overlap(one: list[list[int]], other: list[list[int]]) -> bool:
    """Whether ranges of seeds have any in common."""
    return any(a < d and c < b for a, b in one for c, d in other)


class Records:
    """Figures of each kind of episodes in a file, which every change is written to.

    Args:
        path: The file; it need not exist.
        of: What episodes of a kind are run with, see `version`.
        extreme: Figures that are no sums, and how two of one name are put together.
    """

    def __init__(
        self,
        path: Path,
        of: Callable[[str], str],
        extreme: Mapping[str, Callable[[float, float], float]],
    ) -> None:
        self.path = path
        self.of = of
        self.extreme = extreme
        self.kinds = self._read()

    def todo(self, kind: str, first: int, end: int) -> Iterator[int]:
        """Seeds of a range of which nothing is known yet."""
        self.kinds = self._read()
        done = self._known(kind).get("seeds", [])
        for seed in range(first, end):
            if not any(a <= seed < b for a, b in done):
                yield seed

    def add(self, kind: str, figures: Figures) -> Figures:
        """Add figures of more episodes; all that is known of this kind."""
        with self._alone():
            # Another campaign may have added to the same file meanwhile.
            self.kinds = self._read()
            known = self._known(kind)
            if known and overlap(known["seeds"], figures["seeds"]):
                # Somebody else ran them as well, and was quicker.
                return known
            found = merged(known, figures, self.extreme) if known else figures
            self.kinds[kind] = jsonable({**found, "version": self.of(kind)})
            text = json.dumps(self.kinds, indent=1) + "\n"
            # Who is killed while he writes loses nothing that was there.
            beside = self.path.with_suffix(".part")
            beside.write_text(text, encoding="utf-8")
            beside.replace(self.path)
        return self.kinds[kind]

    def _read(self) -> dict[str, Figures]:
        if not self.path.exists():
            return {}
        found: dict[str, Figures] = json.loads(self.path.read_text("utf-8"))
        return found

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Keep other campaigns off the file meanwhile."""
        folder = os.open(self.path.parent, os.O_RDONLY)
        try:
            fcntl.flock(folder, fcntl.LOCK_EX)
            yield
        finally:
            os.close(folder)

    def _known(self, kind: str) -> Figures:
        """Figures of a kind that more may be added to; empty if there are none."""
        figures = self.kinds.get(kind, {})
        return figures if figures.get("version") == self.of(kind) else {}


def merged(
    one: Figures,
    other: Figures,
    extreme: Mapping[str, Callable[[float, float], float]],
) -> Figures:
    """Figures of two sets of episodes that have none in common."""
    found: Figures = {}
    for key in other:
        a, b = one[key], other[key]
        if key == "seeds":
            found[key] = joined([*a, *b])
        elif key in extreme:
            found[key] = extreme[key](a, b)
        elif isinstance(b, dict):
            found[key] = dict(Counter(a) + Counter(b))
        elif isinstance(b, list):
            found[key] = [*a, *b][:TOLD]
        else:
            found[key] = a + b
    return found
