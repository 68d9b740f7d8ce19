"""Which tries of a fault count, without any process: a ground that a test directs."""

from contextlib import nullcontext
from types import SimpleNamespace

import pytest

from armguard.chaos.fault import Effect, Fault
from armguard.chaos.play import TRIES, play
from armguard.errors import StationError
from armguard.guard.levels import Reason

PASSING, LATE_STATE = None, Reason.STATE_STALE
JUMP = Reason.STATE_JUMPED


class Ground:
    """A playground that answers each try with the next of some reasons to stop.

    Args:
        reasons: By try, None for none; the last one goes on.
        waited: The longest wait of one of its threads for a processor [s].
        least: Least distance of all pairs [m].
    """

    slack, late, stopping_time = 0.0, 0.08, 1.0

    def __init__(self, *reasons, waited=0.0, least=0.1):
        self.reasons, self.least, self._waited = list(reasons), least, waited
        self.tries = self.restarts = 0

    def settle(self):
        self.answers = []

    def begin(self):
        self.began, self.answers, self.truth = 0.0, [], [[0.0]]
        reason = self.reasons[min(self.tries, len(self.reasons) - 1)]
        self.tries += 1
        if isinstance(reason, Exception):
            raise reason
        if reason is not None:
            self.answers = [SimpleNamespace(stops=True, sent=0.2, reason=reason)]

    def watch(self, seconds):
        pass

    def rests(self, row):
        return False

    def risen(self, names):
        return {}

    def restart(self):
        self.restarts += 1

    def waited(self):
        return self._waited


def goes_on():
    return Fault(
        name="none",
        group="test",
        inject=lambda _: nullcontext(),
        effect=Effect.GOES_ON,
    )


def test_a_machine_that_was_late_once_is_given_another_try():
    ground = Ground(LATE_STATE, PASSING)
    outcome = play(ground, goes_on())
    assert outcome.passed and outcome.tries == ground.tries == 2


def test_a_machine_that_is_always_late_by_name_is_given_some_tries():
    ground = Ground(LATE_STATE)
    outcome = play(ground, goes_on())
    assert not outcome.passed and outcome.tries == ground.tries == TRIES
    assert "STATE_STALE after 200 ms; a stop was reported" in outcome.observed


def test_another_reason_counts_at_once():
    ground = Ground(JUMP, PASSING)
    assert not play(ground, goes_on()).passed and ground.tries == 1


@pytest.mark.parametrize("failure", [JUMP, StationError("no answer")])
def test_a_long_wait_for_a_processor_excuses_any_try(failure):
    ground = Ground(*[failure] * 9, PASSING, waited=0.041)
    outcome = play(ground, goes_on())
    assert outcome.passed and outcome.tries == 10
    assert ground.restarts == (0 if failure is JUMP else 9)


def test_a_short_wait_for_a_processor_excuses_nothing():
    ground = Ground(JUMP, PASSING, waited=0.039)
    assert not play(ground, goes_on()).passed and ground.tries == 1


@pytest.mark.parametrize("waited", [0.0, 9.0])
def test_nothing_excuses_contact(waited):
    ground = Ground(LATE_STATE, PASSING, waited=waited, least=0.0)
    outcome = play(ground, goes_on())
    assert ground.tries == 1 and "something touched" in outcome.observed


def test_nothing_excuses_what_must_never_be():
    ground = Ground(AssertionError("a client without a key is answered"), waited=9.0)
    outcome = play(ground, goes_on())
    assert ground.tries == 1 and not outcome.passed
