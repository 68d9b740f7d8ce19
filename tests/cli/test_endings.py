"""How the program ends: on signals while it compiles, and after any error."""

import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from armguard.cli import command_line, main
from armguard.entry import run_program
from armguard.errors import SceneError
from armguard.processes import FIRST
from armguard.scene.bay import FOLDER, bay_path

# Longer than any start on a busy machine, shorter than compiling takes [s].
PATIENCE = 60.0


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_the_service_while_it_compiles(tmp_path, number):
    service = subprocess.Popen(
        # The bay has no meshes to fit before its kernels are compiled.
        [sys.executable, *"-m armguard serve bay --mode path --port 0".split()],
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        env={**os.environ, "ARMGUARD_CACHE": str(tmp_path / "cache")},
        text=True,
    )
    try:
        said = []
        for line in service.stderr:
            said.append(line)
            if "compiling kernels" in line:
                break
        assert service.poll() is None, said
        helpers = wait_for_children(service.pid)
        service.send_signal(number)
        assert service.wait(PATIENCE) == -number
        assert gone(helpers)
    finally:
        service.kill()
        service.wait()
        service.stderr.close()


def wait_for_children(pid):
    """Numbers of the processes that a process has started, one at least."""
    end = time.monotonic() + PATIENCE
    path = Path(f"/proc/{pid}/task/{pid}/children")
    while time.monotonic() < end and path.exists():
        found = path.read_text().split()
        # It has to be past its own start to end with its parent.
        if found and not any(FIRST.encode() in words_of(pid) for pid in found):
            return found
        time.sleep(0.05)
    return []


def words_of(pid):
    """Arguments of a process."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


def gone(pids):
    """Whether processes end in time."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        if not any(map(words_of, pids)):
            return True
        time.sleep(0.05)
    return False


