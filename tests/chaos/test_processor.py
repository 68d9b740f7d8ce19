"""The time for which threads wait for a processor, with two that share one."""

import os
import subprocess
import sys
import time

import pytest

from armguard.chaos.processor import STOLEN, waits

PATIENCE = 60.0

pytestmark = pytest.mark.skipif(not waits([]), reason="this system does not count it")


def test_of_two_processes_on_one_processor_one_waits():
    here = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(here)})
    try:
        with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as other:
            pids = [os.getpid(), other.pid]
            before, end = sum(waits(pids).values()), time.monotonic() + PATIENCE
            waited = 0.0
            while waited < 0.05 and time.monotonic() < end:
                waited = sum(waits(pids).values()) - before
            other.kill()
        assert waited >= 0.05
    finally:
        os.sched_setaffinity(0, here)


def test_a_process_that_has_ended_is_left_out():
    with subprocess.Popen([sys.executable, "-c", ""]) as one:
        one.wait()
        assert set(waits([one.pid])) == {STOLEN}
