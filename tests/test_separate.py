"""Separate kernels: called by name, compiled once, reached from any process."""

import os
import subprocess
import sys

import numba
import numpy as np
import pytest
from numba.core.errors import TypingError

from armguard import separate
from armguard.address import array_at, pointer
from armguard.kernel import kernel
from armguard.separate import SeparateKernel

MODULE = """
from armguard.kernel import kernel

@kernel(separate=True)
def twice(x: float) -> tuple[int, float]:
    return 7, 2.0 * x

@kernel(separate=True)
def four_times(x: float) -> float:
    return twice(twice(x)[1])[1]

@kernel
def inlined(x):
    return four_times(x)

@kernel(entry=True)
def call(x):
    return inlined(x) + twice(x)[0]
"""

CALL = "import calls; print(calls.call(1.5))"

# Calls, without being a kernel, one that calls a separate one.
WRAP = """
import numba
from calls import inlined

@numba.njit
def wrapped(x):
    return inlined(x)

print(wrapped(1.5))
"""

MISSES = """
for one in calls.call, calls.twice.dispatcher, calls.four_times.dispatcher:
    print(sum(one.stats.cache_hits.values()), sum(one.stats.cache_misses.values()))
"""


@kernel(separate=True)
def half_of(number: int) -> float:
    return 0.5 * number


@kernel(separate=True)
def write(place: int) -> None:
    array_at(pointer(place), (2,), np.float64)[1] = half_of(3)


@kernel(separate=True)
def is_odd(number: int) -> bool:
    return number % 2 == 1


@kernel(entry=True)
def use(array):
    write(array.ctypes.data)
    return half_of(array.shape[0]) if is_odd(array.shape[0]) else -1.0


def run(folder, program, **environment):
    (folder / "calls.py").write_text(MODULE)
    path = ":".join([str(folder), *sys.path])
    return subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        check=False,
        env={
            **os.environ,
            "PYTHONPATH": path,
            "ARMGUARD_CACHE": str(folder / "cache"),
            **environment,
        },
    )


def test_a_kernel_calls_separate_ones_by_their_names():
    array = np.zeros(5)
    assert use(array) == 2.5
    assert array[1] == 1.5
    assert use(np.zeros(4)) == -1.0


def test_callers_that_were_kept_find_what_they_call_in_another_process(tmp_path):
    for expected in ("0 1\n" * 3, "1 0\n" * 3):
        made = run(tmp_path, CALL + MISSES)
        assert made.stdout == "13.0\n" + expected, made.stderr


def test_what_is_damaged_in_the_cache_is_compiled_again(tmp_path):
    assert run(tmp_path, CALL).stdout == "13.0\n"
    kept = list((tmp_path / "cache").rglob("*.nbc"))
    for k, file in enumerate(kept):
        code = file.read_bytes()
        middle = len(code) // 2
        other = bytes([code[middle] ^ 1])
        whole = code[:middle] + other + code[middle + 1 :]
        file.write_bytes(code[:middle] if k % 2 else whole)
    assert len(kept) > 2
    made = run(tmp_path, CALL + MISSES)
    assert made.stdout == "13.0\n" + "0 1\n" * 3, made.stderr


def test_so_does_code_that_is_no_kernel(tmp_path):
    for _ in range(2):
        made = run(tmp_path, WRAP)
        assert made.stdout == "6.0\n", made.stderr


def test_interpreted_they_are_functions(tmp_path):
    assert run(tmp_path, CALL, NUMBA_DISABLE_JIT="1").stdout == "13.0\n"


def test_only_kernels_call_one():
    with pytest.raises(TypeError, match="half_of"):
        half_of(3)


def test_arguments_must_be_what_it_declares():
    @numba.njit
    def two():
        return half_of(1, 2)

    @numba.njit
    def fraction():
        return half_of(1.5)

    for wrong in two, fraction:
        with pytest.raises(numba.TypingError):
            wrong()


def test_what_it_returns_must_be_what_it_declares():
    @kernel(separate=True)
    def wrong(number: int) -> int:
        return 0.5 * number

    with pytest.raises(TypeError, match="returns float64; its annotation says int64"):
        separate.link(wrong)


def test_code_that_is_no_kernel_links_what_it_calls():
    @kernel(separate=True)
    def fresh(number: int) -> int:
        return number + 1

    @numba.njit
    def other():
        return fresh(1)

    assert not fresh.linked
    assert other() == 2


def test_an_empty_cell_ends_the_process_with_a_sentence(tmp_path):
    forgets = "import armguard.kernel as k\nk.link = lambda kernel: None\n"
    run(tmp_path, CALL)
    made = run(tmp_path, forgets + CALL)
    assert made.returncode < 0
    assert "called before it was linked" in made.stderr


def test_every_separate_kernel_can_be_reached_from_one_that_python_calls():
    from armguard.respond.whole_cycle import run_filtered_cycle

    names = {
        one.py_func.__name__
        for one in separate.kernels_from(run_filtered_cycle)
        if isinstance(one, SeparateKernel)
    }
    assert {"measure_at", "rebuild_world", "prove_pair", "add_pairs"} <= names


