"""Closed loops of random motions in the bay, by a client that is killed once."""

import json
import resource
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

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


def looped(folder: Path, count: int) -> dict[str, Any]:
    """Figures of so many episodes."""
    (folder / "bay.yaml").write_text(scene_text(), encoding="utf-8")
    out = folder / "loops"
    shutil.rmtree(out, ignore_errors=True)
    words = [sys.executable, "-m", "armguard", "fleet", "run", f"random:0-{count - 1}"]
    words += ["--scene", "bay.yaml", "--duration", str(DURATION), "--out", str(out)]
    start = time.monotonic()
    client = subprocess.Popen(words)
    while client.poll() is None and not (out / FILE).exists():
        time.sleep(LOOK)
    due = KILLED_AT * len(Manifest.read(out).ends)
    while client.poll() is None and len([*out.glob(PARTS)]) < due:
        time.sleep(LOOK)
    client.kill()
    client.wait()
    before = len([*out.glob(PARTS)])
    worked = processor_time()
    again = subprocess.run([*words, "--json"], check=False, stdout=subprocess.PIPE)
    worked = processor_time() - worked
    names, [row] = query(
        out,
        "select count(distinct item) as distinct_items, count(*) as items, "
        "sum(frames)::bigint as cycles, sum(contacts)::bigint as contacts, "
        "(select count(*) from findings where kind = 'too near') as too_near, "
        "1e3 * min(least) as least_mm, sum(stops)::bigint as stops, "
        "count(stop) as stopped, sum(needless_stops)::bigint as needless, "
        "avg(done) as done, max(longest_hold) as longest_hold_s, "
        "any_value(judge) as judge, count(error) as failed from results",
    )
    found = dict(zip(names, row, strict=True))
    items, known = found.pop("items"), found.pop("distinct_items")
    outcome = json.loads(again.stdout)
    here = outcome["items"] * (1.0 - outcome["before"] / outcome["shards"])
    return found | {
        "episodes": count,
        "duration": DURATION,
        "period": PERIOD,
        "parts": outcome["shards"],
        "parts_when_the_client_was_killed": before,
        "lost": count - known,
        "twice": items - known,
        "exit_code": again.returncode,
        "wall_s": time.monotonic() - start,
        "cpu_ms_an_episode": 1e3 * worked / max(here, 1.0),
    }


def processor_time() -> float:
    """Processor time of all processes that ended and were started here [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


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
