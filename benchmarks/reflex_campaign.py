"""Faults of guard, sensor and reflex, and how soon the arms have to stop then.

make reflex-campaign                                   1000 of each kind
make reflex-campaign ARGS="--kind 'guard killed' --episodes 50"     some of one kind

It resumes: an episode is a fault, and those of the same reflex are known from
docs/reflex.json. In an episode of a guard an object comes before a sensor in the
instant in which the guard is killed, frozen or floods all ports. Sensor and listener
stand in for hardware, so they have real-time scheduling where the machine permits it.
An episode in which a processor of the machine ran nothing for 0.5 ms is left out.
"""

import ast
import atexit
import os
import random
import sys
import time
from collections.abc import Callable, Mapping
from functools import cache, partial
from hashlib import sha256
from pathlib import Path
from signal import SIGCONT, SIGKILL, SIGSTOP, SIGUSR1, SIGUSR2

from armguard import reflex
from armguard.chaos import zone_sensor
from armguard.service.wire import pulses
from episodes.campaign import Campaign, Episode, LeftOut
from episodes.records import Digest, Figures
from pages import DOCS, rendered
from reflexes import room as rooms
from reflexes.room import PERIOD, TIMEOUT, WATCHDOG, Room, signal_of
from reflexes.witness import pauses

# A pause of the machine is known so much later [s].
SEEN = 0.003

# What a stop may take beyond the declared time [ms].
BEYOND = 1.0

BEGIN, END = "<!-- campaign -->\n", "<!-- end of campaign -->"


@cache
def room() -> Room:
    """The processes of this process."""
    made = Room()
    atexit.register(made.close)
    return made


def object_comes(to_guard: Callable[[Room], None], one: Room) -> tuple[float, str]:
    """Something happens to the guard, and an object comes at once."""
    to_guard(one)
    return one.stopped(signal_of(one.crew, "sensor", SIGUSR1))


def signals_guard(number: int, one: Room) -> None:
    """Send a signal to the guard."""
    os.kill(one.stage.crew["service"].pid, number)


def flood(one: Room) -> None:
    """Have a process flood all ports."""
    if not one.crew.lives("noise"):
        one.crew.start(
            "noise", (str(Path(rooms.__file__).with_name("noise.py")), str(one.file))
        )
        time.sleep(0.5)


def object_leaves(one: Room) -> None:
    """Take the object away."""
    one.crew.send("sensor", SIGUSR2)


def guard_back(one: Room) -> None:
    """Start the killed guard anew."""
    object_leaves(one)
    one.stage.start_service()
    one.stage.wait_for_service()


def guard_thaws(one: Room) -> None:
    """The frozen guard goes on."""
    object_leaves(one)
    signals_guard(SIGCONT, one)


def signals(name: str, number: int, one: Room) -> tuple[float, str]:
    """Send a signal to the sensor or to the reflex."""
    return one.stopped(signal_of(one.crew, name, number))


def datagram(distance: float, turned: bool, one: Room) -> tuple[float, str]:
    """A frame comes in."""
    return one.stopped(one.send(distance, turned=turned))


# Of each kind: what begins it, what ends it, the reason, and its bound [ms].
ONE, TWO = 1e3 * PERIOD + BEYOND, 1e3 * TIMEOUT + BEYOND
ALONE = 1e3 * WATCHDOG + BEYOND
Kind = tuple[Callable[[Room], tuple[float, str]], Callable[[Room], object], str, float]
KINDS: Mapping[str, Kind] = {
    "guard killed": (
        partial(object_comes, partial(signals_guard, SIGKILL)),
        guard_back, "NEAR", ONE,
    ),
    "guard frozen": (
        partial(object_comes, partial(signals_guard, SIGSTOP)),
        guard_thaws, "NEAR", ONE,
    ),
    "guard corrupted": (partial(object_comes, flood), object_leaves, "NEAR", ONE),
    "sensor killed": (
        partial(signals, "sensor", SIGKILL), Room.start_sensor, "SILENT", TWO,
    ),
    "sensor frozen": (
        partial(signals, "sensor", SIGSTOP),
        lambda one: one.crew.send("sensor", SIGCONT), "SILENT", TWO,
    ),
    "frame corrupted": (
        partial(datagram, 400.0, True), lambda _: None, "CORRUPT", BEYOND,
    ),
    "reflex killed": (
        partial(signals, "reflex", SIGKILL), Room.start_reflex, "silent", ALONE,
    ),
    "reflex frozen": (
        partial(signals, "reflex", SIGSTOP),
        lambda one: one.crew.send("reflex", SIGCONT), "silent", ALONE,
    ),
    "datagram": (partial(datagram, 50.0, False), lambda _: None, "NEAR", BEYOND),
}  # fmt: skip


