"""How long after a level changes each channel of the live view says so, in a browser.

python benchmarks/cue_times.py --seconds 120

Service, simulated arms, an operator and the view as in `make demo`; the page is open in
headless Chromium, with its sound on. What draws the light and what makes the sound note
on the wall clock when they do; the ring says on the same clock when that cycle was
written.
Needs playwright and a Chromium that is installed.
"""

import json
import os
import sys
import time
from pathlib import Path

import numpy as np
from playwright.sync_api import Page, sync_playwright

from armguard.cli.console import say
from armguard.recording.frames import Kind, frame_of
from armguard.recording.ring import RingReader
from armguard.simulation.stage import Stage
from episodes.campaign import command
from episodes.records import keep
from pages import DOCS
from speed.service_processes import START, line_of, running
from timing import describe_machine

RESULTS = DOCS / "cue_times.json"
CHROMIUM = os.environ.get("CHROMIUM", "/usr/bin/chromium")
FLAGS = (
    "--no-sandbox",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--enable-unsafe-swiftshader",
    "--autoplay-policy=no-user-gesture-required",
)

# As `make demo` has it: a browser that draws without a graphics card takes both cores.
OPTIONS = ("--late", "0.03", "--stale", "0.1", "--no-self-test")

# What must be reached [ms].
TARGET = 50.0


def main() -> int:
    """Measure; write docs/cue_times.json; 1 if a cue came too late."""
    parser = command(__doc__)
    parser.add_argument("--seconds", type=float, default=120.0)
    chosen = parser.parse_args()
    with Stage("bay", "--response", "deflect", *OPTIONS) as stage:
        stage.start_service()
        stage.wait_for_service()
        stage.start_arms()
        stage.start_operator(seed=8)
        turns, beeps, written = watch(stage, chosen.seconds)
    known = [(at, written[cycle]) for cycle, at in turns if cycle in written]
    light = [1e3 * (at - wrote) for at, wrote in known]
    sound = [1e3 * (at - written[cycle]) for cycle, at in beeps if cycle in written]
    answer = {
        "name": "cues",
        "machine": describe_machine(),
        "seconds": chosen.seconds,
        "target_ms": TARGET,
        "light": figures(light),
        "sound": figures(sound),
    }
    keep(RESULTS, "cues", answer, chosen.seconds)
    print(json.dumps(answer, indent=1))
    return int(not (light and sound) or max([*light, *sound]) > TARGET)


def figures(times: list[float]) -> dict[str, float]:
    """How many there are, median, tail, the longest [ms], and how many are too late."""
    if not times:
        return {"changes": 0}
    median, tail = np.percentile(times, [50, 99])
    return {
        "changes": len(times),
        "median_ms": float(median),
        "p99_ms": float(tail),
        "max_ms": max(times),
        "too_late": sum(time > TARGET for time in times),
    }


def watch(
    stage: Stage, seconds: float
) -> tuple[list[tuple[int, float]], list[tuple[int, float]], dict[int, float]]:
    """Turns of the light, times of beeps, and when each cycle was written [s]."""
    words = ("armguard.view", "--service", str(stage.port), "--page-port", "0")
    with running(*words, log=Path(os.devnull)) as view, sync_playwright() as playwright:
        address = line_of(view, START).split()[-1]
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        page = browser.new_page()
        page.goto(address)
        page.locator("#light[data-level]").wait_for(timeout=60_000)
        return follow(page, stage.frames(), seconds)


def follow(
    page: Page, reader: RingReader, seconds: float
) -> tuple[list[tuple[int, float]], list[tuple[int, float]], dict[int, float]]:
    """The same from an open page."""
    page.locator("#sound").click()
    written: dict[int, float] = {}
    beeps: set[tuple[int, float]] = set()
    turns: set[tuple[int, float]] = set()
    end = time.monotonic() + seconds
    say(f"looking on for {seconds:.0f} s")
    while time.monotonic() < end:
        page.wait_for_timeout(200)
        for frame in map(frame_of, reader.unread()):
            if frame.kind is Kind.CYCLE:
                written[frame.cycle] = frame.wall
        # Beeps that only repeat what was said are of no cycle.
        noted = page.evaluate("window.stationBeeps")
        beeps |= {(b["cycle"], b["at"]) for b in noted if b["cycle"] is not None}
        turns |= {(k, at) for k, at in page.evaluate("window.stationTurns")}
    return sorted(turns), sorted(beeps), written


if __name__ == "__main__":
    sys.exit(main())
