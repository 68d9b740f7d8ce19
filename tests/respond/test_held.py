"""A robot that waits for a person is held: since when, why, and how it goes on."""

import numpy as np
import pytest

from approach import ball_scene
from armguard import Action, Guard, Level, Reason
from armguard.guard.levels import ORDERED, UNTIL_ENGAGED
from armguard.respond import Blocked
from armguard.scene.settings import ResponseSettings
from driven import Driven, ball_guard


class Stopped(Driven):
    """A loop that can also order stops."""

    def stop(self, cycles=1, **options):
        """Some cycles of `Guard.stop`; the last command."""
        for _ in range(cycles):
            command = self.guard.stop(self.q, self.t, velocity=self.v, **options)
            self.v = command.velocity
            self.q = self.q + self.v * 1e-3
            self.t += 1e-3
            self.commands.append(command)
        return command


def held_loop(desired=0.5):
    """A loop whose arm was stopped for a wrong command, and waits."""
    loop = Stopped(ball_guard())
    loop.run([desired], 150)
    loop.cycle([np.nan])
    while loop.cycle([desired]).action >= Action.STOP:
        assert len(loop.commands) < 1000
    return loop


def test_a_robot_that_waits_is_held_since_it_rests():
    loop = held_loop()
    first = loop.commands[-1]
    assert first.action is Action.HOLD
    assert first.velocity[0] == 0.0
    held = first.held["arm"]
    assert held.since == loop.t - 1e-3
    assert held.reason is Reason.WRONG_COMMAND
    assert held.blocked is Blocked.STOPPED
    last = loop.run([0.5], 50)
    assert last.held == first.held
    # What a person reads begins with it, though all is clear otherwise.
    assert last.why.startswith(f"HELD arm since {held.since:.1f} s: invalid command: ")
    assert "send zero velocity once" in last.why
    assert "engage('arm')" in last.why
    assert "HOLD: HELD arm" in repr(last)


def test_one_that_is_still_being_stopped_or_follows_is_not():
    loop = Stopped(ball_guard())
    assert not loop.run([0.5], 150).held
    command = loop.cycle([np.nan])
    assert command.action is Action.STOP
    assert not command.held
    assert not held_loop().cycle([0.0]).held


def test_after_another_stop_it_is_held_anew():
    loop = held_loop()
    before = loop.commands[-1].held["arm"].since
    loop.cycle([0.0])
    loop.run([0.5], 100)
    loop.cycle([np.nan])
    loop.run([0.5], 400)
    assert loop.commands[-1].held["arm"].since > before + 0.1


def test_a_first_position_far_away_holds_it_as_well():
    settings = ResponseSettings(far_start="refuse")
    guard = Guard(ball_scene(response=settings), self_test=False)
    loop = Driven(guard)
    command = loop.run(guard.home + 0.5, 100, "filter_positions")
    assert command.action is Action.HOLD
    assert command.held["arm"].blocked is Blocked.FAR_START
    assert "position near it" in command.held["arm"].remedy
    guard.engage("arm")
    assert not loop.run(guard.home + 0.5, 5, "filter_positions").held


@pytest.mark.parametrize("reason", ORDERED)
def test_an_ordered_stop_keeps_its_reason(reason):
    loop = Stopped(ball_guard())
    loop.run([0.5], 150)
    command = loop.stop(reason=reason)
    assert command.verdict.reason is reason
    assert command.verdict.level is reason.level is Level.STOP
    assert command.action is Action.STOP
    command = loop.stop(400, reason=reason)
    assert command.action is Action.HOLD
    assert command.held["arm"].reason is reason
    assert command.verdict.causes["arm"] is reason
    assert {c.verdict.reason for c in loop.commands[150:]} == {reason}
    # Only what a person is to lift stays when it is not ordered any more.
    command = loop.run([0.0], 3)
    assert bool(command.held) is (reason in UNTIL_ENGAGED)


@pytest.mark.parametrize("reason", UNTIL_ENGAGED)
def test_only_an_engagement_ends_a_stop_that_was_ordered(reason):
    loop = Stopped(ball_guard())
    loop.run([0.5], 150)
    loop.stop(400, reason=reason)
    rests = loop.q.copy()
    loop.run([0.0], 10)
    loop.run([-0.5], 50)
    loop.run(loop.q, 20, "filter_positions")
    loop.run(loop.q - 0.05, 20, "filter_positions")
    loop.guard.engage(ordered=False)
    loop.guard.retreat()
    command = loop.run([-0.5], 200)
    assert (loop.q == rests).all()
    assert command.held["arm"].reason is reason
    assert command.held["arm"].until_engaged
    assert command.held["arm"].remedy == "call engage('arm')"
    loop.guard.engage("arm")
    command = loop.run([-0.5], 200)
    assert not command.held
    assert loop.q[0] < rests[0] - 0.05


def test_an_ordered_stop_holds_a_robot_that_was_stopped_already():
    loop = held_loop()
    loop.stop(3)
    # Cycles without a time of their own may be a sensing delay later than their stamps:
    # the stop is done when that and the delay of the command have passed, 3 ms each.
    assert not loop.run([0.0], 3).held
    assert loop.run([0.0], 3).held["arm"].reason is Reason.STOP_ORDERED
    # A stop of the service meanwhile does not take that away.
    loop.stop(reason=Reason.DEADLINE_MISSED)
    held = loop.run([0.0], 400).held["arm"]
    assert held.reason is Reason.STOP_ORDERED
    assert held.until_engaged


def test_a_stop_before_anything_moved_has_its_reason():
    loop = Stopped(ball_guard())
    command = loop.stop(3, reason=Reason.DEADLINE_MISSED)
    assert command.held["arm"].reason is Reason.DEADLINE_MISSED
    assert not loop.cycle([0.0]).held


@pytest.mark.parametrize("reason", [None, "now", 7, np.nan, Reason.TOO_CLOSE, 1e300])
def test_a_stop_for_no_known_reason_is_an_ordered_one(reason):
    loop = Stopped(ball_guard())
    assert loop.stop(reason=reason).verdict.reason is Reason.STOP_ORDERED


def test_a_checkpoint_knows_since_when_a_robot_is_held():
    loop = held_loop()
    loop.stop(9)
    other = ball_guard()
    other.restore(loop.guard.checkpoint())
    commands = [
        guard.filter(loop.q, [0.0], loop.t, velocity=loop.v)
        for guard in (loop.guard, other)
    ]
    assert commands[0].held == commands[1].held != {}
    assert commands[0].numbers.tobytes() == commands[1].numbers.tobytes()


def test_a_reset_forgets_it():
    loop = held_loop()
    loop.guard.reset()
    assert not loop.cycle([0.0]).held
