"""`armguard batch`: the rows of a file, clear or not, and how far from what."""

from collections import Counter
from pathlib import Path
from time import perf_counter, perf_counter_ns
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray
from typer import Option

from armguard.batch.checker import Checker
from armguard.bounded import check_file
from armguard.cli.console import (
    CLEAR,
    TOO_CLOSE,
    Json,
    RobotOption,
    loading_bar,
    out,
    print_json,
    progress_bar,
)
from armguard.errors import SceneError
from armguard.scene import load_scene

Floats = NDArray[np.float64]

# The largest file that is read [byte].
LARGEST = 2 * 1024**3

# Rows that are answered between two steps of the bar.
STEP = 1 << 16

# Seconds that a command may take without a bar.
SILENT = 2.0

# Pairs that are printed.
SHOWN = 10


def batch(
    rows: Annotated[
        Path, typer.Argument(help="Joint positions: .npy, or .csv without a title.")
    ],
    scene: Annotated[Path, Option(help="Scene file.")],
    robot: RobotOption = None,
    motions: Annotated[
        bool, Option(help="Prove the straight motion from each row to the next.")
    ] = False,
    margin: Annotated[
        float, Option(min=0.0, help="Do not look for pairs beyond this [m].")
    ] = 0.1,
    threads: Annotated[int, Option(min=1, help="Threads that answer.")] = 1,
    json: Json = False,
) -> None:
    """Check many configurations, the rows of a file.

    Exit code 0 all clear, 1 some are not, 2 bad input.
    """
    q = read_rows(rows)
    with loading_bar() as progress:
        loaded = load_scene(scene, robot=robot, progress=progress)
    checker = Checker(loaded, threads)
    count = max(len(q) - 1, 0) if motions else len(q)
    answer_part(checker, q[: 1 + motions], motions, margin)  # compiles
    start = perf_counter_ns()
    found = answer(checker, q, count, motions, margin)
    took = (perf_counter_ns() - start) / max(count, 1)
    good, a, b, value = (found[:, k] for k in range(4))
    finite = np.asarray(np.isfinite(q).all(axis=1))
    invalid = np.isnan(value)
    if motions:
        invalid = ~(finite[:-1] & finite[1:])
    near = a >= 0.0
    pairs = Counter(zip(a[near].astype(int), b[near].astype(int), strict=True))
    report = {
        "scene": scene.name,
        "rows": count,
        "clear": int(good.sum()),
        "not_clear": int(count - good.sum() - invalid.sum()),
        "invalid": int(invalid.sum()),
        "ns_per_row": took,
        "pairs": [
            {
                "a": checker.labels[i],
                "b": checker.labels[j],
                "rows": rows_of_pair,
                "least": float(value[near & (a == i) & (b == j)].min()),
            }
            for (i, j), rows_of_pair in pairs.most_common(SHOWN)
        ],
    }
    if json:
        print_json(report)
    else:
        show(report, motions)
    raise typer.Exit(CLEAR if good.all() else TOO_CLOSE)


def read_rows(path: Path) -> Floats:
    """The rows of a file.

    Raises:
        SceneError: It is no file of a table of numbers.
    """
    try:
        check_file(path, LARGEST)
        if path.suffix == ".npy":
            given = np.load(path, allow_pickle=False)
        elif path.suffix == ".csv":
            given = np.loadtxt(path, delimiter=",", ndmin=2)
        else:
            raise SceneError(f"'{path}' must end in .npy or .csv")
    except OSError as error:
        raise SceneError(f"'{path}' cannot be read: {error.strerror}") from None
    except (ValueError, EOFError) as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError(f"'{path}' holds no table of numbers: {error}") from None
    if given.ndim != 2 or given.dtype.kind not in "fiu":
        raise SceneError(
            f"'{path}' holds {given.dtype} of shape {given.shape}; it must hold "
            "numbers, one row for each configuration"
        )
    return np.asarray(given, dtype=np.float64)


def answer(
    checker: Checker, q: Floats, count: int, motions: bool, margin: float
) -> Floats:
    """Whether it is clear, pair, and distance or share, of each row, shape (n, 4)."""
    found = np.zeros((count, 4))
    start = perf_counter()
    done = 0
    while done < count and perf_counter() - start < SILENT:
        done = answer_step(checker, q, found, done, motions, margin)
    if done < count:
        with progress_bar("checking rows", count) as advance:
            advance(done)
            while done < count:
                before = done
                done = answer_step(checker, q, found, done, motions, margin)
                advance(done - before)
    return found


def answer_step(
    checker: Checker, q: Floats, found: Floats, done: int, motions: bool, margin: float
) -> int:
    """Answer for some rows from `done` on; returns the first of the rest."""
    end = min(done + STEP, len(found))
    found[done:end] = answer_part(checker, q[done : end + motions], motions, margin)
    return end


def answer_part(checker: Checker, q: Floats, motions: bool, margin: float) -> Floats:
    """See `answer`."""
    if motions:
        way = checker.prove(q[:-1], q[1:])
        return np.column_stack((way.proven, way.a, way.b, way.share))
    near = checker.distances(q, margin)
    return np.column_stack((checker.clear(q), near.a, near.b, near.distance))


def show(report: dict[str, Any], motions: bool) -> None:
    """Print a report."""
    what, good = ("motions", "proven") if motions else ("rows", "clear")
    out.print(
        f"{report['rows']} {what}: {report['clear']} {good}, {report['not_clear']} not "
        f"{good}, {report['invalid']} invalid; {report['ns_per_row']:.0f} ns each",
        markup=False,
    )
    for pair in report["pairs"]:
        last = (
            f"proven up to a share of {pair['least']:.3f} at least"
            if motions
            else f"least distance {pair['least'] * 1e3:.1f} mm"
        )
        out.print(
            f"  {pair['a']} - {pair['b']}: nearest in {pair['rows']} {what}, {last}",
            markup=False,
        )
