"""Quadratic programs of a cycle's robots, solved within compiled code."""

from math import inf, isfinite

import numpy as np
from numpy.typing import NDArray

from armguard.address import call_c
from armguard.kernel import kernel
from armguard.motion.state import Motion
from armguard.respond.daqp_interface import (
    BOUNDED,
    FLAG,
    FUNCTION,
    POINTERS,
    PROBLEM,
    RESULT,
    SENSE,
    SETTINGS,
    SIZES,
)
from armguard.respond.solver import TOLERANCE
from armguard.respond.state import ROWS, Response

Floats = NDArray[np.float64]

# Bytes of a number.
WORD = 8


@kernel
def solve_programs(programs: int, a: Response, m: Motion) -> int:
    """Solve the quadratic programs of some robots; the solutions replace their targets.

    Args:
        programs: The robots, a bit for each.
        a: Responses.
        m: Motion.

    Returns:
        Robots whose program has no solution, a bit for each.
    """
    unsolved = 0
    for r in range(a.notes.shape[0]):
        if (programs >> r) & 1 == 0:
            continue
        solved = False
        if a.notes[r].overflows == 0:
            # If not all rows can be satisfied, try again with relaxed bounds.
            solved = solve(r, a.limits, a, m) or solve(r, a.eased, a, m)
        if not solved:
            unsolved |= 1 << r
    return unsolved


@kernel(inline=False)
def solve(r: int, limits: Floats, a: Response, m: Motion) -> bool:
    """Find the velocity nearest to a robot's target that satisfies all its rows.

    Returns:
        Whether one was found; if so it is the target now.
    """
    first = m.robot_figures[r].first_joint
    n, count = m.robot_figures[r].joint_count, a.notes[r].row_count
    room = a.target.shape[0]
    # Offset of each part of the program: H, f, A, bounds, x and its multipliers.
    f = room * room
    A = f + room
    upper = A + ROWS * room
    lower = upper + room + ROWS
    x = lower + room + ROWS
    multipliers = x + room
    p = a.program
    for j in range(n):
        for k in range(n):
            p[j * n + k] = 1.0 if j == k else 0.0
        p[f + j] = -a.target[first + j]
        p[upper + j], p[lower + j] = a.high[first + j], a.low[first + j]
        if not isfinite(p[f + j]):
            return False
    for k in range(count):
        at = r * ROWS + k
        p[upper + n + k], p[lower + n + k] = limits[at], -inf
        if not isfinite(limits[at]):
            return False
        for j in range(n):
            value = a.rows[at, first + j]
            p[A + k * n + j] = value
            if not isfinite(value):
                return False
    s, start = a.solver, p.ctypes.data
    s[PROBLEM + SIZES], s[PROBLEM + BOUNDED] = n | ((n + count) << 32), n
    s[PROBLEM + POINTERS] = start
    s[PROBLEM + POINTERS + 1] = start + WORD * f
    s[PROBLEM + POINTERS + 2] = start + WORD * A
    s[PROBLEM + POINTERS + 3] = start + WORD * upper
    s[PROBLEM + POINTERS + 4] = start + WORD * lower
    s[PROBLEM + POINTERS + 5] = s.ctypes.data + WORD * SENSE
    s[RESULT] = start + WORD * x
    s[RESULT + 1] = start + WORD * multipliers
    s[RESULT + FLAG] = 0
    memory = s.ctypes.data
    call_c(
        s[FUNCTION],
        (memory + WORD * RESULT, memory + WORD * PROBLEM, memory + WORD * SETTINGS),
    )
    # The flag is the lower half of its word, and has a sign.
    flag = s[RESULT + FLAG] & 0xFFFFFFFF
    if not 1 <= flag < 1 << 31:
        return False
    if not keeps(r, x, first, n, count, limits, a):
        return False
    for j in range(n):
        commanded = min(max(p[x + j], a.low[first + j]), a.high[first + j])
        a.target[first + j] = commanded
    return True


@kernel
def keeps(
    r: int, x: int, first: int, n: int, count: int, limits: Floats, a: Response
) -> bool:
    """Whether a velocity is finite and satisfies bounds and rows."""
    p = a.program
    for j in range(n):
        value = p[x + j]
        low, high = a.low[first + j], a.high[first + j]
        if not low - TOLERANCE <= value <= high + TOLERANCE:
            return False
    for k in range(count):
        at = r * ROWS + k
        total = 0.0
        for j in range(n):
            total += a.rows[at, first + j] * p[x + j]
        if not total <= limits[at] + TOLERANCE:
            return False
    return True
