"""Infrared sensors, capacitive pads, and the calibration of sensors.

make sensors-campaign                              as published, some minutes of a core
make sensors-campaign ARGS="--only infrared"       one part
make sensors-campaign ARGS="--share 0.01"          fewer trials, nothing is written

A part that is already in docs/sensors.json is not run again, unless it is named by
`--only`. Writes docs/sensors.json and the tables of docs/sense.md.
"""

import argparse
import json
from collections.abc import Callable
from typing import Any

import numpy as np

from pages import DOCS
from single_sensors import infrared, pads, postures

BEGIN, END = "<!-- sensors -->\n", "<!-- end of sensors -->"

FILE = DOCS / "sensors.json"

# Calibrations of each sensor.
SEEDS = 3


def calibrations(share: float) -> list[dict[str, Any]]:
    """Calibrations of a ring on an arm, and of a camera in the world."""
    count = max(round(share * SEEDS), 1)
    names = ("left_ring", "top")
    return [postures.calibration(name, seed) for seed in range(count) for name in names]


PARTS: dict[str, Callable[[float], Any]] = {
    "infrared": lambda share: {
        "given": infrared.given(round(share * 100_000)),
        "unknown": infrared.unknown(round(share * 100_000)),
        "approaches": infrared.approaches(round(share * 600)),
    },
    "pads": lambda share: pads.approaches(round(share * 1000)),
    "own": lambda share: pads.own_motion(share * 60.0),
    "calibrations": calibrations,
}


def table(found: dict[str, Any]) -> str:
    """The tables of the page."""
    rows = ["| quantity | target | measured |", "| --- | --- | --- |"]
    if "infrared" in found:
        one = found["infrared"]
        given, unknown, way = one["given"], one["unknown"], one["approaches"]
        rows += [
            f"| infrared, given material, {given['trials']} distances of 30 to 300 mm: "
            f"error of 99.7 % | 5 % | {given['worst_of_997']:.1%} |",
            f"| infrared, unknown material of 4 to 88 %, {unknown['trials']} signals: "
            f"farther than the truth by more than 3 σ | 0 | {unknown['farther']} |",
            f"| the same in {way['approaches']} approaches, {way['signals']} signals "
            f"| 0 | {way['farther']} |",
            "| infrared, after 40 mm of way to a body at 110 mm: error of 99.7 % "
            f"| 4 mm | {way['sigma3'] * 1e3:.1f} mm |",
        ]
    if "pads" in found:
        one = found["pads"]
        rows += [
            f"| capacitive, {one['approaches']} boxes of 100 mm at 20 to 300 mm/s: not "
            f"noticed before 80 mm | 0 | {one['below_80_mm']} (nearest "
            f"{one['least'] * 1e3:.0f} mm, median {one['median'] * 1e3:.0f} mm) |",
            "| their nearest point within the ball that is reported | all "
            f"| {one['within_the_ball']} |",
        ]
    if "own" in found:
        one = found["own"]
        rows.append(
            f"| capacitive, alarms in {one['minutes']:g} minutes of arms in motion, "
            f"{one['frames']} signals | 1 in an hour | {one['alarms']} |"
        )
    for name in ("left_ring", "top"):
        some = [o for o in found.get("calibrations", ()) if o["sensor"] == name]
        if some:
            lates = [abs(o["late"]) for o in some if o["late"] is not None]
            rows.append(
                f"| calibration of {name}, {len(some)} times 30 mm, 5° and 20 ms off, "
                f"24 postures: worst pose; worst delay of {len(lates)} "
                f"| 3 mm, 0.5°; 5 ms | {max(o['way'] for o in some) * 1e3:.2f} mm, "
                f"{np.degrees(max(o['turn'] for o in some)):.3f}°; "
                f"{max(lates, default=np.nan) * 1e3:.2f} ms |"
            )
    return "\n".join((*rows, ""))


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", choices=PARTS)
    parser.add_argument("--share", type=float, default=1.0)
    given = parser.parse_args()
    for name, part in PARTS.items():
        known = json.loads(FILE.read_text("utf-8")) if FILE.exists() else {}
        if name == (given.only or name) and (given.only or name not in known):
            found = part(given.share)
            if given.share < 1.0:
                print(table({name: found}))
                continue
            # Another part may have been written meanwhile.
            known = json.loads(FILE.read_text("utf-8")) if FILE.exists() else {}
            known[name] = found
            FILE.write_text(json.dumps(known, indent=1) + "\n", "utf-8")
    if given.share == 1.0:
        page = DOCS / "sense.md"
        known = json.loads(FILE.read_text("utf-8"))
        head, rest = page.read_text("utf-8").split(BEGIN)
        text = head + BEGIN + table(known) + END + rest.split(END)[1]
        page.write_text(text, "utf-8")
        print(table(known))


if __name__ == "__main__":
    main()
