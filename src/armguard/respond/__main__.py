"""Compile a part of the kernels into the cache.

python -m armguard.respond [guarded]
A guard that finds no compiled kernels starts this process, so that two share the work.
"""

import ctypes
import os
import signal
import sys

from armguard.respond.compiling import compile_there, no_collections
from armguard.respond.guard import try_out

# Of prctl(2): the signal this process gets when its parent ends.
PR_SET_PDEATHSIG = 1


def end_with_parent() -> None:
    """Have the operating system kill this process when its parent ends."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


if __name__ == "__main__":
    end_with_parent()
    with no_collections():
        compile_there("guarded" in sys.argv[1:], try_out)
    # All is on disk. To take apart what the compiler made would take seconds.
    os._exit(0)
