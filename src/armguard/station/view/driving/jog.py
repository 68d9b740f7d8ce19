"""Keys and gamepads as velocities of a tool."""

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.station.view.driving.pulses import HELD

Floats = NDArray[np.float64]

# What a key asks for: forward, left, up; roll, pitch, yaw; in the world's axes.
KEYS: dict[str, tuple[int, float]] = {
    "KeyW": (0, 1.0),
    "KeyS": (0, -1.0),
    "KeyA": (1, 1.0),
    "KeyD": (1, -1.0),
    "KeyR": (2, 1.0),
    "KeyF": (2, -1.0),
    "KeyU": (3, 1.0),
    "KeyO": (3, -1.0),
    "KeyI": (4, 1.0),
    "KeyK": (4, -1.0),
    "KeyJ": (5, 1.0),
    "KeyL": (5, -1.0),
}

# Keys that choose a robot, the first one first.
DIGITS = tuple(f"Digit{k}" for k in range(1, 10))

KEYS_SENTENCE = (
    "**W A S D** forward, left, back, right · **R F** up, down · **U O** roll · "
    "**I K** pitch · **J L** yaw · **1 2 …** choose the arm · **space** stops all"
)
PAD_SENTENCE = (
    "Gamepad: hold **LB**; left stick forward and aside, right stick up and yaw, "
    "triggers roll; **B** stops all, **RB** the next arm"
)

# A standard gamepad, as browsers number it.
LEFT_X, LEFT_Y, RIGHT_X, RIGHT_Y = 0, 1, 2, 3
B, LEFT_BUMPER, RIGHT_BUMPER, LEFT_TRIGGER, RIGHT_TRIGGER = 1, 4, 5, 6, 7

# A stick that is left alone is not quite in its middle [-].
DEAD = 0.12


class Jog:
    """What keys and a gamepad ask for at present.

    Args:
        stop: Called when somebody asks for a stop.
        choose: Called with the place of the robot to lead, or with None for the next.
        clock: The present [s].
    """

    def __init__(
        self,
        stop: Callable[[], None],
        choose: Callable[[int | None], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._stop, self._choose, self._clock = stop, choose, clock
        self._keys: frozenset[str] = frozenset()
        self._pad = np.zeros(6)
        self._buttons: tuple[bool, ...] = ()
        self._keys_told = self._pad_told = -np.inf

    def hear(self, said: Mapping[str, Any]) -> None:
        """Take what a page says about keys and gamepads."""
        if said["type"] == "keys":
            self._keys_told = self._clock()
            held = said.get("held", ())
            new = frozenset(key for key in held if isinstance(key, str))
            for key in new - self._keys:
                if key in DIGITS:
                    self._choose(DIGITS.index(key))
            self._keys = new
        elif said["type"] == "pad":
            self._pad_told = self._clock()
            self._hear_pad(numbers(said.get("axes")), numbers(said.get("buttons")))

    def let_go(self) -> None:
        """Nobody holds anything any more."""
        self._keys, self._pad = frozenset(), np.zeros(6)

    @property
    def direction(self) -> Floats:
        """What is asked for, each part in [-1, 1]: linear and angular, shape (6,)."""
        # One page's pad says nothing of another page's keys.
        now = self._clock()
        if now - self._keys_told > HELD:
            self._keys = frozenset()
        if now - self._pad_told > HELD:
            self._pad = np.zeros(6)
        wanted = self._pad.copy()
        for key in self._keys:
            if key in KEYS:
                axis, sign = KEYS[key]
                wanted[axis] += sign
        return np.clip(wanted, -1.0, 1.0)

    def _hear_pad(self, axes: Floats, buttons: Floats) -> None:
        self._pad = np.zeros(6)
        if len(axes) < 4 or len(buttons) <= RIGHT_TRIGGER:
            self._buttons = ()
            return
        pressed = tuple(bool(value > 0.5) for value in buttons)
        new = [k for k, on in enumerate(pressed) if on and not self._was(k)]
        self._buttons = pressed
        if B in new:
            self._stop()
        if RIGHT_BUMPER in new:
            self._choose(None)
        # Whoever lets go of this one lets go of the arm.
        if not pressed[LEFT_BUMPER]:
            return
        stick = np.where(np.abs(axes) < DEAD, 0.0, axes)
        roll = buttons[RIGHT_TRIGGER] - buttons[LEFT_TRIGGER]
        self._pad[:] = (
            -stick[LEFT_Y],
            -stick[LEFT_X],
            -stick[RIGHT_Y],
            roll,
            0.0,
            -stick[RIGHT_X],
        )

    def _was(self, button: int) -> bool:
        return button < len(self._buttons) and self._buttons[button]


def numbers(value: Any) -> Floats:
    """Numbers that a page says, or none; what is not finite is 0."""
    known = isinstance(value, Sequence) and not isinstance(value, str)
    if not known or not all(isinstance(v, int | float) for v in value):
        return np.zeros(0)
    return np.nan_to_num(np.array(value, dtype=np.float64), posinf=0.0, neginf=0.0)
