"""Who follows its operator: one machine for start, stop, resume and catching up.

A robot that was stopped is not given back to a command that never let go of it: its
operator first asks for nothing, or engages it. Where positions are told, it is given
back when they are near it; if they are not it catches up slowly, or is refused, with
the joints named. Nothing is summed up while it is blocked, so nothing is caught up with
at speed.
"""

from enum import IntEnum

from armguard.guard.watch import BRAKING, LOST, RECOVERING, STOPPING
from armguard.respond.command import Blocked
from armguard.scene.settings import ResponseSettings

STOPS = (STOPPING, BRAKING, LOST)


class State(IntEnum):
    """How a robot stands to its operator."""

    FOLLOWING = 0
    CATCHING_UP = 1
    WAITING = 2


class Engagement:
    """How one robot stands to its operator, from cycle to cycle.

    Attributes:
        state: That.
        blocked: Why it does not simply follow.

    Args:
        settings: Settings of the robot's response.
    """

    def __init__(self, settings: ResponseSettings) -> None:
        self._settings = settings
        self.reset()

    def reset(self) -> None:
        """As at the start: whoever asks for velocities is followed."""
        self.state = State.FOLLOWING
        self.blocked = Blocked.NOT
        self._asked_positions = self._refused = False

    def engage(self) -> None:
        """The operator wants to go on, though what is asked for was never let go."""
        if self.state is State.WAITING:
            self.state = State.CATCHING_UP

    def look(
        self, phase: int, too_near: bool, resting: bool, far: float | None
    ) -> None:
        """Go on by a cycle.

        Args:
            phase: The robot's phase.
            too_near: Whether it rests where not even standing still can be proven.
            resting: Whether nothing is asked of it.
            far: Distance between a joint and the position it is told, the largest; None
                if velocities are told [rad or m].
        """
        if phase in STOPS:
            self.state, self.blocked = State.WAITING, Blocked.STOPPED
            self._asked_positions = self._refused = False
            return
        if far is None:
            self._velocities(resting)
        else:
            self._positions(far)
        if too_near or phase == RECOVERING:
            self.blocked = Blocked.TOO_NEAR

    def _velocities(self, resting: bool) -> None:
        """Velocities: let go once, and it follows again."""
        self._asked_positions = False
        if self.state is State.CATCHING_UP or resting:
            self.state = State.FOLLOWING
        waits = self.state is State.WAITING
        self.blocked = Blocked.STOPPED if waits else Blocked.NOT

    def _positions(self, far: float) -> None:
        """Positions: it follows those that are near it."""
        near = far <= self._settings.far
        if near:
            self.state = State.FOLLOWING
        elif not self._asked_positions and self.state is State.FOLLOWING:
            # The first position it is told, and it is not there.
            self._refused = self._settings.far_start == "refuse"
            self.state = State.WAITING if self._refused else State.CATCHING_UP
        self._asked_positions = True
        if self.state is State.FOLLOWING:
            self.blocked = Blocked.NOT
        elif self.state is State.CATCHING_UP:
            self.blocked = Blocked.CATCHING_UP
        else:
            self.blocked = Blocked.FAR_START if self._refused else Blocked.STOPPED

    @property
    def follows(self) -> bool:
        """Whether it is told anything of what is asked for."""
        return self.state is not State.WAITING

    def speed_share(self, recovering: bool) -> float:
        """Share of its top speeds it may use [-]."""
        if recovering:
            return self._settings.recover_speed
        if self.state is State.CATCHING_UP:
            return self._settings.resume_speed
        return 1.0
