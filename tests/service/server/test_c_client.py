"""The example in C, compiled and run against the running service."""

import hashlib
import re
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest

from armguard.service.wire.pulses import reset
from reflex.rack import KEY, Rack
from service_arms import wait_for

EXAMPLES = Path(__file__).parents[3] / "examples"

# Silence after which the program takes the service for dead [s]; machines that run
# tests have other work to do.
WATCHDOG = 2.0

compiler = shutil.which("cc") or shutil.which("gcc")
pytestmark = pytest.mark.skipif(compiler is None, reason="there is no C compiler")

# Digests of messages of many lengths, in hex.
DIGESTS = """
#include <stdio.h>
#include <stdlib.h>
#include "blake2s.h"
int main(int argc, char **argv) {
    static uint8_t data[8192], digest[16];
    for (int k = 0; k < (int)sizeof data; k++) data[k] = (uint8_t)(7 * k + 1);
    for (int k = 1; k < argc; k++) {
        blake2s(digest, 16, "armguard", 8, data, (uint64_t)atoi(argv[k]));
        for (int j = 0; j < 16; j++) printf("%02x", digest[j]);
        puts("");
    }
    return 0;
}
"""


def compiled(source: Path, target: Path) -> Path:
    """A program; warnings are errors."""
    assert compiler is not None
    flags = ["-std=gnu11", "-O2", "-Wall", "-Wextra", "-Werror", f"-I{EXAMPLES}"]
    flags += [f"-DARMGUARD_WATCHDOG={WATCHDOG}"]
    command = [compiler, *flags, "-o", str(target), str(source)]
    subprocess.run(command, check=True, timeout=60)
    return target


def test_its_seal_is_blake2s(tmp_path):
    source = tmp_path / "digests.c"
    source.write_text(DIGESTS)
    sizes = (0, 1, 63, 64, 65, 127, 128, 129, 500, 8192)
    program = compiled(source, tmp_path / "digests")
    command = [str(program), *map(str, sizes)]
    printed = subprocess.run(
        command, check=True, capture_output=True, text=True, timeout=60
    ).stdout.split()
    data = bytes((7 * k + 1) % 256 for k in range(max(sizes)))
    for size, digest in zip(sizes, printed, strict=True):
        found = hashlib.blake2s(data[:size], key=b"armguard", digest_size=16)
        assert digest == found.hexdigest(), size


def test_it_drives_the_arms(serving, tmp_path):
    program = compiled(EXAMPLES / "client.c", tmp_path / "client")
    # It also does with a service that stays awake for it.
    with serving("--spin=0.002") as served:
        command = [str(program), str(served.port), "1"]
        done = subprocess.run(
            command, check=True, capture_output=True, text=True, timeout=120
        )
        lines = done.stdout.splitlines()
        assert len(lines) == 6
        for line in lines[1:]:
            assert line.endswith("level 0 action 0 reason 0 cause 0 held 0 v 0.0500"), (
                line
            )
        values = served.counters.values()
        assert values["states"] == values["wishes"] == 250
        # Its good-bye is read when the service comes to it.
        wait_for(lambda: served.counters.value("accepted") == 250 + 4)
        assert served.counters.value("received") == 250 + 4


def test_it_says_so_when_no_service_is_there(tmp_path):
    program = compiled(EXAMPLES / "client.c", tmp_path / "client")
    done = subprocess.run(
        [str(program), "1"], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 2
    assert "no service of this user runs there" in done.stderr


def test_it_stops_when_the_service_is_silent(serving, tmp_path):
    program = compiled(EXAMPLES / "client.c", tmp_path / "client")
    with serving() as served:
        command = [str(program), str(served.port), "60"]
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as running:
            wait_for(lambda: served.counters.value("wishes") > 50)
            served.process.send_signal(signal.SIGKILL)
            printed, said = running.communicate(timeout=60)
    assert printed.startswith("cycle ")
    assert said == "the service is silent: stop\n"
    assert running.returncode == 1


def test_it_obeys_a_reflex_of_which_the_service_knows_nothing(serving, tmp_path):
    program = compiled(EXAMPLES / "client.c", tmp_path / "client")
    with Rack(tmp_path) as rack, serving() as served:
        sensor = rack.start_sensor()
        wait_for(lambda: not reset(rack.file))
        listener = str(rack.given["listeners"][-1])
        command = [str(program), str(served.port), "6", listener, KEY]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as running:
            wait_for(lambda: served.counters.value("states") > 150)
            sensor.send_signal(signal.SIGUSR1)
            wait_for(lambda: served.counters.value("states") > 500)
            sensor.send_signal(signal.SIGUSR2)
            wait_for(lambda: not reset(rack.file))
            lines, _ = running.communicate(timeout=120)
        sensor.kill()
        sensor.wait()
    causes = re.findall(r"cause (\d+) held (\d+) v (.*)", lines)
    # It moves, obeys the reflex, and then has the guard stop the arms until they are
    # engaged.
    assert list(dict.fromkeys(one[0] for one in causes)) == ["0", "16", "10"]
    assert ("0", "0", "0.0500") in causes
    assert all(float(v) == 0.0 for cause, _, v in causes if cause == "16")


def test_its_header_is_one_of_cpp_as_well(tmp_path):
    cpp = shutil.which("c++") or shutil.which("g++")
    if cpp is None:
        pytest.skip("there is no C++ compiler")
    source = tmp_path / "client.cpp"
    source.write_text((EXAMPLES / "client.c").read_text())
    flags = ["-std=c++17", "-O2", "-Wall", "-Wextra", "-Werror", f"-I{EXAMPLES}"]
    command = [cpp, *flags, "-o", str(tmp_path / "client"), str(source)]
    subprocess.run(command, check=True, timeout=60)


def test_it_goes_on_by_itself_after_a_late_service(serving, tmp_path):
    program = compiled(EXAMPLES / "client.c", tmp_path / "client")
    with serving() as served:
        command = [str(program), str(served.port), "8"]
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as running:
            wait_for(lambda: served.counters.value("wishes") > 50)
            before = served.counters.value("wishes")
            served.process.send_signal(signal.SIGSTOP)
            time.sleep(1.0)
            served.process.send_signal(signal.SIGCONT)
            printed, said = running.communicate(timeout=120)
        assert running.returncode == 0, said
        assert sum(served.counters.stops().values()) > 0
    # A busy machine may delay any one cycle, so one line that goes on is enough; the
    # lines of the next 200 cycles may still be of the time before the pause.
    later = [
        line for line in printed.splitlines() if int(line.split()[1]) > before + 200
    ]
    assert any(line.endswith("reason 0 cause 0 held 0 v 0.0500") for line in later)
