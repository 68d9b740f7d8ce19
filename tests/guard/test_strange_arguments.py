"""Whatever is handed to a cycle: it never raises, and what is no number is a stop."""

import threading

import numpy as np
import pytest

from approach import FIGURES, PERIOD
from armguard.guard import Level, Reason
from armguard.respond import Action, Guard
from armguard.scene import Scene
from arms import simple_arm


class Rude:
    """Refuses everything that is asked of it."""

    def __getattribute__(self, name):
        raise RuntimeError(name)

    def __float__(self):
        raise RuntimeError

    def __len__(self):
        raise RuntimeError

    def __iter__(self):
        raise RuntimeError

    def __repr__(self):
        raise RuntimeError


STRANGE = {
    "huge": 10**400,
    "too long to write": 10**5000,
    "rude": Rude(),
    "complex": 1j,
    "numpy complex": np.complex128(1.0),
    "date": np.datetime64(0, "s"),
    "array": np.zeros(3),
    "text": "1",
    "bytes": b"1",
    "masked": np.ma.masked,
    "set": {1},
    "type": float,
    "list": [0.0],
    "mapping of text": {"a": "x"},
    "mapping of rude": {"a": Rude()},
    "rude keys": {Rude(): 0.0},
}
VECTORS = {
    **STRANGE,
    "complex array": np.zeros(2, dtype=complex),
    "dates": np.zeros(2, dtype="datetime64[s]"),
    "durations": [np.timedelta64(1, "s")] * 2,
    "masked array": np.ma.array([0.0, 0.0], mask=[True, False]),
    "huge numbers": [10**400, 0],
    "texts": ["0", "0"],
    "ragged": [[0.0], 0.0],
    "objects": [Rude(), 0.0],
    "structured": np.zeros(2, dtype=[("x", "f8")]),
}
STILL = np.zeros(2)


def guard_of(mode):
    scene = Scene(mode=mode)
    figures = {} if mode == "fixed" else {"stopping": FIGURES}
    scene.add_robot(simple_arm(joints=2), name="a", **figures)
    return Guard(scene, self_test=False)


@pytest.fixture(scope="module")
def path_guard():
    return guard_of("path")


@pytest.fixture(scope="module")
def fixed_guard():
    return guard_of("fixed")


@pytest.fixture
def guard(path_guard):
    path_guard.reset()
    for k in range(2):
        command = path_guard.filter(STILL, STILL, k * PERIOD, velocity=STILL)
    assert command.verdict.level is Level.CLEAR
    return path_guard


@pytest.mark.parametrize("what", STRANGE)
@pytest.mark.parametrize("place", ["stamp", "now"])
def test_a_strange_time_is_a_stop(guard, fixed_guard, what, place):
    times = {"stamp": 2 * PERIOD, place: STRANGE[what]}
    verdict = guard.step(STILL, velocity=STILL, **times)
    assert verdict.reason is Reason.WRONG_INPUT
    assert verdict.level is Level.STOP
    assert verdict.stamp is None or place == "stamp"
    assert verdict.to_dict()
    command = guard.filter(STILL, STILL, velocity=STILL, **times)
    assert command.action >= Action.STOP
    if place == "stamp" and what != "rude keys":
        assert fixed_guard.step(STILL, STRANGE[what]).level is Level.STOP


@pytest.mark.parametrize("what", VECTORS)
@pytest.mark.parametrize("place", ["q", "velocity"])
def test_a_strange_measurement_is_a_stop(guard, what, place):
    given = {"q": STILL, "velocity": STILL, place: VECTORS[what]}
    command = guard.filter(given["q"], STILL, 2 * PERIOD, velocity=given["velocity"])
    assert command.verdict.reason is Reason.WRONG_INPUT
    assert command.action >= Action.STOP
    assert command.verdict.why


@pytest.mark.parametrize("what", VECTORS)
def test_a_strange_desire_is_a_stop(guard, what):
    ways = (guard.filter, guard.filter_positions, guard.filter_twists)
    for k, way in enumerate(ways):
        command = way(STILL, VECTORS[what], (k + 2) * PERIOD, velocity=STILL)
        assert command.verdict.reason is Reason.WRONG_COMMAND
        assert np.array_equal(command.velocity, STILL)
        assert command.verdict.why


def test_a_time_that_is_nan_is_a_stop_and_none_is_the_newest_stamp(guard):
    assert guard.step(STILL, 2 * PERIOD, velocity=STILL).level is Level.CLEAR
    verdict = guard.step(STILL, 3 * PERIOD, velocity=STILL, now=float("nan"))
    assert verdict.reason is Reason.STAMP_MISSING
    assert verdict.level is Level.STOP


@pytest.mark.parametrize(
    "time", [np.float64(0.002), np.float32(0.002), np.array(0.002)]
)
def test_times_may_be_numbers_of_numpy(guard, time):
    assert guard.step(STILL, time, velocity=STILL).level is Level.CLEAR


def test_a_cycle_within_a_cycle_of_another_thread_is_a_stop(guard):
    """A measurement whose conversion runs a cycle in another thread."""
    found = []

    class Slow:
        def __array__(self, dtype=None, copy=None):
            def inner():
                found.append(guard.filter(STILL, STILL, 2 * PERIOD, velocity=STILL))
                found.append(guard.step(STILL, 2 * PERIOD, velocity=STILL))

            other = threading.Thread(target=inner)
            other.start()
            other.join()
            return np.zeros(2)

    outer = guard.filter(Slow(), STILL, 2 * PERIOD, velocity=STILL)
    command, verdict = found
    assert "another thread" in verdict.why
    assert verdict.reason is Reason.WRONG_INPUT
    assert set(verdict.levels.values()) == {Level.STOP}
    assert command.action is Action.STOP
    assert not command.velocity.any()
    assert "another thread" in command.verdict.why
    assert command.verdict.to_dict()
    # The cycle that was there first is none the worse for it.
    assert outer.verdict.level is Level.CLEAR
    assert guard.step(STILL, 3 * PERIOD, velocity=STILL).level is Level.CLEAR


def test_eight_threads_on_one_guard_raise_nothing(guard):
    faults = []
    start = threading.Barrier(8)

    def work():
        start.wait()
        for k in range(2, 200):
            try:
                guard.step(STILL, k * PERIOD, velocity=STILL).to_dict()
                guard.filter(STILL, STILL, k * PERIOD, velocity=STILL).actions  # noqa: B018
            except Exception as error:
                faults.append(error)

    threads = [threading.Thread(target=work) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not faults
    guard.reset()
    assert guard.step(STILL, 1.0, velocity=STILL).level is Level.CLEAR


def test_a_cycle_that_was_interrupted_leaves_the_guard_to_others(guard):
    class Interrupted:
        def __array__(self, dtype=None, copy=None):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        guard.step(Interrupted(), 2 * PERIOD, velocity=STILL)
    levels = []
    other = threading.Thread(
        target=lambda: levels.append(guard.step(STILL, 3 * PERIOD, velocity=STILL))
    )
    other.start()
    other.join()
    assert "another thread" not in levels[0].why
