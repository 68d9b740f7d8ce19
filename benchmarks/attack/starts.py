"""Services that are killed in motion, and starts beside a client that says hello."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from signal import SIGKILL

from attack.raw import Raw, Role
from attack.row import Row, none
from attack.target import Target, commanding, free_port, keys_in, new_keys

# How long arms are watched that are to rest, and how long a recording goes on [s].
LOOKS, RUNS = 0.5, 1.0

# Pause between two HELLOs [s].
PAUSE = 0.005

# Chains of services that are killed, and starts, at a time.
AT_A_TIME = 2

# Longest replay, and longest wait for a recorder to end [s].
PATIENCE = 120.0

# What `armguard replay` prints of one recording.
REPLAY = (sys.executable, "-m", "armguard", "replay", "--json")


def kills(count: int) -> Row:
    """Services killed in motion, and started anew on their port."""
    shares = [len(range(k, count, AT_A_TIME)) for k in range(AT_A_TIME)]
    with ThreadPoolExecutor(AT_A_TIME) as pool:
        found = list(pool.map(killed, shares))
    tried, rested, engaged = (sum(one[k] for one in found) for k in range(3))
    return Row(
        attack="service killed (-9) in motion and started again",
        tried=tried,
        had=tried - rested,
        unit="motions before robots were engaged",
        target="0",
        passed=rested == engaged == tried == count,
        note=f"at rest until engaged {rested} of {tried}; moved once engaged {engaged}",
        figures={"at_rest": rested, "moved_when_engaged": engaged},
    )


def killed(count: int) -> tuple[int, int, int]:
    """Kill services in turn; kills, starts at rest, motions once engaged."""
    tried = rested = engaged = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        keys = new_keys(folder)
        target = Target(folder, keys=keys)
        arms = commanding(target)
        try:
            for _ in range(count):
                arms.wait_until(lambda answer: any(answer.velocities))
                target.end(SIGKILL)
                arms.close()
                target = Target(folder, port=target.port, keys=keys)
                arms = commanding(target, engages=False)
                tried += 1
                time.sleep(LOOKS)
                heard = arms.newest is not None
                rested += heard and not arms.moving
                arms.engages = True
                engaged += arms.wait_until(lambda answer: any(answer.velocities))
        finally:
            arms.close()
            target.end()
    return tried, rested, engaged


def recorded_starts(count: int) -> Row:
    """Starts beside a client that says hello all the time; each recording replayed."""
    with ThreadPoolExecutor(AT_A_TIME) as pool:
        found = list(pool.map(lambda _: recorded_start(), range(count)))
    files = [one for some in found for one in some]
    wrong = [sentence for code, sentence in files if code != 0]
    return none(
        f"recordings of {count} starts beside a client that says hello all the time",
        len(files), len(wrong), unit="replays that differ", wanted=count,
        note=f"{len(files)} files, each replayed alone",
        first_difference=wrong[0] if wrong else "",
    )  # fmt: skip


def recorded_start() -> list[tuple[int, str]]:
    """Record a start; exit code and sentence of the replay of each of its files."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        keys, port = new_keys(folder), free_port()
        enough = threading.Event()
        greeter = threading.Thread(target=greet, args=(port, keys, enough))
        greeter.start()
        record = folder / "record"
        try:
            with Target(
                folder, "--record", str(record), port=port, keys=keys
            ) as target:
                with commanding(target):
                    end = time.monotonic() + PATIENCE
                    # The recorder takes longer to start than the service.
                    while not any(record.glob("**/*.mcap")):
                        if time.monotonic() > end:
                            break
                        time.sleep(0.05)
                    time.sleep(RUNS)
        finally:
            enough.set()
            greeter.join()
        return [replayed(file) for file in sorted(record.glob("**/*.mcap"))]


def greet(port: int, keys: Path, enough: threading.Event) -> None:
    """Say hello all the time, whether a service is there or not."""
    key = keys_in(keys)[Role.OBSERVE]
    while not enough.is_set():
        with Raw(port, key, Role.OBSERVE) as raw, suppress(ConnectionError):
            for _ in range(20):
                raw.session = 0
                raw.hello()
                time.sleep(PAUSE)
            raw.connect(timeout=0.2)


def replayed(file: Path) -> tuple[int, str]:
    """Exit code and sentence of the replay of one file, by itself in a folder."""
    with tempfile.TemporaryDirectory() as name:
        alone = Path(shutil.copy(file, name))
        done = subprocess.run(
            [*REPLAY, str(alone)],
            capture_output=True,
            timeout=PATIENCE,
            check=False,
            env={**os.environ, "NO_COLOR": "1"},
        )
    with suppress(ValueError):
        return done.returncode, json.loads(done.stdout)["sentence"]
    return done.returncode, done.stderr.decode(errors="replace")[-500:]


def run(killed_count: int, started: int) -> list[Row]:
    """Both.

    Args:
        killed_count: Services that are killed.
        started: Starts that are recorded.
    """
    return [kills(killed_count), recorded_starts(started)]
