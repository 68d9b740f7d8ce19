"""Requests of the loop to the machine, and a sentence for each that it refuses."""

import ctypes
import os

# Requested FIFO priority: above everything ordinary, below the kernel's own.
PRIORITY = 40

# mlockall: all there is, and all there will be.
CURRENT_AND_FUTURE = 3


def ask_realtime() -> str:
    """Request real-time scheduling; why not, or ""."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except (AttributeError, OSError) as error:
        return (
            f"no real-time scheduling: {error}; run with CAP_SYS_NICE or an rtprio "
            "limit of 40"
        )
    return ""


def ask_locked_memory() -> str:
    """Ask that memory is never swapped out; why not, or ""."""
    try:
        libc = ctypes.CDLL(None, use_errno=True)
        if libc.mlockall(CURRENT_AND_FUTURE) == 0:
            return ""
        why = os.strerror(ctypes.get_errno())
    except (AttributeError, OSError) as error:
        why = str(error)
    return f"memory is not locked: {why}; run with CAP_IPC_LOCK or a memlock limit"


def ask_cpu(cpu: int) -> str:
    """Ask to stay on a processor; why not, or ""."""
    try:
        os.sched_setaffinity(0, {cpu})
    except (AttributeError, OSError, ValueError) as error:
        return f"not bound to processor {cpu}: {error}"
    return ""
