"""The demo, as a user runs it: real processes, and none of them left behind."""

import json
import os
import signal
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

import numpy as np
import pytest

from armguard.cli.demo_line import EVERY, OFF, PAIRS, Belt, job_of_demo

DEMO = (sys.executable, "-m", "armguard", "demo", "--headless")

# A start on a busy machine [s].
START = 120.0


def demo(*words):
    """A demo that runs, in a session of its own."""
    return subprocess.Popen(
        [*DEMO, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def offspring(pid):
    """Processes a process has started, and those these have started."""
    path = Path(f"/proc/{pid}/task/{pid}/children")
    found = [int(word) for word in path.read_text().split()] if path.exists() else []
    return found + [each for child in found for each in offspring(child)]


def lives(pid):
    """Whether a process is there and more than a name."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return False
    return text.rsplit(")", 1)[1].split()[0] != "Z"


def at_work(process):
    """Wait until a demo has started service, arms and operator; their numbers."""
    end = time.monotonic() + START
    while time.monotonic() < end and process.poll() is None:
        family = offspring(process.pid)
        words = " ".join(words_of(pid) for pid in family)
        if "--drive" in words:
            return family
        time.sleep(0.1)
    raise AssertionError(f"the demo does not start: {process.communicate(timeout=9)}")


def words_of(pid):
    """Arguments of a process."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_text().replace("\0", " ")
    except OSError:
        return ""


def gone(family, seconds=15.0):
    """Whether all of them end in time."""
    end = time.monotonic() + seconds
    while any(map(lives, family)) and time.monotonic() < end:
        time.sleep(0.1)
    return not any(map(lives, family))


@pytest.mark.parametrize("scene", ["bay", "two-pandas"])
def test_the_demo_shows_arms_that_move_and_touch_nothing(scene):
    words = ("--scene", scene, "--seconds", "8", "--json")
    run = subprocess.run(
        [*DEMO, *words], capture_output=True, check=False, text=True, timeout=START + 60
    )
    assert run.returncode == 0, run.stderr
    answer = json.loads(run.stdout)
    assert answer["scene"] == scene
    assert answer["cycles"] > 500
    assert answer["touched"] is None
    assert sum(answer["levels"].values()) == answer["cycles"]
    assert max(answer["moving"].values()) > 0.1
    assert answer["exit_code"] == 0


@pytest.mark.realtime
def test_the_demo_of_the_conveyor_picks_items():
    words = ("--scene", "conveyor", "--seconds", "24", "--json")
    run = subprocess.run(
        [*DEMO, *words], capture_output=True, check=False, text=True, timeout=START + 90
    )
    assert run.returncode == 0, run.stderr
    answer = json.loads(run.stdout)
    assert answer["items"]["picked"] >= 1
    assert answer["touched"] is None
    assert min(answer["moving"].values()) > 0.05


def test_items_of_the_demo_are_early_and_late_and_its_belt_is_as_declared():
    job = job_of_demo(1)
    times = np.array([one["t"] for one in job["jobs"]])
    gaps = np.diff(times)
    assert len(times) == 2 * PAIRS and times.min() >= 0.0
    assert times[-1] == pytest.approx(EVERY * PAIRS, abs=EVERY)
    assert np.ptp(gaps[::2]) > 1.5 * OFF and np.ptp(gaps[1::2]) > 1.5 * OFF
    assert job_of_demo(2)["jobs"] != job["jobs"]
    belt = Belt(**job["conveyor"])
    t = np.arange(0.0, 60.0, 0.01)
    travel, speed = np.array([belt.measured(one) for one in t]).T
    assert job["conveyor"]["slowest"] < speed.min() < 0.9 * job["conveyor"]["speed"]
    assert 1.1 * job["conveyor"]["speed"] < speed.max() < job["conveyor"]["fastest"]
    # The speed is that of the travel.
    assert np.diff(travel) / 0.01 == pytest.approx(speed[:-1], abs=1e-3)


def test_the_demo_in_the_terminal_says_what_it_waits_for_and_what_came_of_it():
    run = subprocess.run(
        [*DEMO, "--seconds", "1"],
        capture_output=True,
        check=False,
        text=True,
        timeout=START,
    )
    assert run.returncode == 0, run.stderr
    assert "starting a guard, simulated arms and an operator" in run.stderr
    assert "cycles: " in run.stdout and "nothing touched" in run.stdout


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_an_interrupt_ends_everything_and_prints_the_result():
    process = demo()
    family = at_work(process)
    time.sleep(1.0)
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=60.0)
    assert process.returncode == 0
    assert "cycles: " in out
    assert gone(family)


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_the_demo_prints_the_page_s_link_and_the_next_one_when_it_was_used():
    words = [word for word in DEMO if word != "--headless"]
    process = subprocess.Popen(
        [*words, "--page-port", "0"],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
    )
    try:
        used = next(word for word in words_out(process) if word.startswith("http"))
        with urllib.request.urlopen(used, timeout=START) as answer:
            assert "armguard" in answer.read().decode()
        fresh = next(word for word in words_out(process) if word.startswith("http"))
        assert fresh.partition("=")[0] == used.partition("=")[0] and fresh != used
    finally:
        family = offspring(process.pid)
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60.0)
    assert gone(family)


def words_out(process):
    """Words of what a process prints, as it prints them."""
    for line in process.stdout:
        yield from line.split()


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux ends orphans")
def test_no_process_is_left_when_the_demo_is_killed():
    process = demo()
    family = at_work(process)
    os.kill(process.pid, signal.SIGKILL)
    process.communicate(timeout=10.0)
    assert gone(family)