OPTIONAL = """
from armguard.kernel import kernel

@kernel(separate=True)
def third(x: float) -> float:
    return x / 3.0

@kernel(separate=True, optional=True)
def rare(x: float) -> float:
    return 2.0 * x

@kernel(separate=True, optional=True)
def feature(x: float) -> float:
    return rare(third(x))

@kernel(entry=True)
def call(x, on):
    return feature(x) if on else x
"""


@pytest.mark.parametrize("kept", [False, True])
def test_an_optional_kernel_is_linked_by_what_turns_its_feature_on(tmp_path, kept):
    (tmp_path / "optional.py").write_text(OPTIONAL)
    state = "print(m.feature.linked, m.rare.linked, m.third.linked)\n"
    program = f"""
import optional as m
from armguard.separate import link_missing
print(m.call(1.5, False))
{state}link_missing(m.feature)
{state}print(m.call(1.5, True))
"""
    for _ in range(1 + kept):
        made = run(tmp_path, program)
    assert made.stdout.split() == "1.5 False False False True True True 1.0".split(), (
        made.stderr
    )


def test_a_field_with_the_name_of_a_kernel_is_no_call_of_it(tmp_path):
    (tmp_path / "named.py").write_text("""
from armguard.kernel import kernel

@kernel(separate=True)
def shape(x: float) -> float:
    return x

@kernel(entry=True)
def count(array):
    return array.shape[0]
""")
    code = "import named as m, numpy as np; print(m.count(np.zeros(3)), m.shape.linked)"
    made = run(tmp_path, code)
    assert made.stdout == "3 False\n", made.stderr


def test_kernels_of_rare_features_are_optional():
    from armguard.guard.contract_cycle import judge_with_contracts
    from armguard.guard.contracts import prove_with_contract
    from armguard.guard.intent import read_intents
    from armguard.respond.evasion import evade_all
    from armguard.respond.whole_cycle import run_filtered_cycle

    features = judge_with_contracts, prove_with_contract, read_intents, evade_all
    assert all(one.optional for one in features)
    reached = separate.kernels_from(run_filtered_cycle)
    assert not any(one in reached for one in features)


def test_the_kernel_of_a_response_is_reached():
    from armguard.respond.responses import change_target, slow_down

    assert slow_down in separate.kernels_from(change_target)


def test_a_kernel_that_is_only_inlined_is_kept_as_bitcode(tmp_path):
    code = """
import calls
calls.call(1.5)
for one in calls.inlined, calls.call, calls.twice.dispatcher:
    (made,) = one.overloads.values()
    _, _, (machine_code, bitcode) = made.library.serialize_using_object_code()
    name = made.fndesc.mangled_name.encode()
    print(name in machine_code, name in bitcode)
"""
    made = run(tmp_path, code)
    assert made.stdout == "False True\n" + 2 * "True True\n", made.stderr


def test_a_literal_is_compiled_as_the_number_it_is(tmp_path):
    (tmp_path / "literals.py").write_text("""
from armguard.kernel import kernel

@kernel
def plus(x, k):
    return x + k

@kernel(entry=True)
def call(x):
    return plus(x, 1) + plus(x, k=2) + plus(x, 3)
""")
    code = "import literals as m; print(m.call(1.0), len(m.plus.overloads))"
    made = run(tmp_path, code)
    assert made.stdout == "9.0 1\n", made.stderr


# Verbs that two processes compile, each under the same number of its function.
VERBS = """
import numpy as np
from armguard.kernel import kernel
from armguard.lanes import load, most, store

@kernel(inline=False)
def larger(a, b, out):
    store(out, 0, most(load(a, 0), load(b, 0)))

@kernel(inline=False)
def product(a, b, out):
    store(out, 0, load(a, 0) * load(b, 0))

@kernel(entry=True)
def compile_larger(a, b, out):
    larger(a, b, out)

@kernel(entry=True)
def compile_product(a, b, out):
    product(a, b, out)

@kernel(entry=True)
def both(a, b, out):
    product(a, b, out)
    larger(out, b, out)

a, b, out = np.full(8, 3.0), np.full(8, 0.5), np.zeros(8)
"""

NUMBERED = """
from itertools import count
from numba.core.bytecode import FunctionIdentity
import verbs
FunctionIdentity._unique_ids = count(900_000)
"""


def test_code_of_two_processes_is_not_taken_for_one_another(tmp_path):
    (tmp_path / "verbs.py").write_text(VERBS)
    for name, known in (("compile_larger", 3.0), ("compile_product", 1.5)):
        program = f"{NUMBERED}verbs.{name}(verbs.a, verbs.b, verbs.out)\n"
        made = run(tmp_path, program + "print(verbs.out[0])")
        assert made.stdout == f"{known}\n", made.stderr
    program = "import verbs; verbs.both(verbs.a, verbs.b, verbs.out)\n"
    made = run(tmp_path, program + "print(verbs.out[0])")
    assert made.stdout == "1.5\n", made.stderr


def test_no_two_processes_number_their_functions_alike(tmp_path):
    program = """
from numba.core.bytecode import FunctionIdentity
import armguard.kernel
print(next(FunctionIdentity._unique_ids))
"""
    one, other = (int(run(tmp_path, program).stdout) for _ in range(2))
    assert abs(one - other) > 100_000


@kernel(entry=True)
def allocate(array):
    return array.copy()[0]


def test_a_kernel_that_allocates_is_not_compiled():
    with pytest.raises(TypingError):
        allocate(np.zeros(2))
