"""Robots that are held by a running service, and the published loops that go on."""

import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from armguard import Action, Level, Reason
from armguard.chaos.relay import Relay
from armguard.chaos.tampering import on
from armguard.errors import RefusedError
from armguard.recording.rights import Role
from armguard.service.client import Client
from armguard.service.wire import Cause
from armguard.service.wire.keys import keys_path
from armguard.service.wire.layout import Kind
from armguard.view.commander import Commander
from service_arms import ANSWERED, PATIENCE, Arms, wait_for

ROOT = Path(__file__).parents[3]

# The loops of the pages, on another port and for longer, patient with busy machines.
PAGES = ("docs/service.md", "examples/README.md")
CHANGES = (
    ("ag.Client()", "ag.Client({port}, watchdog=5.0)"),
    ("range(100)", "range(700)"),
    ("stamp=stamp)", "stamp=stamp, timeout=5.0)"),
)

# How long the service is held up: longer than it tolerates [s].
PAUSE = 1.0


def test_what_a_guard_stopped_goes_on_when_it_is_released(served):
    with served.client() as client:
        arms = Arms(client)
        desired = np.full(14, 0.02)
        arms.lead(desired)
        # The controller is silent for longer than states may be old.
        time.sleep(0.6)
        answer = arms.drive_until(desired, lambda a: len(a.held) == 2)
        assert {h.reason for h in answer.held.values()} == {Reason.STATE_STALE}
        assert answer.action is Action.HOLD
        assert answer.stops
        assert not answer.velocity.any()
        assert 0.0 <= answer.time - answer.held["left"].since < 20.0
        assert answer.sentence.startswith("HELD left since ")
        assert "the measurement is older than its limit" in answer.sentence
        assert "send zero velocity once" in answer.sentence
        said = repr(answer)
        assert "action=HOLD" in said
        assert "held=['left', 'right']" in said
        printed = client.call("why")
        assert printed["why"].startswith("HELD left since ")
        assert printed["waits"]["left"]["reason"] == "STATE_STALE"
        assert not arms.drive_until(0 * desired, lambda a: not a.held).stops
        arms.lead(desired)
        arms.drive(0 * desired, 10)


def test_only_engage_ends_a_stop_that_was_ordered(served):
    with served.client() as client, served.client(name="somebody") as observer:
        arms = Arms(client)
        desired = np.full(14, 0.02)
        arms.lead(desired)
        observer.stop()
        answer = arms.drive_until(desired, lambda a: len(a.held) == 2)
        assert answer.cause is Cause.STOP_ORDERED
        assert answer.action is Action.HOLD
        assert answer.level >= Level.STOP
        assert set(answer.stopped_by.values()) == {Reason.STOP_ORDERED}
        assert answer.held["left"].remedy == "call engage('left')"
        assert "invalid command" not in answer.sentence
        assert "invalid command" not in client.call("why")["why"]
        client.call("engage", ordered=False)
        with suppress(RefusedError):
            client.call("retreat")
        client.call("reset")
        for some in (0 * desired, -desired, desired):
            answer = arms.drive(some, 20)
            assert answer.cause is Cause.STOP_ORDERED
            assert not answer.velocity.any()
        with pytest.raises(RefusedError):
            observer.call("engage")
        # One is engaged: the order is over, and the other one waits for its own.
        client.call("engage", name="left")
        answer = arms.drive_until(0 * desired, lambda a: "left" not in a.held)
        assert answer.cause is Cause.NONE
        answer = arms.drive(desired, 20)
        assert answer.velocity[:7].any()
        assert not answer.velocity[7:].any()
        assert answer.held["right"].until_engaged
        client.call("engage")
        arms.lead(desired)
        arms.drive(0 * desired, 10)


