"""One commander at a time, by a token."""

import numpy as np
import pytest

from armguard.errors import RefusedError
from armguard.service.client import Answer
from armguard.service.wire import Cause, Role
from service_arms import Arms, until


def test_of_two_commanders_the_first_one_has_the_command(served):
    with served.client() as client, served.client() as second:
        arms = Arms(client)
        desired = np.full(14, 0.01)
        arms.lead(desired)
        with pytest.raises(RefusedError, match="has the command"):
            second.claim()
        assert not second.commands
        dropped = served.counters.value("dropped_not_commander")
        for _ in range(10):
            second.send_velocities(-desired)
            answer = arms.drive(desired, 1)
            assert (answer.velocity >= 0.0).all()
        assert served.counters.value("dropped_not_commander") >= dropped + 9
        arms.drive(0 * desired, 5)


def test_the_command_can_be_taken_by_force_and_given_back(served):
    with served.client() as client, served.client(role=Role.ADMINISTER) as second:
        arms = Arms(client)
        client.claim()
        second.claim(force=True)
        answer = arms.measure_until(lambda a: a.commander == second.sender)
        assert not client.commands
        desired = np.full(14, 0.01)

        def step() -> Answer:
            second.send_velocities(desired)
            return arms.measure()

        until(step, lambda a: bool((a.velocity == desired).all()))
        second.give_back()
        answer = arms.measure_until(lambda a: a.commander == 0)
        assert answer.cause is Cause.NO_COMMANDER
        client.claim()
        assert client.commands


def test_what_is_for_the_commander_is_refused_to_others(served):
    observing = served.client(role=Role.OBSERVE)
    with served.client() as client, served.client() as other, observing as observer:
        Arms(client)
        client.claim()
        with pytest.raises(RefusedError, match="claim the command first"):
            other.call("engage")
        with pytest.raises(RefusedError, match="needs the key for 'command'"):
            observer.call("engage")
        with pytest.raises(RefusedError, match="needs the key for 'sense'"):
            observer.call("place", name="box1", pose=np.eye(4))
        client.call("engage", name="left")


def test_a_refusal_is_the_guards_own_sentence(served):
    with served.client() as client:
        Arms(client)
        client.claim()
        with pytest.raises(RefusedError, match="no robot is named 'lift'; known"):
            client.call("engage", name="lift")
        with pytest.raises(RefusedError, match="no gripper") as refused:
            client.call("grasp", robot="left", name="bench")
        assert refused.value.kind == "GraspError"
        with pytest.raises(RefusedError, match="there is no call 'engag'; did you"):
            client.call("engag")
        with pytest.raises(RefusedError, match="argument 'robot'; call 'engage' takes"):
            client.call("engage", robot="left")
        assert "why" in client.call("why")