def episode(kind: str, seed: int) -> Episode:
    """One fault: how long until the arms have to stop, and why they have to."""
    one, (begin, end, reason, bound) = room(), KINDS[kind]
    if kind.startswith("guard"):
        one.stage.check()
    if kind == "datagram":
        for k in range(os.cpu_count() or 1):
            if not one.crew.lives(f"busy {k}"):
                one.crew.start(f"busy {k}", ("-c", "while True: pass"))
    one.lift()
    start = time.monotonic_ns()
    # The fault comes at any phase of the sensor.
    time.sleep(random.Random(seed).uniform(0.0, PERIOD))
    before = one.trip
    took, why = begin(one)
    stopped = time.monotonic_ns()
    time.sleep(SEEN)
    end(one)
    if pauses(one.seen, start, stopped):
        raise LeftOut("this machine paused meanwhile")
    return {
        "seed": seed,
        "ms": round(took, 4),
        "early": before != reflex.Trip.CLEAR,
        "late": not took <= bound,
        "reason": why,
        "wrong": why != reason,
        "realtime": one.realtime,
    }


def summed_up(_: str, episodes: list[Episode]) -> Figures:
    """Figures of episodes, all of which but the longest time are sums."""
    return {
        "episodes": len(episodes),
        "late": sum(e["late"] for e in episodes),
        "wrong": sum(e["wrong"] or e["early"] for e in episodes),
        "not_realtime": sum(not e["realtime"] for e in episodes),
        "most_ms": max(e["ms"] for e in episodes),
    }


def digest(found: Episode) -> Digest:
    """An episode in short."""
    outcome = "late" if found["late"] else ""
    if found["wrong"] or found["early"]:
        outcome = f"stopped by {found['reason']}"
    return Digest(found["seed"], outcome, None, {"ms": found["ms"]})


def version(kind: str) -> str:
    """Hash of the code of reflex, listener and sensor; comments do not count."""
    whole = sha256(kind.encode())
    for one in (reflex, pulses, zone_sensor):
        text = Path(str(one.__file__)).read_text(encoding="utf-8")
        whole.update(ast.dump(ast.parse(text)).encode())
    return whole.hexdigest()[:16]


def page(results: Mapping[str, Figures]) -> str:
    """The page, with a table of what is known."""
    rows = []
    for kind, (_, _, reason, bound) in KINDS.items():
        figures = results.get(kind)
        if figures is None:
            continue
        known = CAMPAIGN.records.digests(kind, figures["version"]).values()
        times = sorted(digest.counts.get("ms", 0.0) for digest in known)
        rows.append(
            {
                "kind": kind, "reason": reason, "bound": bound, **figures,
                "median": times[len(times) // 2],
                "most_of": times[min(int(0.999 * len(times)), len(times) - 1)],
            }
        )  # fmt: skip
    text = (DOCS / "reflex.md").read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    table = rendered("reflex", rows=rows, period=1e3 * PERIOD)
    return f"{before}{BEGIN}{table}{END}{rest.partition(END)[2]}"


CAMPAIGN = Campaign(
    results=DOCS / "reflex.json",
    kinds={kind: partial(episode, kind) for kind in KINDS},
    version=version,
    extreme={"most_ms": max},
    summed_up=summed_up,
    digest=digest,
    is_broken=lambda figures: figures["late"] + figures["wrong"] > 0,
    is_notable=lambda found: found["late"] or found["wrong"] or found["early"],
    count=1000,
    written=100,
    page=page,
)


if __name__ == "__main__":
    sys.exit(CAMPAIGN.main(__doc__))
