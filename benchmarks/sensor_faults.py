"""Faults of sensors of the simulated bay: frames that are changed, and wrong mounts."""

from collections import deque
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from armguard.scene.scene import Scene
from armguard.sense.health import Fault
from armguard.simulation.sensed import Sent, Tamper
from armguard.simulation.sensors import mounted
from arrays import Floats

# Status of a distance that was measured, and of an invalid one.
MEASURED, INVALID = 5, 0

CAMERA = "top"

# From a frame (time of measurement, distances, status, stamp) to the one that is sent.
Change = Callable[[float, Floats, Any, float], Sent]


class Injected(NamedTuple):
    """A fault of a simulated sensor.

    Attributes:
        tamper: Changes frames; None if it does not.
        mounts: Poses in truth by name of the sensor, shape (4, 4); the others are
            where the scene says.
        at_fault: The sensors at fault.
    """

    tamper: Tamper | None
    mounts: Mapping[str, Floats]
    at_fault: tuple[str, ...]


class Kind(NamedTuple):
    """A kind of fault.

    Attributes:
        camera: Whether the camera has it, else one zone sensor.
        make: Makes one, from the scene, the name of the sensor, and random numbers.
        named: What it may be named.
    """

    camera: bool
    make: Callable[[Scene, str, np.random.Generator], Injected]
    named: frozenset[Fault]


def changed(
    change: Callable[[np.random.Generator], Change],
) -> Callable[[Scene, str, np.random.Generator], Injected]:
    """A fault that changes the frames of one sensor."""

    def make(_: Scene, name: str, rng: np.random.Generator) -> Injected:
        of_one = change(rng)

        def tamper(sensor: str, *frame: Any) -> Sent:
            return of_one(*frame) if sensor == name else frame[1:]

        return Injected(tamper, {}, (name,))

    return make


def simple(change: Change) -> Callable[[np.random.Generator], Change]:
    """A change that has neither random numbers nor a memory."""
    return lambda _: change


def measured(distance: Floats, status: Any) -> Any:
    """Which distances were measured; those of an image have no status."""
    return status == MEASURED if np.any(status) else distance > 0.0


def dropping(rng: np.random.Generator) -> Change:
    """Four of five frames are lost."""
    return lambda m, d, s, stamp: None if rng.random() < 0.8 else (d, s, stamp)


def frozen(_: np.random.Generator) -> Change:
    """The first frame with eight distances or more is repeated."""
    first: list[Any] = []

    def change(_: float, distance: Floats, status: Any, stamp: float) -> Sent:
        if not first and measured(distance, status).sum() >= 8:
            first[:] = distance, status
        return (*first, stamp) if first else (distance, status, stamp)

    return change


def patch(value: float, noise: float, rows: slice, rng: np.random.Generator) -> Change:
    """Some zones have a distance [m], with noise [m]."""

    def change(_: float, distance: Floats, status: Any, stamp: float) -> Sent:
        distance, status = distance.copy(), status.copy()
        size = distance[rows, 2:5].shape
        distance[rows, 2:5] = value + noise * rng.standard_normal(size)
        status[rows, 2:5] = MEASURED
        return distance, status, stamp

    return change


def invalid(share: float, rng: np.random.Generator) -> Change:
    """A share of the distances is invalid."""

    def change(_: float, distance: Floats, status: Any, stamp: float) -> Sent:
        lost = rng.random(distance.shape) < share
        if np.any(status):
            return distance, np.where(lost, INVALID, status), stamp
        return np.where(lost, 0.0, distance), status, stamp

    return change


def delayed(frames: int, _: np.random.Generator) -> Change:
    """Each frame has the distances of one some frames ago."""
    past: deque[Any] = deque(maxlen=frames + 1)

    def change(_: float, distance: Floats, status: Any, stamp: float) -> Sent:
        past.append((distance, status))
        # Until then frames are as they were: the same one twice is another fault.
        return (*past[0 if len(past) > frames else -1], stamp)

    return change


def elsewhere(way: float, turn: float) -> Any:
    """A mount that is off by a way [m], and turned [rad], in random directions."""

    def make(scene: Scene, name: str, rng: np.random.Generator) -> Injected:
        aside, axis = rng.normal(size=(2, 3))
        offset = {
            "xyz": tuple(way * aside / np.linalg.norm(aside)),
            "rpy": tuple(turn * axis / np.linalg.norm(axis)),
        }
        T = mounted(scene.sensors[name].pose, offset)
        return Injected(None, {name: T}, (name,))

    return make


