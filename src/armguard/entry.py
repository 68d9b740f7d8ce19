"""How programs of this package begin and end: an error is one sentence and a code."""

import os
import resource
import sys
import traceback
from collections.abc import Callable
from typing import NoReturn

from armguard.errors import ArmguardError

# Set to anything, it has errors show where they were raised.
TRACEBACK = "ARMGUARD_TRACEBACK"

BAD_INPUT = 2
INTERRUPTED = 130

# Address space that the libraries take before the first cycle [byte]. With less some
# fail to load, and others request memory for ever.
LEAST_MEMORY = 900_000_000


class MemoryLimitError(ArmguardError, RuntimeError):
    """The process may not have as much memory as it needs."""


def run_program(program: Callable[[], object], name: str = "error") -> NoReturn:
    """Run a program and end the process with its exit code.

    Args:
        program: Returns an exit code; None is 0.
        name: What its messages begin with.
    """
    try:
        check_memory_limit()
        code = program()
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
    except Exception as error:  # whatever is left must not reach a user as a traceback
        if os.environ.get(TRACEBACK):
            traceback.print_exc()
        sys.stderr.write(f"{name} {sentence_of(error)}\n")
        sys.exit(BAD_INPUT)
    sys.exit(code if isinstance(code, int) else 0)


def check_memory_limit() -> None:
    """Refuse to start under a limit that is too low to end in an error.

    Raises:
        MemoryLimitError: It is.
    """
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit not in (resource.RLIM_INFINITY, -1) and limit < LEAST_MEMORY:
        raise MemoryLimitError(
            f"the address space is limited to {limit / 1e6:.0f} MB and "
            f"{LEAST_MEMORY / 1e6:.0f} MB are needed; raise the limit (`ulimit -v`)"
        )


def sentence_of(error: Exception) -> str:
    """An error as one message with what to do."""
    kind = type(error).__name__
    if isinstance(error, ArmguardError):
        return f"{kind}: {error}"
    if isinstance(error, MemoryError):
        return f"{kind}: memory ran out; give a smaller input or more memory"
    if isinstance(error, OSError) and error.strerror:
        where = f"'{error.filename}': " if error.filename else ""
        return f"{kind}: {where}{error.strerror}"
    said = " ".join(str(error).split())[:200]
    return (
        f"{kind}: {said or 'no more is known'}; no input should lead here: please "
        f"report it with what {TRACEBACK}=1 shows"
    )
