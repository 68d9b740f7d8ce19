"""Closed loops of random motions in the bay, by a client that is killed once."""

import shutil
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import psutil

from armguard.fleet.manifest import FILE, Manifest
from armguard.fleet.store import PARTS, query
from armguard.scene import bay_path

# Period of the loop, how much later a cycle may come, and longest time of an
# episode [s].
PERIOD, LATE, DURATION = 0.008, 0.001, 1.0

# The client is killed when this share of the parts is done [-].
KILLED_AT = 0.1

# Time between two looks at what is done [s].
LOOK = 0.2


def looped(folder: Path, count: int, longest: float) -> dict[str, Any]:
    """Figures of so many episodes, or of as many as are done in time.

    Args:
        folder: Where scene and results are written.
        count: Count of episodes.
        longest: Time after which the client is ended for good [s].
    """
    (folder / "bay.yaml").write_text(scene_text(), encoding="utf-8")
    out = folder / "loops"
    shutil.rmtree(out, ignore_errors=True)
    words = [sys.executable, "-m", "armguard", "fleet", "run", f"random:0-{count - 1}"]
    words += ["--scene", "bay.yaml", "--duration", str(DURATION), "--out", str(out)]
    start = time.monotonic()
    client = subprocess.Popen(words)
    while client.poll() is None and not (out / FILE).exists():
        time.sleep(LOOK)
    made = Manifest.read(out)
    while client.poll() is None and done(out) < KILLED_AT * len(made.ends):
        time.sleep(LOOK)
    client.kill()
    client.wait()
    before = done(out)
    items_before = made.ends[before - 1]
    client, worked = subprocess.Popen(words), 0.0
    while client.poll() is None and time.monotonic() < start + longest:
        worked = max(worked, processor_time(client.pid))
        time.sleep(LOOK)
    client.kill()
    client.wait()
    found = results(out)
    items = found.pop("items")
    spans = [made.shard(int(path.stem[5:])) for path in out.glob(PARTS)]
    due = sum(end - first for first, end in spans)
    return found | {
        "duration": DURATION,
        "period": PERIOD,
        "of": count,
        "parts": len(made.ends),
        "parts_done": len(spans),
        "parts_when_the_client_was_killed": before,
        "lost": due - found["episodes"],
        "twice": items - found["episodes"],
        "cpu_ms_an_episode": 1e3 * worked / max(items - items_before, 1),
    }


def done(out: Path) -> int:
    """Count of parts that are done."""
    return len([*out.glob(PARTS)])


def results(out: Path) -> dict[str, Any]:
    """Figures of all results."""
    names, [row] = query(
        out,
        "select count(distinct item) as episodes, count(*) as items, "
        "sum(frames)::bigint as cycles, sum(contacts)::bigint as contacts, "
        "(select count(*) from findings where kind = 'too near') as too_near, "
        "1e3 * min(least) as least_mm, sum(stops)::bigint as stops, "
        "count(stop) as stopped, sum(needless_stops)::bigint as needless, "
        "avg(done) as done, max(longest_hold) as longest_hold_s, "
        "any_value(judge) as judge, count(error) as failed from results",
    )
    return dict(zip(names, row, strict=True))


def processor_time(process: int) -> float:
    """Processor time of a process and of all that it started [s]."""
    with suppress(psutil.Error):
        own = psutil.Process(process)
        every = [own, *own.children(recursive=True)]
        return float(sum(sum(one.cpu_times()[:4]) for one in every))
    return 0.0


def scene_text() -> str:
    """The bay in mode `path`, with no buffer beside the need of its stops."""
    text = bay_path().read_text(encoding="utf-8")
    for one, other in (
        ("urdf: bay_arm.urdf", f"urdf: {bay_path().parent / 'bay_arm.urdf'}"),
        ("mode: fixed", "mode: path"),
        ("buffer: 0.03048", "buffer: 0"),
    ):
        assert one in text
        text = text.replace(one, other)
    return f"{text}cycle: {{period: {PERIOD}, late: {LATE}}}\n"