def swapped(scene: Scene, name: str, _: np.random.Generator) -> Injected:
    """The sensor and the one across its ring have each other's places."""
    ring, _, number = name.partition("/")
    other = f"{ring}/{(int(number) + 2) % 4}"
    mounts = {
        name: scene.sensors[other].pose.matrix(),
        other: scene.sensors[name].pose.matrix(),
    }
    return Injected(None, mounts, (name, other))


def on_other_arm(_: Scene, name: str, __: np.random.Generator) -> Injected:
    """Frames of the same sensor of the other arm come under its name."""
    sides = {"left": "right", "right": "left"}
    side = name.partition("_")[0]
    other, last = name.replace(side, sides[side]), {}

    def tamper(sensor: str, _: float, *frame: Any) -> Sent:
        last[sensor] = frame
        if sensor != name:
            return frame
        return (*last[other][:2], frame[2]) if other in last else frame

    return Injected(tamper, {}, (name,))


def zone(change: Callable[[np.random.Generator], Change], *named: Fault) -> Kind:
    """A kind of fault in the frames of a zone sensor."""
    return Kind(False, changed(change), frozenset(named))


def camera(change: Callable[[np.random.Generator], Change], *named: Fault) -> Kind:
    """A kind of fault in the images of the camera."""
    return Kind(True, changed(change), frozenset(named))


ALL = slice(None)
STUCK_TIME = 1.05
FROZEN = (Fault.REPEATED, Fault.STUCK, Fault.BLIND)
MOVED = frozenset({Fault.MOVED})

KINDS: Mapping[str, Kind] = {
    "silent": zone(simple(lambda *_: None), Fault.SILENT),
    "four of five frames lost": zone(dropping, Fault.SILENT),
    "120 ms late": zone(simple(lambda m, d, s, t: (d, s, t - 0.12)), Fault.LATE),
    "clock 9 s back": zone(
        simple(lambda m, d, s, t: (d, s, t - 9.0)), Fault.STAMP_BACK
    ),
    "clock 1 s ahead": zone(
        simple(lambda m, d, s, t: (d, s, t + 1.0)), Fault.STAMP_AHEAD
    ),
    "clock stopped": zone(
        simple(lambda m, d, s, _: (d, s, STUCK_TIME)), Fault.STAMP_BACK
    ),
    "no stamp": zone(simple(lambda m, d, s, _: (d, s, np.nan)), Fault.UNUSABLE),
    "NaN": zone(simple(lambda m, d, s, t: (d * np.nan, s, t)), Fault.UNUSABLE),
    "negative": zone(
        simple(lambda m, d, s, t: (-d - 1.0, s * 0 + MEASURED, t)), Fault.UNUSABLE
    ),
    "half a frame": zone(simple(lambda m, d, s, t: (d[:4], s, t)), Fault.UNUSABLE),
    "text": zone(simple(lambda m, d, s, t: ("text", s, t)), Fault.UNUSABLE),
    "frame repeated": zone(frozen, *FROZEN),
    "nine zones stuck": zone(
        partial(patch, 0.31, 0.0, slice(2, 5)), Fault.STUCK, Fault.DIRTY
    ),
    "dirt on nine zones": zone(partial(patch, 0.1, 2e-3, slice(2, 5)), Fault.DIRTY),
    "crosstalk in three columns": zone(partial(patch, 0.05, 2e-3, ALL), Fault.DIRTY),
    "nine tenths invalid": zone(partial(invalid, 0.9), Fault.BLIND),
    "sunlit, three quarters invalid": zone(partial(invalid, 0.75), Fault.BLIND),
    "two swapped": Kind(False, swapped, MOVED),
    "on the other arm": Kind(False, on_other_arm, MOVED),
    "camera: image repeated": camera(frozen, *FROZEN),
    "camera: nine tenths invalid": camera(partial(invalid, 0.9), Fault.BLIND),
    "camera: 40 mm off": Kind(True, elsewhere(0.04, 0.0), MOVED),
    "camera: turned by 6°": Kind(True, elsewhere(0.0, 0.105), MOVED),
    "camera: mirrored": camera(
        simple(lambda m, d, s, t: (d[:, ::-1], s, t)), Fault.MOVED
    ),
    "camera: two images behind": camera(partial(delayed, 2), Fault.DELAYED),
}
