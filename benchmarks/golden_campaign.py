"""Judges the golden plays again: which cycle and field is the first that differs?

make golden                        all plays, two processes, about two minutes
make golden ARGS="--only panda"    some
make golden ARGS=--write           take what is now for golden

Ends with 1 if anything differs. benchmarks/golden/golden.npz holds hashes:
for each cycle one of each group (verdict, command, sentence, wire, checkpoint), and for
each block of cycles one of each attribute.
"""

import argparse
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from time import perf_counter
from typing import NamedTuple
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parent))

from golden.fields import GROUPS
from golden.plays import PLAYS

Shorts = NDArray[np.uint16]

GOLDEN = Path(__file__).parent / "golden" / "golden.npz"

# Cycles in one block.
BLOCK = 50


class Hashes(NamedTuple):
    """What is kept of a play.

    Attributes:
        cycles: Hashes by cycle and group.
        fields: Names of the attributes.
        blocks: Hashes by block and attribute, each of all cycles until the block's end.
    """

    cycles: Shorts
    fields: NDArray[np.str_]
    blocks: Shorts


def hashes_of(name: str) -> Hashes:
    """Run a play."""
    play = next(play for play in PLAYS if play.name == name)
    cycles: list[list[int]] = []
    blocks: list[dict[str, int]] = []
    running: dict[str, int] = {}
    for k, found in enumerate(play.run()):
        groups = dict.fromkeys(GROUPS, 0)
        for field, data in found.items():
            group = field.split(".")[0]
            groups[group] = crc32(data, groups[group])
            running[field] = crc32(data, running.get(field, 0))
        cycles.append([short(value) for value in groups.values()])
        if k % BLOCK == 0:
            blocks.append({})
        blocks[-1] = dict(running)
    fields = sorted(running)
    rows = [[short(block.get(field, 0)) for field in fields] for block in blocks]
    return Hashes(
        np.array(cycles, np.uint16), np.array(fields), np.array(rows, np.uint16)
    )


def short(value: int) -> int:
    """Sixteen bits of a hash."""
    return value & 0xFFFF


def difference(was: Hashes, now: Hashes) -> str:
    """The first cycle that differs in each group, and its attributes; empty if none."""
    count = min(len(was.cycles), len(now.cycles))
    before = {name: was.blocks[:, k] for k, name in enumerate(was.fields)}
    after = {name: now.blocks[:, k] for k, name in enumerate(now.fields)}
    found = []
    for g, group in enumerate(GROUPS):
        rows = was.cycles[:count, g] != now.cycles[:count, g]
        if not rows.any():
            continue
        k = int(rows.argmax())
        block = k // BLOCK
        names = [
            name.removeprefix(f"{group}.")
            for name in sorted({*before, *after})
            if name.split(".")[0] == group
            and (
                name not in before
                or name not in after
                or before[name][block] != after[name][block]
            )
        ]
        found.append(f"{group} from cycle {k + 1} ({', '.join(names)})")
    if len(was.cycles) != len(now.cycles):
        found.append(f"{len(now.cycles)} cycles in place of {len(was.cycles)}")
    return "; ".join(found)


def read() -> dict[str, Hashes]:
    """What is kept, by play."""
    with np.load(GOLDEN) as kept:
        names = dict.fromkeys(key.split("|")[0] for key in kept)
        return {
            name: Hashes(*(kept[f"{name}|{part}"] for part in Hashes._fields))
            for name in names
        }


def write(found: dict[str, Hashes]) -> None:
    """Keep these."""
    parts = {
        f"{name}|{part}": array
        for name, hashes in found.items()
        for part, array in hashes._asdict().items()
    }
    np.savez_compressed(GOLDEN, **parts)


def main() -> int:
    """Run the plays; 0 if nothing differs."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", default="", help="plays whose names hold this")
    parser.add_argument("--write", action="store_true", help="keep what is now")
    parser.add_argument("--processes", type=int, default=2)
    chosen = parser.parse_args()
    kept = read() if GOLDEN.exists() else {}
    names = [play.name for play in PLAYS if chosen.only in play.name]
    differ, begin = 0, perf_counter()
    with ProcessPoolExecutor(chosen.processes) as pool:
        for name, now in zip(names, pool.map(hashes_of, names), strict=True):
            if chosen.write:
                kept[name] = now
                print(f"{name}: {len(now.cycles)} cycles kept", flush=True)
                continue
            found = difference(kept[name], now) if name in kept else "it is not kept"
            differ += bool(found)
            print(f"{name}: {found or 'the same'}", flush=True)
    if chosen.write:
        write({play.name: kept[play.name] for play in PLAYS if play.name in kept})
    took = perf_counter() - begin
    print(f"{len(names)} plays in {took:.0f} s, {differ} differ")
    return 1 if differ else 0


if __name__ == "__main__":
    sys.exit(main())