# A service that takes long to be made, as with a long self-test.
SLOW_SERVICE = r"""
import sys, time
from armguard.cli import main, serve

def make(*_, **__):
    try:
        sys.stderr.write("being made\n")
        sys.stderr.flush()
        time.sleep(100.0)
    finally:
        sys.stderr.write("closed\n")

serve.Service = make
serve.compile_kernels = lambda *_: None
sys.argv = ["armguard", "serve", "bay", "--mode", "path", "--port", "0"]
main()
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_the_service_while_it_is_made(number):
    service = subprocess.Popen(
        [sys.executable, "-c", SLOW_SERVICE], stderr=subprocess.PIPE, text=True
    )
    try:
        for line in service.stderr:
            if "being made" in line:
                break
        service.send_signal(number)
        assert service.wait(PATIENCE) == 128 + number
        assert "closed" in service.stderr.read()
    finally:
        service.kill()
        service.wait()
        service.stderr.close()


def raising(error):
    def program():
        raise error

    return program


ERRORS = {
    SceneError("the scene is empty"): "SceneError: the scene is empty",
    RecursionError("maximum recursion depth"): "RecursionError: maximum recursion",
    MemoryError(): "MemoryError: memory ran out",
    FileNotFoundError(2, "No such file", "a.yaml"): "'a.yaml': No such file",
    UnicodeDecodeError("utf-8", b"\xff", 0, 1, "bad"): "UnicodeDecodeError",
    IndexError("mmap index out of range\nof 2"): "IndexError: mmap index out of range",
}


@pytest.mark.parametrize("error", ERRORS, ids=lambda e: type(e).__name__)
def test_any_error_is_one_sentence_and_exit_code_two(error, capsys):
    with pytest.raises(SystemExit) as ended:
        run_program(raising(error))
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert ERRORS[error] in said
    assert said.count("\n") == 1


def test_the_traceback_is_shown_on_request(capsys, monkeypatch):
    monkeypatch.setenv("ARMGUARD_TRACEBACK", "1")
    with pytest.raises(SystemExit):
        run_program(raising(IndexError("x")))
    assert "Traceback" in capsys.readouterr().err


def test_an_interrupt_is_exit_code_130():
    with pytest.raises(SystemExit) as ended:
        run_program(raising(KeyboardInterrupt()))
    assert ended.value.code == 130


def test_an_exit_code_is_passed_on():
    with pytest.raises(SystemExit) as ended:
        run_program(lambda: 1)
    assert ended.value.code == 1


def test_too_little_memory_is_a_sentence():
    """A limit under which libraries fail to load, or allocate memory for ever."""
    limit = 400_000_000
    ended = subprocess.run(
        [sys.executable, "-m", "armguard", "serve", "two-pandas", "--port", "0"],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)),
        check=False,
    )
    assert ended.returncode == 2
    assert "limited to 400 MB and 900 MB are needed" in ended.stderr
    assert "Traceback" not in ended.stderr


FOLDERS = {
    "others may write": (0o777, "has mode 0777"),
    "a group may write": (0o770, "has mode 0770"),
}


@pytest.mark.parametrize("what", FOLDERS)
def test_a_cache_folder_that_others_may_write_to_is_refused(tmp_path, what):
    """What lies in it would be run; nothing is loaded from it, and nothing written."""
    mode, sentence = FOLDERS[what]
    cache = tmp_path / "cache"
    cache.mkdir()
    cache.chmod(mode)
    ended = run_bay(cache)
    assert ended.returncode == 2
    assert sentence in ended.stderr
    assert "set ARMGUARD_CACHE" in ended.stderr
    assert not list(cache.rglob("*.nb*"))


def test_a_check_names_a_cache_folder_that_is_refused(tmp_path):
    (tmp_path / "cache").mkdir()
    (tmp_path / "cache").chmod(0o777)
    ended = in_bay(tmp_path / "cache", "check")
    assert ended.returncode == 2
    assert "has mode 0777" in ended.stdout
    assert "set ARMGUARD_CACHE" in ended.stdout
    assert not list((tmp_path / "cache").rglob("*.nb*"))


def test_a_cache_folder_below_one_that_all_may_change_is_refused(tmp_path):
    above = tmp_path / "shared"
    above.mkdir()
    above.chmod(0o777)
    ended = run_bay(above / "cache")
    assert ended.returncode == 2
    assert "every user may rename folders" in ended.stderr


def test_a_cache_folder_of_another_user_is_refused(tmp_path):
    cache = tmp_path / "cache"
    cache.mkdir(mode=0o700)
    if os.geteuid() != 0:
        pytest.skip("only root may give a folder away")
    os.chown(cache, 65534, 65534)
    ended = run_bay(cache)
    assert ended.returncode == 2
    assert "belongs to user 65534" in ended.stderr


def test_a_new_cache_folder_is_the_users_own(tmp_path):
    cache = tmp_path / "new" / "cache"
    program = "import armguard.kernel; print(armguard.kernel.CACHE_FAULT)"
    said = subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, "ARMGUARD_CACHE": str(cache)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert said.stdout.strip() == "None"
    (inner,) = cache.iterdir()
    assert [path.stat().st_mode & 0o777 for path in (cache, inner)] == [0o700, 0o700]


def run_bay(cache: Path):
    """`armguard run` with another cache folder: its guard is the first to compile."""
    return in_bay(cache, "run", "--trajectory", str(FOLDER / "task_150.csv"))


def in_bay(cache: Path, command: str, *options: str):
    """A command for the bay with another cache folder."""
    return subprocess.run(
        [sys.executable, "-m", "armguard", command, str(bay_path()), *options],
        env={**os.environ, "ARMGUARD_CACHE": str(cache), "COLUMNS": "400"},
        capture_output=True,
        text=True,
        timeout=10 * PATIENCE,
        check=False,
    )


def test_the_command_line_ends_with_a_code(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["armguard", "--version"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 0
    assert capsys.readouterr().out.strip() == "0.1.0"


def test_a_command_takes_one_thread_for_blas(monkeypatch):
    """More of them wait for work on the cores of the fits beside them."""
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "")
    monkeypatch.delenv("OPENBLAS_NUM_THREADS")
    monkeypatch.setattr("armguard.cli.app.app", lambda: None)
    command_line()
    assert os.environ["OPENBLAS_NUM_THREADS"] == "1"
