"""Tables of fleets as Parquet files, read and written by DuckDB alone."""

import json
import os
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import duckdb
import numpy as np
from numpy.typing import NDArray

from armguard.fleet.job import FleetError

Floats = NDArray[np.float64]

# Columns of the results, and of the findings of each row.
COLUMNS = {
    "item": "BIGINT",
    "input": "VARCHAR",
    "episode": "BIGINT",
    "scene": "VARCHAR",
    "setting": "VARCHAR",
    "frames": "BIGINT",
    "duration": "DOUBLE",
    "clear": "BOOLEAN",
    "contacts": "BIGINT",
    "least": "DOUBLE",
    "a": "VARCHAR",
    "b": "VARCHAR",
    "time": "DOUBLE",
    "beyond_limits": "BIGINT",
    "jumps": "BIGINT",
    "top_speed": "DOUBLE",
    "frozen": "BIGINT",
    "rest_offset": "DOUBLE",
    "start_proven": "BOOLEAN",
    "stop": "DOUBLE",
    "stop_reason": "VARCHAR",
    "needless": "BOOLEAN",
    "stops": "BIGINT",
    "needless_stops": "BIGINT",
    "done": "DOUBLE",
    "longest_hold": "DOUBLE",
    "judge": "VARCHAR",
    "error": "VARCHAR",
}
FINDING = {
    "kind": "VARCHAR",
    "a": "VARCHAR",
    "b": "VARCHAR",
    "start": "DOUBLE",
    "end": "DOUBLE",
    "value": "DOUBLE",
    "text": "VARCHAR",
}
LAYOUT = json.dumps([{**COLUMNS, "findings": [FINDING]}])

# Key of the manifest's hash in a file's own metadata.
MANIFEST = "armguard manifest"

PARTS = "part-*.parquet"


class ParquetError(Exception):
    """A file is no Parquet file, or lacks a column."""


def connection() -> duckdb.DuckDBPyConnection:
    """A database in memory, with one thread: rows keep their order."""
    return duckdb.connect(config={"threads": 1})


@cache
def connection_of(process: int) -> duckdb.DuckDBPyConnection:
    """The database with which a process reads files; a forked one has another."""
    return connection()


def quoted(name: str) -> str:
    """A column's name in a query."""
    return '"' + name.replace('"', '""') + '"'


def columns_of(
    files: Sequence[Path], columns: Sequence[str], where: str = "true"
) -> list[Floats]:
    """Columns of Parquet files, one file after another.

    Args:
        files: The files.
        columns: Expressions of DuckDB.
        where: Which rows.

    Raises:
        ParquetError: A file is none, a column is not there, or a value is missing.
    """
    chosen = ", ".join(f"{one} as c{k}" for k, one in enumerate(columns))
    query = f"select {chosen} from read_parquet($files) where {where}"
    data = connection_of(os.getpid())
    try:
        data.execute(query, {"files": [str(file) for file in files]})
        found = data.fetchnumpy()
    except duckdb.OutOfMemoryException as error:
        raise MemoryError(str(error)) from None
    except duckdb.Error as error:
        raise ParquetError(str(error).splitlines()[0]) from None
    arrays = []
    for k, name in enumerate(columns):
        column = found[f"c{k}"]
        if np.ma.is_masked(column):
            row = int(np.flatnonzero(np.ma.getmaskarray(column))[0])
            raise ParquetError(f"row {row + 1} has no value of {name}")
        arrays.append(np.asarray(column, dtype=np.float64))
    return arrays


def part_of(folder: Path, number: int) -> Path:
    """The file of a part of the results."""
    return folder / f"part-{number:05d}.parquet"


def write_part(path: Path, rows: list[dict[str, Any]], manifest: str) -> None:
    """Write rows under another name, and rename the file when it is whole.

    Args:
        path: The file.
        rows: Results, with the keys of `COLUMNS` and their `findings`.
        manifest: Hash of the manifest that they belong to.

    Raises:
        FleetError: Nothing can be written there.
    """
    text = json.dumps(rows, allow_nan=False)
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with connection() as data:
            # From its text a number is read again bit for bit.
            data.execute(
                "create table found as select unnest(from_json(?::json, ?), "
                "max_depth := 2)",
                [text, LAYOUT],
            )
            data.execute(
                f"copy found to {literal(str(temporary))} (format parquet, "
                "use_tmp_file false, "
                f"kv_metadata {{{literal(MANIFEST)}: {literal(manifest)}}})"
            )
        with temporary.open("rb") as file:
            os.fsync(file.fileno())
        temporary.replace(path)
    except (OSError, duckdb.IOException) as error:
        raise FleetError(
            f"{path}: nothing can be written: {str(error).splitlines()[0]}; free "
            "space, then start the same command again"
        ) from None
    finally:
        temporary.unlink(missing_ok=True)


def literal(text: str) -> str:
    """A text in a query."""
    return "'" + text.replace("'", "''") + "'"


def manifest_of(path: Path) -> str:
    """Hash of the manifest that a part was written with.

    Raises:
        FleetError: It is no part of results.
    """
    query = "select value from parquet_kv_metadata(?) where decode(key) = ?"
    with connection() as data:
        try:
            found = data.execute(query, [str(path), MANIFEST]).fetchall()
        except duckdb.Error as error:
            raise FleetError(
                f"{path}: it is no Parquet file ({str(error).splitlines()[0]}); delete "
                "it, then start the same command again"
            ) from None
    if not found:
        raise FleetError(
            f"{path}: `armguard fleet` did not write it; move it to another folder"
        )
    return bytes(found[0][0]).decode()


def query(folder: Path, sql: str) -> tuple[list[str], list[tuple[Any, ...]]]:
    """Answer a query about results: the tables `results` and `findings`.

    Args:
        folder: The results.
        sql: One statement of DuckDB that reads.

    Returns:
        Names of the columns, and the rows.

    Raises:
        FleetError: There are no results, or DuckDB refuses the query.
    """
    files = [str(path) for path in sorted(folder.glob(PARTS))]
    if not files:
        raise FleetError(f"{folder}: there are no results ({PARTS})")
    with connection() as data:
        data.execute(
            "create table results as select * from read_parquet($files) order by item",
            {"files": files},
        )
        data.execute(
            "create view findings as select item, input, episode, scene, setting, "
            "unnest(findings, max_depth := 2) from "
            "(select * exclude (a, b) from results)"
        )
        # A query about results reads and writes no other file.
        data.execute("set enable_external_access = false")
        try:
            found = data.execute(sql)
            names = [one[0] for one in found.description or ()]
            return names, found.fetchall()
        except duckdb.Error as error:
            raise FleetError(f"the query is refused: {error}") from None
