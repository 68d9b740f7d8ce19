"""What was found so far, kept on disk: figures of each kind, and of which seeds.

Episodes that were run with other kernels, or with another plant, operator or judge, are
episodes of something else: they are never added to.
"""

import json
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

from armguard.cli.console import jsonable
from armguard.kernel import kernel_digest
from gripping.summary import TOLD, joined

Figures = dict[str, Any]

# Files of this folder that tell of episodes, and do not change any.
TELLING = ("records.py", "summary.py")

# Kinds that have files of their own.
OF_ONE_KIND = ("panda",)

# Figures that are no sums: how two of one name are put together.
EXTREME: Mapping[str, Callable[[float, float], float]] = {
    "least_not_meant_mm": min,
    "deepest_mm": max,
    "fastest_contact_mm_s": max,
    "fingers_moved_most_mm": max,
}


@cache
def version(kind: str) -> str:
    """Hash of all that decides what comes of an episode of a kind.

    Files whose names begin with a robot's are of the kind with its name only.
    """
    digest = sha256(kernel_digest().encode())
    for path in sorted(Path(__file__).parent.glob("*.py")):
        others = path.name.startswith(OF_ONE_KIND) and not path.name.startswith(kind)
        if path.name not in TELLING and not others:
            digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:16]


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
        of: Callable[[str], str] = version,
        extreme: Mapping[str, Callable[[float, float], float]] = EXTREME,
    ) -> None:
        self.path = path
        self.of = of
        self.extreme = extreme
        self.kinds: dict[str, Figures] = (
            json.loads(path.read_text("utf-8")) if path.exists() else {}
        )

    def todo(self, kind: str, first: int, end: int) -> Iterator[int]:
        """Seeds of a range of which nothing is known yet."""
        done = self._known(kind).get("seeds", [])
        for seed in range(first, end):
            if not any(a <= seed < b for a, b in done):
                yield seed

    def add(self, kind: str, figures: Figures) -> Figures:
        """Add figures of more episodes; all that is known of this kind."""
        known = self._known(kind)
        found = merged(known, figures, self.extreme) if known else figures
        self.kinds[kind] = jsonable({**found, "version": self.of(kind)})
        text = json.dumps(self.kinds, indent=1) + "\n"
        # Who is killed while he writes loses nothing that was there.
        beside = self.path.with_suffix(".part")
        beside.write_text(text, encoding="utf-8")
        beside.replace(self.path)
        return self.kinds[kind]

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
