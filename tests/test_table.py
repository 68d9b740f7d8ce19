"""Tables: what a kernel is handed is what Python made, and of the declared kind."""

import subprocess
import sys
from typing import NamedTuple

import numpy as np
import pytest

from armguard.kernel import kernel
from armguard.record import attributes, record, records
from armguard.table import (
    ByteMatrix,
    IntVector,
    Ledger,
    LongMatrix,
    Matrix,
    Vector,
    opener,
)


class Inner(NamedTuple):
    """A table within a table."""

    kinds: IntVector
    rows: Matrix


@record
class One:
    """A record."""

    time: float
    count: int


class Outer(NamedTuple):
    """A table of every kind of array, and of a record."""

    q: Vector
    count: LongMatrix
    inner: Inner
    flags: ByteMatrix
    one: One


open_outer = opener(Outer)


@kernel(entry=True)
def use(lines):
    t = open_outer(lines)
    t.q[1] = t.inner.rows[1, 2] + t.count[0, 1]
    t.flags[1, 0] = t.inner.kinds[2]
    t.one.count += 2
    t.one.time = 0.5 * t.one.count
    return t.inner.rows.shape[1] + 10 * t.q.shape[0]


@kernel(entry=True)
def use_address(address):
    return open_outer(address).inner.rows.sum()


def outer():
    return Outer(
        q=np.zeros(4),
        count=np.arange(6).reshape(2, 3),
        inner=Inner(np.array([7, 8, 9], np.int32), np.arange(12.0).reshape(3, 4)),
        flags=np.zeros((2, 2), np.uint8),
        one=records((), One),
    )


def test_a_kernel_reads_and_writes_the_arrays_by_name():
    table = outer()
    one = attributes(table.one)
    one.count = 3
    ledger = Ledger(table)
    assert use(ledger.lines) == 44
    assert (one.count, one.time) == (table.one.count, table.one.time) == (5, 2.5)
    assert table.q.tolist() == [0.0, 7.0, 0.0, 0.0]
    assert table.flags.tolist() == [[0, 0], [9, 0]]
    assert use_address(ledger.lines.ctypes.data) == 66.0


def test_another_array_takes_the_place_of_one():
    ledger = Ledger(outer())
    ledger.put(3, np.ones((2, 5)))
    assert use(ledger.lines) == 45


@pytest.mark.parametrize(
    "wrong",
    [
        {"q": np.zeros(4, np.float32)},
        {"q": np.zeros((4, 1))},
        {"count": np.zeros((2, 3))},
        {"flags": np.zeros((4, 4), np.uint8)[:2, ::2]},
        {"one": records(1, One)},
        {"inner": Inner(np.zeros(3, np.int64), np.zeros((3, 4)))},
    ],
)
def test_an_array_of_another_kind_is_refused(wrong):
    with pytest.raises(TypeError):
        Ledger(outer()._replace(**wrong))


def test_interpreted_it_is_the_same():
    run = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", __file__, "-k", "by_name or place_of"],
        capture_output=True,
        text=True,
        check=False,
        env={"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": ":".join(sys.path)},
    )
    assert run.returncode == 0, run.stdout
