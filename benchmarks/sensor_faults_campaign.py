"""Faults of sensors in moving arms: how soon each is named, and false names in order.

make sensor-faults                                                   50 of each kind
make sensor-faults ARGS="--kind silent --first 3 --episodes 1 --show"    one of them

It resumes: episodes that were run with the same code are known from
docs/sensor_faults.json. The bay has eight zone sensors or a camera; a tenth of their
distances is invalid. A fault begins in one random sensor at a random time. In order: a
minute of motion with all of them and without a fault.
"""

import ast
import sys
from collections.abc import Mapping
from functools import cache, partial
from hashlib import sha256
from operator import is_
from pathlib import Path
from typing import Any

import numpy as np

import armguard as ag
import sensor_faults
from armguard import sense as sensing
from armguard.simulation import sensed
from armguard.simulation.sensed import Sent, Tamper, drive, sensed_bay, swing
from armguard.simulation.sensors import Rig
from episodes.campaign import Campaign, Episode, LeftOut
from episodes.records import Digest, Figures
from pages import DOCS
from sensor_faults import CAMERA, KINDS

IN_ORDER = "in order"

# Share of invalid distances [-], times at which a fault begins, for which it lasts, in
# which it has to be named, and of motion in order [s], and speeds of the arms [rad/s].
INVALID, BEGIN, LASTS, IN_TIME, MINUTE = 0.1, (1.0, 2.0), 1.5, 1.0, 60.0
SPEEDS = (1.0, 2.0)

BEGINNING, END = "<!-- campaign -->\n", "<!-- end of campaign -->"


def episode(kind: str, seed: int) -> Episode:
    """A fault of a kind: what is named, and when; or a minute without one."""
    rng = np.random.default_rng(seed)
    one = KINDS.get(kind)
    scene = sensed_bay(
        zones=one is None or not one.camera, camera=one is None or one.camera
    )
    sense, rig = ag.Sense(scene), Rig(scene, seed=seed)
    rig.invalid = INVALID
    motion, start = swing(scene, rng.uniform(*SPEEDS)), rng.uniform(*BEGIN)
    found: dict[tuple[str, str], float] = {}

    def each(t: float, _: str) -> None:
        for name, health in sense.health.items():
            for fault in health.faults:
                found.setdefault((name, fault.name), t)

    drive(sense, rig, motion, MINUTE if one is None else start, each=each)
    names = [n for n in scene.sensors if n != CAMERA] or [CAMERA]
    at_fault: tuple[str, ...] = ()
    false, named = len(found), dict[tuple[str, str], float]()
    if one is not None:
        injected = one.make(scene, names[rng.integers(len(names))], rng)
        rig.truth.update(injected.mounts)
        at_fault, before = injected.at_fault, set(found)
        tamper, changes = noted(injected.tamper)

        def go_on(seconds: float, since: float) -> None:
            drive(
                sense, rig, motion, seconds, start=since, each=each,
                tamper=tamper,
            )  # fmt: skip

        go_on(LASTS, start)
        if changes:
            # Until then the fault had no effect.
            go_on(changes[0] - start, start + LASTS)
            start = max(start, changes[0])
        elif tamper is not None:
            raise LeftOut("no frame was changed")
        later = {key: t for key, t in found.items() if key not in before}
        named = {key: t for key, t in later.items() if key[0] in at_fault}
        false += len(later) - len(named)
    expected = {fault.name for fault in one.named} if one is not None else set()
    first = min(named.values(), default=np.inf) - start
    return {
        "seed": seed,
        "at_fault": at_fault,
        "named": sorted({fault for _, fault in named}),
        "seconds": float(first) if named else None,
        "in_time": bool(first <= IN_TIME),
        "right": any(fault in expected for _, fault in named),
        "false": false,
    }


def noted(change: Tamper | None) -> tuple[Tamper | None, list[float]]:
    """A fault in frames, and a list that gets the times of those that it changes."""
    changes: list[float] = []
    if change is None:
        return None, changes

    def tamper(sensor: str, measured: float, *frame: Any) -> Sent:
        sent = change(sensor, measured, *frame)
        same = sent is not None and all(map(is_, sent, frame))
        changes.extend(() if same else (measured,))
        return sent

    return tamper, changes


def summed_up(kind: str, episodes: list[Episode]) -> Figures:
    """Figures of episodes; the longest time is of faults that were named."""
    known = [e["seconds"] for e in episodes if e["seconds"] is not None]
    return {
        "episodes": len(episodes),
        "named": len(known),
        **{name: sum(e[name] for e in episodes) for name in ("in_time", "right")},
        "false": sum(e["false"] for e in episodes),
        "longest_s": max(known, default=0.0),
    }


@cache
def version(kind: str) -> str:
    """Hash of the code of sensing, of the faults and of the motion."""
    whole = sha256(kind.encode())
    files = sorted(Path(str(sensing.__file__)).parent.glob("*.py"))
    for module in (sensor_faults, sensed):
        files.append(Path(str(module.__file__)))
    for path in files:
        whole.update(ast.dump(ast.parse(path.read_text(encoding="utf-8"))).encode())
    return whole.hexdigest()[:16]


def page(results: Mapping[str, Figures]) -> str:
    """The page, with a table of what is known."""
    rows = [
        "| fault | times | named within 1 s | named later or never | as this fault "
        "| longest [s] | false names of others |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for kind, f in results.items():
        n = f["episodes"]
        if kind == IN_ORDER:
            rows.append(f"| {kind}, minutes | {n} | - | - | - | - | {f['false']} |")
            continue
        left_out = sum(f["left_out"].values())
        times = f"{n} of {n + left_out}" if left_out else n
        rows.append(
            f"| {kind} | {times} | {f['in_time']} | {n - f['in_time']} | {f['right']} "
            f"| {f['longest_s']:.2f} | {f['false']} |"
        )
    text = (DOCS / "sensor_faults.md").read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGINNING)
    table = "\n".join((*rows, ""))
    return f"{before}{BEGINNING}{table}{END}{rest.partition(END)[2]}"


CAMPAIGN = Campaign(
    results=DOCS / "sensor_faults.json",
    kinds={kind: partial(episode, kind) for kind in (*KINDS, IN_ORDER)},
    version=version,
    extreme={"longest_s": max},
    summed_up=summed_up,
    digest=lambda e: Digest(
        e["seed"], " ".join(e["named"]), e["seconds"], {"false": e["false"]}
    ),
    is_broken=lambda f: f["false"] > 0,
    is_notable=lambda e: e["false"] > 0 or (bool(e["at_fault"]) and not e["in_time"]),
    count=50,
    shares={IN_ORDER: 1.2},
    written=25,
    page=page,
)  # fmt: skip


if __name__ == "__main__":
    sys.exit(CAMPAIGN.main(__doc__))
