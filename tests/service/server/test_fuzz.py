"""Thousands of messages that are almost right: no crash, and nothing let through."""

import numpy as np

from armguard import Action
from service_arms import Arms
from service_fuzz import fuzz

# `service_fuzz.py` throws a million at a service when it is asked to.
MESSAGES = 6000


def test_nothing_that_is_wrong_moves_a_robot_or_ends_the_loop(served):
    with served.client() as client:
        arms = Arms(client)
        still = np.zeros(14)
        counters = served.counters
        home = arms.q.copy()

        def watch() -> None:
            # States and answers may get lost where so many messages come in; what
            # is commanded never moves anything.
            answer = client.cycle(arms.q, still, still, timeout=0.1)
            assert not answer.velocity.any()

        watch()
        before = counters.values()
        read = fuzz(served.port, counters, MESSAGES, seed=1, step=watch)
        after = counters.values()
        assert read >= MESSAGES
        assert served.process.poll() is None
        assert after["cycle_faults"] == 0
        assert after["stop_orders"] == before["stop_orders"]
        own = client._connection.outbox.sequence
        # Each state and each desired motion that was taken was ours.
        assert after["states"] - before["states"] <= own
        assert after["wishes"] - before["wishes"] <= own
        causes = {k for k in after if k.startswith("dropped") and after[k] > before[k]}
        assert len(causes) >= 14, causes
        assert (arms.q == home).all()
        assert client.call("ping")["cycle"] > 0
        # It still does what it is for.
        client.claim(force=True)
        arms.drive_until(still, lambda a: a.action is Action.FOLLOW)
        arms.lead(np.full(14, 0.02))
        arms.drive(still, 10)
