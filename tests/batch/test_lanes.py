"""Lanes: one kernel in both meanings gives the same bits, in vector code."""

import platform
import re
from typing import Any

import numba
import numpy as np
import pytest

from armguard.batch.sine import sincos
from armguard.lanes import (
    WIDTH,
    bits,
    either,
    least,
    load,
    mask,
    most,
    root,
    size,
    some,
    splat,
    store,
)


def play_verbs(values: Any, out: Any) -> Any:
    for start in range(0, len(values), WIDTH):
        a = load(values, start)
        sine, cosine = sincos(a)
        store(out[0], start, sine)
        store(out[1], start, cosine)
        mixed = either(a > 0.5, root(size(a)), 2.0 - a / 3.0)
        store(out[2], start, least(mixed, most(-a, sine * 2.0)))
        if some(a > 19.0):
            store(out[3], start, a + 1.0)


def play_masks(numbers: Any, out: Any) -> Any:
    for k in range(len(numbers)):
        chosen = mask(numbers[k])
        store(out[k], 0, either(chosen, splat(1.0), splat(0.0)))
        out[k, WIDTH] = bits(chosen)


compiled: Any = numba.njit(error_model="numpy")(play_verbs)


@pytest.fixture(scope="module")
def values() -> Any:
    drawn = np.random.default_rng(1).uniform(-20.0, 20.0, 8000)
    drawn[:8] = (0.0, np.pi / 2, np.pi, -np.pi / 4, 1e-9, np.nan, np.inf, 0.5)
    return drawn


def test_both_meanings_give_the_same_bits(values: Any) -> None:
    vector, plain = np.zeros((2, 4, len(values)))
    with np.errstate(invalid="ignore"):
        compiled(values, vector)
    with np.errstate(invalid="ignore"):
        play_verbs(values, plain)
    np.testing.assert_array_equal(vector, plain)
    assert plain[3].any()


@pytest.mark.parametrize("play", [play_masks, numba.njit(play_masks)])
def test_lane_k_of_a_mask_is_bit_k_of_its_number(play: Any) -> None:
    out = np.zeros((256, WIDTH + 1))
    play(np.arange(256), out)
    numbers = np.arange(256)[:, None]
    assert np.array_equal(out[:, :WIDTH], numbers >> np.arange(WIDTH) & 1)
    assert np.array_equal(out[:, WIDTH:], numbers)


def test_sine_and_cosine_are_within_two_units_in_the_last_place(values: Any) -> None:
    out = np.zeros((4, len(values)))
    with np.errstate(invalid="ignore"):
        compiled(values, out)
    right = np.isfinite(values)
    for got, function in ((out[0], np.sin), (out[1], np.cos)):
        wanted = function(values[right])
        assert np.all(np.abs(got[right] - wanted) <= 2.0 * np.spacing(np.abs(wanted)))
        assert np.isnan(got[~right]).all()


@pytest.mark.skipif(
    platform.machine() != "x86_64" or numba.config.DISABLE_JIT,
    reason="looks for compiled x86 instructions",
)
def test_machine_code_is_vector_code(values: Any) -> None:
    compiled(values, np.zeros((4, len(values))))
    (code,) = compiled.inspect_asm().values()
    assert len(re.findall(r"\bv?mulpd\b", code)) > 20
    assert re.search(r"\bv?sqrtpd\b", code)
