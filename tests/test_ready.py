"""Object code of a wheel: when it is used, and that kernels are compiled otherwise."""

import os
import platform
import subprocess
import sys

import pytest
from llvmlite import binding
from numba.core import config

from armguard import ready
from armguard.kernel import kernel

pytestmark = pytest.mark.skipif(
    platform.machine() != "x86_64", reason="the code is for this architecture"
)

MODULE = """
from armguard.kernel import kernel

@kernel(separate=True)
def twice(x: float) -> float:
    return 2.0 * x

@kernel(entry=True)
def call(x):
    return twice(x) + 1.0
"""

# As `make dist` does.
WRITE = """
import sys
from pathlib import Path
import calls
from armguard.ready import write_ready
calls.call(1.5)
for one in calls.call, calls.twice.dispatcher:
    write_ready(Path(sys.argv[1]) / one._cache.name, one._cache.kept())
"""

READ = """
import sys
from pathlib import Path
import armguard.kernel
armguard.kernel.READY_CODE = Path(sys.argv[1])
import calls
print(calls.call(1.5))
"""


def run(folder, program, cache, **environment):
    (folder / "calls.py").write_text(MODULE)
    (folder / "ready").mkdir(exist_ok=True)
    return subprocess.run(
        [sys.executable, "-c", program, str(folder / "ready")],
        capture_output=True,
        text=True,
        check=True,
        env={
            **os.environ,
            "PYTHONPATH": ":".join([str(folder), *sys.path]),
            "ARMGUARD_CACHE": str(folder / cache),
            **environment,
        },
    ).stdout


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A folder with the code of two kernels; tests put back what they change."""
    folder = tmp_path_factory.mktemp("wheel")
    run(folder, WRITE, "build", NUMBA_CPU_NAME=ready.TARGET, NUMBA_CPU_FEATURES="")
    assert len(list((folder / "ready").iterdir())) == 2
    return folder


def compiled_in(folder, cache):
    return {path.name.split("-")[0] for path in (folder / cache).rglob("*.nbc")}


def test_what_the_wheel_brings_is_not_compiled(written):
    assert run(written, READ, "own") == "4.0\n"
    assert compiled_in(written, "own") == set()


def damage(code):
    """A byte in the middle is another one."""
    at = len(code) // 2
    return code[:at] + bytes([code[at] ^ 1]) + code[at + 1 :]


DAMAGES = {
    "damaged": damage,
    "cut off": lambda code: code[:-1],
    "empty": lambda _: b"",
    "of another format": lambda code: b"\0" * ready.HASH + code[ready.HASH :],
}


@pytest.mark.parametrize("what", DAMAGES)
def test_a_kernel_whose_file_is_not_as_written_is_compiled(written, what):
    file = written / "ready" / "calls.twice"
    whole = file.read_bytes()
    try:
        file.write_bytes(DAMAGES[what](whole))
        assert run(written, READ, what) == "4.0\n"
    finally:
        file.write_bytes(whole)
    assert compiled_in(written, what) == {"calls.twice"}


def test_a_kernel_without_a_file_is_compiled(tmp_path):
    assert run(tmp_path, READ, "own") == "4.0\n"
    assert compiled_in(tmp_path, "own") == {"calls.twice", "calls.call"}


def test_code_for_this_processor_alone_is_not_put_into_a_wheel(tmp_path):
    @kernel(entry=True)
    def one():
        return 1

    one()
    with pytest.raises(ValueError, match=f"not \\['{ready.TARGET}', ''\\]"):
        one._cache.kept()


def every_feature(monkeypatch, *but):
    features = dict.fromkeys(ready.FEATURES, True) | dict.fromkeys(but, False)
    monkeypatch.setattr(binding, "get_host_cpu_features", lambda: features)


def test_code_is_used_by_processors_that_have_all_it_needs(tmp_path, monkeypatch):
    every_feature(monkeypatch)
    assert ready.usable(tmp_path) == tmp_path
    assert ready.usable(tmp_path / "other") is None
    for missing in "avx2", "fma", "bmi2", "lzcnt", "movbe":
        every_feature(monkeypatch, missing)
        assert ready.usable(tmp_path) is None


@pytest.mark.parametrize(
    ("name", "value"),
    [("CPU_NAME", "generic"), ("CPU_FEATURES", ""), ("BOUNDSCHECK", 1)],
)
def test_code_is_not_used_where_another_kind_is_requested(
    tmp_path, monkeypatch, name, value
):
    every_feature(monkeypatch)
    monkeypatch.setattr(config, name, value)
    assert ready.usable(tmp_path) is None


def test_code_has_its_place_by_sources_python_and_processor(tmp_path, monkeypatch):
    place = ready.place_of_ready_code(tmp_path, "0123")
    assert place != ready.place_of_ready_code(tmp_path, "0124")
    assert place.is_relative_to(tmp_path)
    assert place.name.endswith(ready.TARGET)
    monkeypatch.setattr("sysconfig.get_config_var", lambda _: "cpython-399-x")
    assert place != ready.place_of_ready_code(tmp_path, "0123")
