"""Mistakes of clients: the answer has the value, the place and the remedy."""

import pytest

from armguard import ArmguardError
from mistakes.clients import CLIENTS
from mistakes.messages import MESSAGES
from service_arms import Arms

DOOR = {**MESSAGES, **CLIENTS}

BALL = (
    "objects:\n"
    "  ball: {sphere: {radius: 0.05}, top_speed: 1, stale: 0.5, present: false}\n"
)


@pytest.fixture(scope="module")
def with_ball(serving, patient_bay, tmp_path_factory):
    """A service of the bay with an object that moves."""
    file = tmp_path_factory.mktemp("ball") / "bay.yaml"
    text = patient_bay.read_text(encoding="utf-8").replace("objects:\n", BALL, 1)
    file.write_text(text, encoding="utf-8")
    with serving(scene=str(file)) as one:
        yield one


@pytest.mark.parametrize("kind", DOOR)
def test_a_message_is_answered(with_ball, kind, caplog):
    mistake = DOOR[kind]
    with with_ball.client() as client:
        arms = Arms(client)
        try:
            said = mistake.given(client, arms)
        except ArmguardError as error:
            said = str(error)
        said = f"{said}\n{caplog.text}" if mistake.logged else said
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
