"""What campaigns found so far, kept in the repository.

`docs/NAME.json` has the figures of each row, `docs/episodes/NAME.jsonl` what came of
each of its episodes: a line of text for each batch, so that a longer run adds lines and
a difference of two versions can be read. A row has episodes of one version only: what
was run with other kernels, or another plant, operator or judge, are episodes of
something else. A row of another version is kept beside the new one until that one has
as many episodes. It is carried over to today's version where a sample of its episodes,
run again, is the same.
"""

import ast
import fcntl
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

from armguard.cli.console import jsonable, say
from episodes.kernels import GUARD, kernels_of

Figures = dict[str, Any]
Extreme = Mapping[str, Callable[[float, float], float]]

BENCHMARKS = Path(__file__).parents[1]

# Modules that only write down what came of episodes.
WRITING = ("episodes.campaign", "episodes.kernels", "episodes.records", "pages")

# So many seeds in which something was found are listed.
LISTED = 20

# What figures have beside what was measured.
BESIDE = ("version", "kernels", "before")


class Digest(NamedTuple):
    """What came of an episode, in short.

    Attributes:
        seed: Its number.
        outcome: What was found, or why it was left out; empty if nothing was.
        least: Least distance [mm], None where there is none.
        counts: Whatever else is counted or measured, by name; nothing of what is 0.
    """

    seed: int
    outcome: str = ""
    least: float | None = None
    counts: Mapping[str, float] = {}


def version_of(*modules: str) -> Callable[[str], str]:
    """Gives the version of each kind of episodes: a hash of all that decides them.

    That is the kernels, and the benchmarks' files that what runs an episode imports.

    Args:
        modules: What runs an episode.
    """

    @cache
    def of(kind: str) -> str:
        digest = sha256(kind.encode() + kernels_of().encode())
        for path in sorted(sources_of(*modules)):
            digest.update(path.name.encode() + path.read_bytes())
        return digest.hexdigest()[:16]

    return of


def sources_of(*modules: str) -> set[Path]:
    """Files of modules of the benchmarks, and of those they import, without WRITING."""
    found: set[Path] = set()
    waiting = list(modules)
    while waiting:
        name = waiting.pop()
        stem = BENCHMARKS / name.replace(".", "/")
        path = stem / "__init__.py" if stem.is_dir() else stem.with_suffix(".py")
        if name in WRITING or path in found or not path.exists():
            continue
        found.add(path)
        for node in ast.walk(ast.parse(path.read_bytes())):
            if isinstance(node, ast.ImportFrom):
                inside = [f"{node.module}.{one.name}" for one in node.names]
                waiting += [str(node.module), *inside]
            elif isinstance(node, ast.Import):
                waiting += [one.name for one in node.names]
    return found


def ranges_of(seeds: Iterable[int]) -> list[list[int]]:
    """Seeds as ranges, each with its end."""
    found: list[list[int]] = []
    for seed in sorted(seeds):
        if found and found[-1][1] == seed:
            found[-1][1] += 1
        else:
            found.append([seed, seed + 1])
    return found


def seeds_of(ranges: Iterable[Sequence[int]]) -> set[int]:
    """Seeds of ranges, each with its end."""
    return {seed for first, end in ranges for seed in range(first, end)}


