"""Keys and gamepads as velocities of a tool."""

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# What a page does not repeat for so long has ended [s].
HELD = 0.25

# Keys that lead forward and back, left and right, up and down; roll, pitch, yaw; in the
# world's axes.
KEYS = {
    f"Key{key}": (axis, sign)
    for axis, pair in enumerate(("WS", "AD", "RF", "UO", "IK", "JL"))
    for key, sign in zip(pair, (1.0, -1.0), strict=True)
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

# A stick at rest is not quite in its middle [-].
DEAD = 0.12


class Jog:
    """The present inputs of keys and a gamepad.

    Args:
        stop: Called when a stop is ordered.
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
        self._buttons = np.zeros(0, dtype=bool)
        self._keys_at = self._pad_at = -np.inf
        self._keys: frozenset[str] = frozenset()
        self._pad = np.zeros(6)

    def receive(self, message: Mapping[str, Any]) -> None:
        """Take a page's message about keys or a gamepad."""
        if message["type"] == "keys":
            self._keys_at = self._clock()
            held = message.get("held", ())
            new = frozenset(key for key in held if isinstance(key, str))
            for key in new - self._keys:
                if key in DIGITS:
                    self._choose(DIGITS.index(key))
            self._keys = new
        elif message["type"] == "pad":
            self._pad_at = self._clock()
            axes, buttons = (numbers(message.get(of)) for of in ("axes", "buttons"))
            self._pad = self._twist_of(axes, buttons)

    def release(self) -> None:
        """Nothing is held any more."""
        self._keys, self._pad = frozenset(), np.zeros(6)

    @property
    def direction(self) -> Floats:
        """Desired twist, linear and angular, each part in [-1, 1], shape (6,)."""
        # One page's pad says nothing of another page's keys.
        now = self._clock()
        if now - self._keys_at > HELD:
            self._keys = frozenset()
        if now - self._pad_at > HELD:
            self._pad = np.zeros(6)
        wanted = self._pad.copy()
        for axis, sign in (KEYS[key] for key in self._keys if key in KEYS):
            wanted[axis] += sign
        return np.clip(wanted, -1.0, 1.0)

    def _twist_of(self, axes: Floats, buttons: Floats) -> Floats:
        """Twist of a gamepad, shape (6,); its other buttons have their effect."""
        before, self._buttons = self._buttons, buttons > 0.5
        if len(axes) < 4 or len(buttons) <= RIGHT_TRIGGER:
            self._buttons = np.zeros(0, dtype=bool)
            return np.zeros(6)
        new = self._buttons.copy()
        new[: len(before)] &= ~before[: len(new)]
        if new[B]:
            self._stop()
        if new[RIGHT_BUMPER]:
            self._choose(None)
        # An operator who releases this one releases the arm.
        if not self._buttons[LEFT_BUMPER]:
            return np.zeros(6)
        x, y, yaw, up = np.where(np.abs(axes) < DEAD, 0.0, axes)[
            [LEFT_Y, LEFT_X, RIGHT_X, RIGHT_Y]
        ]
        roll = buttons[RIGHT_TRIGGER] - buttons[LEFT_TRIGGER]
        return np.array([-x, -y, -up, roll, 0.0, -yaw])


def numbers(value: Any) -> Floats:
    """Numbers in a page's message, or none; one that is not finite is 0."""
    known = isinstance(value, Sequence) and not isinstance(value, str)
    if not known or not all(isinstance(v, int | float) for v in value):
        return np.zeros(0)
    return np.nan_to_num(np.array(value, dtype=np.float64), posinf=0.0, neginf=0.0)
