"""Mistakes of clients: the answer has the value, the place and the remedy."""

import pytest

from armguard import ArmguardError
from mistakes.messages import MESSAGES
from service_arms import Arms


@pytest.mark.parametrize("kind", MESSAGES)
def test_a_message_is_answered(served, kind):
    mistake = MESSAGES[kind]
    with served.client() as client:
        arms = Arms(client)
        try:
            said = mistake.given(client, arms)
        except ArmguardError as error:
            said = str(error)
        assert not mistake.missing(said), said


def test_the_log_and_the_remark_name_the_unit_while_it_lasts(serving):
    mistake = MESSAGES["desired degrees"]
    with serving() as one:
        with one.client() as client:
            arms = Arms(client)
            mistake.given(client, arms)
            assert not mistake.missing(client.call("why")["remark"])
            client.send_positions(arms.q)
            arms.measure_until(
                lambda _: (
                    client.send_positions(arms.q) or not client.call("why")["remark"]
                )
            )
        errors = one.end()
    assert errors.count("give radians") == 1
    assert not mistake.missing(errors)
