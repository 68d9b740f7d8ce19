"""C interface of DAQP: called from compiled code, with memory allocated once.

A call from Python takes five times as long as DAQP needs to solve the program. The
library inside the wheel exports `daqp_quadprog`, which takes three structures. Their
layout is that of one version; with any other version, Python solves the programs.
"""

import ctypes
import sys
from importlib.metadata import version

import daqp
import numpy as np
from numpy.typing import NDArray

Longs = NDArray[np.int64]

# Versions whose structures are laid out as below.
KNOWN = ("0.11.0",)

# Layout of the memory, in words of 8 bytes: the function's address, 0 if it cannot be
# called; then the structures.
FUNCTION = 0
PROBLEM = 1  # n, m | ms | H | f | A | upper | lower | sense | break points | 2 numbers
RESULT = 11  # x | multipliers | cost | slack | flag, iterations | nodes | 2 times
SETTINGS = 19
SENSE = 51  # kinds of the constraints, two in a word; all are inequalities

# Places in the problem and in the result.
SIZES = 0
BOUNDED = 1
POINTERS = 2
FLAG = 4

# Places in the settings: the primal tolerance; a word of two numbers, of which the
# second is the greatest number of iterations.
PRIMAL_TOLERANCE = 0
ITERATIONS = 5


def daqp_memory(constraints: int, tolerance: float, iterations: int) -> Longs:
    """Memory of the solver for programs of a greatest size.

    Args:
        constraints: Greatest number of bounds and rows.
        tolerance: Primal tolerance.
        iterations: Iterations after which a program counts as unsolved.
    """
    memory = np.zeros(SENSE + (constraints + 1) // 2, dtype=np.int64)
    if version("daqp") not in KNOWN or sys.byteorder != "little":
        return memory
    try:
        library = ctypes.CDLL(daqp.__file__)
        function = library.daqp_quadprog
        fill = library.daqp_default_settings
    except (AttributeError, OSError):
        return memory
    fill.restype, fill.argtypes = None, [ctypes.c_void_p]
    settings = memory[SETTINGS:SENSE]
    fill(settings.ctypes.data)
    settings.view(np.float64)[PRIMAL_TOLERANCE] = tolerance
    settings.view(np.int32)[2 * ITERATIONS + 1] = iterations
    memory[FUNCTION] = ctypes.cast(function, ctypes.c_void_p).value or 0
    return memory
