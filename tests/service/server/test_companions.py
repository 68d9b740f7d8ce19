"""Companions: one that ends in the background is started again, later each time."""

import os
import subprocess
from pathlib import Path

import pytest

from armguard.service.server import companions
from armguard.service.server.companions import LATER, SOON, STEADY, Companions
from service_arms import wait_for

# Modules of Python that end by themselves at once.
ENDS = ("this",)


@pytest.fixture
def now(monkeypatch):
    """A clock that is turned by hand."""
    return [100.0]


@pytest.fixture
def beside(monkeypatch, now):
    """A recorder and an exporter that end at once."""
    for name in ("record", "metrics"):
        monkeypatch.setitem(companions.MODULES, name, ENDS)
    one = Companions(clock=lambda: now[0])
    yield one
    one.end()


def test_a_recorder_is_started_again_later_each_time(beside, now, capfd):
    beside.start({"record": ()}, Path("ring"), 1)
    pause = SOON
    for _ in range(9):
        wait_for(lambda: beside.newly_ended() == 1)
        assert beside.newly_ended() == 0
        now[0] += pause - 0.01
        assert beside.restart() == 0
        now[0] += 0.02
        assert beside.restart() == 1
        assert beside.restart() == 0
        pause = min(2.0 * pause, LATER)
    assert pause == LATER
    # One that lived for long has earned to be back soon.
    now[0] += STEADY
    wait_for(lambda: beside.newly_ended() == 1)
    now[0] += SOON
    assert beside.restart() == 1


def test_others_are_not(beside, now):
    beside.start({"metrics": ()}, Path("ring"), 1)
    wait_for(lambda: beside.newly_ended() == 1)
    now[0] += 1e6
    assert beside.restart() == 0


def test_a_recorder_knows_the_process_that_started_it():
    assert companions.MODULES["record"][-2:] == ("--parent", "{pid}")


@pytest.mark.parametrize(("name", "later"), [("record", 5), ("zenoh", 0)])
def test_the_loop_has_the_processor_before_companions_that_only_look(
    name, later, monkeypatch, now
):
    started = []
    popen = subprocess.Popen

    def note(*words, **options):
        started.append(popen(*words, **options))
        return started[-1]

    monkeypatch.setattr(subprocess, "Popen", note)
    one = Companions(clock=lambda: now[0])
    # A module that runs until it is ended.
    monkeypatch.setitem(
        companions.MODULES, name, ("http.server", "--bind", "127.0.0.1", "0")
    )
    one.start({name: ()}, Path("ring"), 1)
    own = os.getpriority(os.PRIO_PROCESS, 0)
    try:
        assert os.getpriority(os.PRIO_PROCESS, started[0].pid) == min(own + later, 19)
    finally:
        one.end()
