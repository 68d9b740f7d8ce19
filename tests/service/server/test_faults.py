"""What must not happen in the loop, made to happen: a stop, and the loop goes on."""

import threading
from collections.abc import Iterator

import numpy as np
import pytest

from armguard import Action, Client
from armguard.service.server import Service, ServiceSettings
from armguard.service.server.scenes import open_scene
from armguard.service.wire import Cause
from service_arms import Arms, wait_for

LATE = 0.4
WISH = np.full(14, 0.02)


@pytest.fixture(scope="module")
def service(patient_bay) -> Iterator[Service]:
    settings = ServiceSettings(port=0, late=LATE, self_test=False)
    scene, file = open_scene(
        str(patient_bay), period=settings.period, late=LATE, mode="path"
    )
    one = Service(scene, settings, file=file)
    over = threading.Event()
    thread = threading.Thread(target=one.run, args=(over.is_set,))
    thread.start()
    yield one
    over.set()
    thread.join(20.0)
    assert not thread.is_alive()


def broken(*_: object, **__: object) -> None:
    """An error of no expected kind."""
    raise ZeroDivisionError("nobody thought of this")


@pytest.mark.parametrize("part", ["ask", "write_down", "checkpoint"])
def test_an_exception_is_a_stop_and_the_loop_goes_on(service, monkeypatch, part):
    with Client(port=service.port) as client:
        client.connect(20.0)
        arms = Arms(client)
        arms.lead(WISH)
        faults = service.counters.value("cycle_faults")
        with monkeypatch.context() as patch:
            patch.setattr(service._context.judge, part, broken)
            service._checkpoint = 0
            wait_for(lambda: service.counters.value("cycle_faults") > faults)
            answer = arms.drive_until(WISH, lambda a: a.cause is Cause.FAULT)
        assert answer.action is Action.STOP
        assert set(answer.actions.values()) == {Action.STOP}
        assert (answer.velocity == 0.0).all()
        # It lives, and goes on when its commander has let go.
        arms.lead(WISH)
        arms.drive(0 * WISH, 10)