class Records:
    """Figures of each kind of episodes in a file, which every change is written to.

    Attributes:
        kinds: Figures of all kinds.

    Args:
        path: The file; it need not exist.
        of: What episodes of a kind are run with, see `version`.
        extreme: Figures that are no sums, and how two of one name are put together.
        derived: Figures of a kind that follow from its sums.
    """

    def __init__(
        self,
        path: Path,
        of: Callable[[str], str],
        extreme: Extreme,
        derived: Callable[[str, Figures], Figures] = lambda _, __: {},
    ) -> None:
        self.path = path
        self.episodes = path.parent / "episodes" / f"{path.stem}.jsonl"
        self.of = of
        self.extreme = extreme
        self.derived = derived
        self.kinds = read(path)

    def todo(self, kind: str, first: int, end: int) -> Iterator[int]:
        """Seeds of a range of which nothing is known yet."""
        self.kinds = read(self.path)
        done = seeds_of(self._known(kind).get("seeds", []))
        yield from (seed for seed in range(first, end) if seed not in done)

    def add(
        self, kind: str, figures: Figures, digests: Iterable[Digest] = ()
    ) -> Figures:
        """Add figures of more episodes; all that is known of this kind."""
        with self._alone():
            # Another campaign may have added to the same file meanwhile.
            self.kinds = read(self.path)
            known = self._known(kind)
            if known and seeds_of(known["seeds"]) & seeds_of(figures["seeds"]):
                # Another campaign ran them as well, and was quicker.
                return self.kinds[kind]
            found = merged(known, figures, self.extreme)
            found |= self.derived(kind, found) if found["episodes"] else {}
            marks = {"version": self.of(kind), "kernels": kernels_of()}
            larger = [
                {key: figure for key, figure in row.items() if key != "before"}
                for row in versions_of(self.kinds.get(kind, {}))
                if row.get("version") != marks["version"]
                and row.get("episodes", 0) > found["episodes"]
            ]
            if larger:
                found["before"] = max(larger, key=lambda row: row["episodes"])
            self.kinds[kind] = jsonable({**found, **marks})
            line = line_of(kind, marks, digests)
            replace(self.episodes, "".join([*self._kept_lines(), line]))
            replace(self.path, json.dumps(self.kinds, indent=1) + "\n")
        return self.kinds[kind]

    def digests(self, kind: str, version: str | None = None) -> dict[int, Digest]:
        """What came of the episodes of a kind, by seed.

        Args:
            kind: Which.
            version: What they were run with; what is run today if None.
        """
        wanted = kind, version or self.of(kind)
        found: dict[int, Digest] = {}
        for line in self._lines():
            if (line["row"], line["version"]) == wanted:
                found |= {digest.seed: digest for digest in digests_of(line)}
        return dict(sorted(found.items()))

    def version_of(self, kind: str) -> str | None:
        """What the known episodes of a kind were run with; None if there are none."""
        return self.kinds.get(kind, {}).get("version")

    def carry(self, kind: str, compared: int) -> None:
        """Count the episodes of a kind as ones of today's version.

        Args:
            kind: Which.
            compared: How many were run again and are the same.
        """
        with self._alone():
            self.kinds = read(self.path)
            figures = self.kinds[kind]
            marks = {"version": self.of(kind), "kernels": kernels_of()}
            lines = [
                {**line, **marks}
                if (line["row"], line["version"]) == (kind, figures["version"])
                else line
                for line in self._lines()
            ]
            earlier = {"kernels": figures["kernels"], "compared": compared}
            figures |= {**marks, "carried": [*figures.get("carried", []), earlier]}
            replace(self.episodes, "".join(map(packed, lines)))
            replace(self.path, json.dumps(self.kinds, indent=1) + "\n")

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
        if figures.get("version") != self.of(kind):
            return {}
        return {key: f for key, f in figures.items() if key not in BESIDE}

    def _lines(self) -> Iterator[Figures]:
        if self.episodes.exists():
            yield from map(json.loads, self.episodes.read_text("utf-8").splitlines())

    def _kept_lines(self) -> Iterator[str]:
        """Lines of the episodes that figures are still kept of."""
        rows = {
            (kind, f.get("version"))
            for kind, figures in self.kinds.items()
            for f in versions_of(figures)
        }
        for line in self._lines():
            if (line["row"], line["version"]) in rows:
                yield packed(line)


def read(path: Path) -> dict[str, Figures]:
    """Figures of a file by row; none if there is no file."""
    if not path.exists():
        return {}
    found: dict[str, Figures] = json.loads(path.read_text("utf-8"))
    return found


def replace(path: Path, text: str) -> None:
    """Write a file, so that a run that is killed meanwhile loses nothing of it."""
    path.parent.mkdir(exist_ok=True)
    beside = path.with_suffix(".part")
    beside.write_text(text, encoding="utf-8")
    beside.replace(path)