@pytest.mark.parametrize("lost", [4, 10**6])
def test_a_page_orders_a_stop_until_the_service_confirms_it(served, lost):
    relay = Relay(served.port)
    try:
        with (
            served.client() as client,
            Client(relay.port, keys=keys_path(served.port), watchdog=ANSWERED) as page,
        ):
            arms, remarks = Arms(client), []
            page.connect(PATIENCE)
            commander = Commander(page, Role.COMMAND, remarks.append)
            desired = np.full(14, 0.02)
            arms.lead(desired)
            left = iter(range(lost))
            relay.tamper = on(
                {Kind.STOP},
                lambda message: (
                    () if next(left, None) is not None else ((0.0, message),)
                ),
            )
            commander.stop()
            end = time.monotonic() + 3.0
            while time.monotonic() < end and not remarks:
                commander.listen()
                answer = arms.drive(desired, 1)
                if len(answer.held) == 2:
                    break
            stopped = answer.cause is Cause.STOP_ORDERED
            assert stopped == (lost < 100)
            assert [*map(str, remarks)] == (
                []
                if stopped
                else [
                    "the service does not confirm the stop: stop the robots by their "
                    "own means"
                ]
            )
            if stopped:
                for _ in range(20):
                    arms.drive(0 * desired, 1)
                    commander.listen()
                counted = served.counters.values()["stop_orders"]
                for _ in range(20):
                    arms.drive(0 * desired, 1)
                    commander.listen()
                assert served.counters.values()["stop_orders"] == counted
                client.call("engage")
                arms.drive_until(0 * desired, lambda a: not a.held)
    finally:
        relay.close()


def test_other_settings_do_not_lift_a_stop(served):
    with served.client(role=Role.ADMINISTER) as client:
        arms = Arms(client)
        desired = np.full(14, 0.02)
        arms.drive(0 * desired, 5)
        client.stop()
        arms.drive_until(0 * desired, lambda a: len(a.held) == 2)
        client.call("engage", name="left")
        arms.drive_until(0 * desired, lambda a: "left" not in a.held)
        before = client.call("ping")["cycle"]
        client.call("configure", response="stop")
        answer = arms.drive_until(desired, lambda a: a.cycle > before + 50)
        assert answer.stopped_by["right"] is Reason.STOP_ORDERED
        assert answer.held["right"].until_engaged
        assert not answer.velocity[7:].any()
        client.call("engage")
        arms.drive(0 * desired, 10)
        client.call("configure", response="deflect")


def held_up(served, running):
    """Hold the service up while a loop runs; what that says in the end."""
    wait_for(lambda: served.counters.value("wishes") > 50)
    served.process.send_signal(signal.SIGSTOP)
    time.sleep(PAUSE)
    served.process.send_signal(signal.SIGCONT)
    printed, said = running.communicate(timeout=120)
    assert running.returncode == 0, said
    assert sum(served.counters.stops().values()) > 0
    return printed


@pytest.mark.parametrize("page", PAGES)
def test_the_python_loop_recovers_by_itself(serving, page):
    text = (ROOT / page).read_text(encoding="utf-8")
    code = re.search(r"```python\n(import armguard as ag\n\nwith .*?)```", text, re.S)
    loop = code[1]
    with serving() as served:
        for old, new in CHANGES:
            assert loop.count(old) == 1
            loop = loop.replace(old, new.format(port=served.port))
        ends = "print(answer.held, answer.velocity.min(), answer.velocity.max())\n"
        with subprocess.Popen(
            [sys.executable, "-c", loop + ends],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        ) as running:
            assert held_up(served, running) == "{} 0.05 0.05\n"


def test_the_log_has_a_stop_once_when_it_begins_and_once_when_it_is_over(serving):
    with serving() as service, service.client() as client:
        arms = Arms(client)
        desired = np.full(14, 0.02)
        arms.lead(desired)
        client.stop()
        arms.drive_until(desired, lambda a: len(a.held) == 2)
        arms.drive(desired, 100)
        client.call("engage")
        arms.drive_until(0 * desired, lambda a: not a.held)
        arms.drive(0 * desired, 200)
        time.sleep(0.1)
        said = service.end().splitlines()
    began = [line for line in said if line.startswith("WARNING STOP: ")]
    over = [line for line in said if re.match(r"INFO STOP for \d+\.\d\d s: ", line)]
    assert len(over) == 1 and "stop was ordered" in over[0], said
    assert "stop was ordered" in began[0]
    # A second one is that of the end.
    assert len(began) <= 2, said
