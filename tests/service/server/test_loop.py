"""States and desired motion go in, commands come out, from the real process."""

import time

import numpy as np
import pytest

from armguard import Action, Client, Level, Reason
from armguard.recording.frames import Form, Kind, frame_of
from armguard.recording.ring import RingReader
from armguard.service.client import Answer
from armguard.service.wire import Cause
from service_arms import PERIOD, Arms, until, wait_for


def test_the_first_command_is_the_desired_motion(served):
    with served.client() as client:
        arms = Arms(client)
        desired = np.linspace(-0.03, 0.03, len(arms.q))
        answer = arms.lead(desired)
        assert answer.action is Action.FOLLOW
        assert answer.level is Level.CLEAR
        assert answer.reason is Reason.OK
        assert answer.cause is Cause.NONE
        assert answer.commander == client.sender
        assert answer.began == (client.sender, answer.sequence)
        assert set(answer.actions) == set(client.welcome.robots) == {"left", "right"}
        assert client.welcome.period == PERIOD
        assert client.clock.bound == 0.0
        assert 0.0 < answer.inside < 1.0
        assert 0.0 <= answer.age < 1.0
        assert client.latest.cycle >= answer.cycle
        arms.drive(0 * desired, 10)


def test_the_ring_holds_the_scene_and_every_cycle(serving):
    # A service of its own: a ring loses its first frames to those that come later.
    with serving() as served, served.client() as client:
        reader = RingReader(served.ring, newest=True)
        arms = Arms(client)
        answers = [arms.drive(np.full(14, 0.01), 1) for _ in range(20)]
        frames = [frame_of(row) for row in reader.unread()]
        cycles = {f.cycle: f for f in frames if f.kind is Kind.CYCLE}
        for answer in answers:
            frame = cycles[answer.cycle]
            assert frame.form is Form.VELOCITIES
            assert (frame.told[:14] == answer.velocity).all()
            assert frame.received > 0.0
            assert frame.ended >= frame.received
        oldest = next(RingReader(served.ring).unread())
        note = frame_of(oldest)
        assert note.kind is Kind.NOTE
        assert note.text["scene_hash"] == client.welcome.scene_hash
        assert tuple(note.text["names"]) == client.welcome.names
        arms.drive(np.zeros(14), 5)


def test_positions_are_held_when_the_commander_falls_silent(served):
    with served.client() as client:
        arms = Arms(client)
        client.claim()
        goal = arms.q + 0.004
        for _ in range(60):
            client.send_positions(goal)
            answer = arms.measure()
        assert answer.cause is Cause.NONE
        assert answer.position == pytest.approx(goal, abs=1e-3)
        answer = arms.measure_until(lambda a: a.cause is Cause.WISH_OLD)
        assert answer.position == pytest.approx(goal, abs=1e-3)
        assert answer.action is Action.FOLLOW


def test_tools_are_led_by_twists(served):
    with served.client() as client:
        arms = Arms(client)
        client.claim()
        for _ in range(30):
            client.send_twists({"left": (0.0, 0.0, 0.01, 0.0, 0.0, 0.0)})
            answer = arms.measure()
        assert answer.cause is Cause.NONE
        assert np.abs(answer.velocity[:7]).max() > 1e-3
        assert (answer.velocity[7:] == 0.0).all()
        arms.drive(np.zeros(14), 10)


def test_each_robot_may_have_a_controller_of_its_own(serving):
    with serving() as served, served.client() as left, served.client() as right:
        q = left.welcome.home
        left.send_state(q[:7], 0 * q[:7], robots="left")
        first = left.receive(5.0)
        assert first is not None
        assert first.cause is Cause.WAITING
        assert first.action is Action.STOP
        deadline = time.monotonic() + 20.0
        while True:
            left.send_state(q[:7], 0 * q[:7], robots="left")
            right.send_state(q[7:], 0 * q[7:], robots="right")
            answer = right.receive(1.0)
            if answer is not None and answer.cause is Cause.NO_COMMANDER:
                break
            assert time.monotonic() < deadline
        assert answer.answers(left.sender, 1)
        assert answer.answers(right.sender, 1)
        before = served.counters.value("dropped_second_controller")
        right.send_state(q, 0 * q)
        right.call("ping")
        assert served.counters.value("dropped_second_controller") == before + 1


def test_a_silent_commander_desires_no_motion(served):
    with served.client() as controller, served.client() as commander:
        arms = Arms(controller)
        commander.claim()
        desired = np.full(14, 0.02)

        def step() -> Answer:
            commander.send_velocities(desired)
            return arms.measure()

        until(step, lambda a: bool((a.velocity == desired).all()))
        answer = arms.measure_until(lambda a: a.cause is Cause.WISH_OLD)
        assert "silent" in answer.sentence
        answer = arms.measure_until(lambda a: a.cause is Cause.NO_COMMANDER)
        assert (answer.velocity == 0.0).all()
        assert answer.action is Action.FOLLOW
        assert answer.commander == 0
        # It hears of that as soon as it listens again.
        until(lambda: arms.measure() and commander.latest, lambda a: not a.commander)
        assert not commander.commands


def test_a_silent_controller_is_a_stop_with_its_reason(served):
    with served.client() as client:
        arms = Arms(client)
        arms.lead(np.full(14, 0.02))
        stops = served.counters.stops().get(int(Reason.STATE_STALE), 0)
        late = served.counters.value("cycles_without_state")
        stopped = None
        deadline = time.monotonic() + 20.0
        while stopped is None or stopped.reason is not Reason.STATE_STALE:
            stopped = client.receive(1.0) or stopped
            assert time.monotonic() < deadline
        assert stopped.action is Action.STOP
        assert set(stopped.stopped_by.values()) == {Reason.STATE_STALE}
        assert served.counters.value("cycles_without_state") > late
        stale = int(Reason.STATE_STALE)
        wait_for(lambda: served.counters.stops().get(stale, 0) == stops + 1)


@pytest.mark.parametrize("order", ["stop", "call"])
def test_every_client_may_order_a_stop_and_only_the_commander_ends_it(served, order):
    with served.client() as client, served.client(name="somebody") as observer:
        arms = Arms(client)
        desired = np.full(14, 0.02)
        arms.lead(desired)
        if order == "stop":
            observer.stop()
        else:
            observer.call("stop")
        answer = arms.drive_until(desired, lambda a: a.cause is Cause.STOP_ORDERED)
        assert answer.action is Action.STOP
        answer = arms.drive(0 * desired, 60)
        assert answer.cause is Cause.STOP_ORDERED
        assert (answer.velocity == 0.0).all()
        client.call("engage")
        arms.lead(desired)
        arms.drive(0 * desired, 10)


def test_cycle_answers_with_a_stop_when_no_service_is_there():
    client = Client(port=1)
    answer = client.latest
    assert answer.cause is Cause.NOT_CONNECTED
    assert answer.action is Action.STOP
    assert answer.level is Level.STOP
    assert "not connected" in answer.sentence