def versions_of(figures: Figures) -> list[Figures]:
    """Figures of a kind by version, the present one last."""
    return [figures["before"], figures] if "before" in figures else [figures]


def rows_of(figures: Figures) -> list[Figures]:
    """Those of them that have any episodes: rows of a page."""
    return [row for row in versions_of(figures) if row["episodes"] > 0]


def line_of(kind: str, marks: Mapping[str, str], digests: Iterable[Digest]) -> str:
    """What came of some episodes as a line of text; empty if there are none."""
    found = sorted(digests, key=lambda digest: digest.seed)
    outcomes: dict[str, list[int]] = {}
    for digest in found:
        if digest.outcome:
            outcomes.setdefault(digest.outcome, []).append(digest.seed)
    names = sorted({name for digest in found for name in digest.counts})
    counts = {name: [digest.counts.get(name, 0) for digest in found] for name in names}
    line = {
        "row": kind,
        **marks,
        "seeds": ranges_of(digest.seed for digest in found),
        "least_mm": [d.least if d.least is None else round(d.least, 2) for d in found],
        "outcomes": outcomes,
        "counts": {name: sparse(some) for name, some in counts.items() if any(some)},
    }
    return packed(jsonable(line)) if found else ""


def packed(line: Figures) -> str:
    """A line of text."""
    return json.dumps(line, separators=(",", ":")) + "\n"


def sparse(values: list[float]) -> list[float] | dict[str, float]:
    """Values by their place, without those that are 0, where that is shorter."""
    some = {str(k): value for k, value in enumerate(values) if value}
    return some if 2 * len(some) < len(values) else values


def digests_of(line: Figures) -> Iterator[Digest]:
    """What came of the episodes of a line."""
    outcomes = {
        seed: name for name, seeds in line["outcomes"].items() for seed in seeds
    }
    seeds = sorted(seeds_of(line["seeds"]))
    for k, (seed, least) in enumerate(zip(seeds, line["least_mm"], strict=True)):
        counts = {
            name: some[k] if isinstance(some, list) else some.get(str(k), 0)
            for name, some in line["counts"].items()
        }
        some = {name: count for name, count in counts.items() if count}
        yield Digest(seed, outcomes.get(seed, ""), least, some)


def keep(
    path: Path,
    name: str,
    figures: Any,
    size: float,
    folders: Sequence[str] = GUARD,
) -> bool:
    """Put figures of a run beside those of others in a file; whether that was done.

    A smaller run than the one that is there changes nothing.

    Args:
        path: The file; it need not exist.
        name: What was measured.
        figures: What came of it.
        size: How much was run, to be compared with other runs of the same.
        folders: Folders of the package whose kernels decide the figures.
    """
    results = read(path)
    runs = results.setdefault("runs", {})
    known = runs.get(name, {}).get("size", 0)
    if known > size:
        say(f"{name}: not written, a run of {size:g} is smaller than that of {known:g}")
        return False
    results[name] = jsonable(figures)
    runs[name] = {"size": size, "kernels": kernels_of(*folders)}
    if folders is not GUARD:
        runs[name]["of"] = [*folders]
    replace(path, json.dumps(results, indent=1) + "\n")
    return True


def merged(one: Figures, other: Figures, extreme: Extreme) -> Figures:
    """Figures of two sets of episodes that have none in common."""
    found: Figures = {}
    for key in {**one, **other}:
        a, b = one.get(key), other.get(key)
        if a is None or b is None:
            found[key] = b if a is None else a
        elif key == "seeds":
            found[key] = ranges_of(seeds_of([*a, *b]))
        elif key in extreme:
            found[key] = extreme[key](a, b)
        elif isinstance(b, dict):
            found[key] = merged(a, b, extreme)
        elif isinstance(b, list):
            found[key] = [*a, *b][:LISTED]
        elif isinstance(b, str):
            found[key] = b
        else:
            found[key] = a + b
    return found
