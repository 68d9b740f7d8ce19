"""Two arms of one kind over a table: from a URDF to a guarded loop.

    python examples/first_hour/first_hour.py so100        # one arm, step by step
    python examples/first_hour/first_hour.py              # all nine, as a table

Each arm gets a scene of six lines. `armguard check` accepts it, or names the line that
it lacks; that line is pasted, as you would do it. Then a loop drives the left arm until
the guard limits it. The scene files stay: edit them for your cell.
"""

import json
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from ruamel.yaml import YAML

import armguard as ag
from armguard.robot.named import robots_folder

RATE = 50  # cycles of the loop in a second [Hz]
SECONDS = 4  # duration of the loop [s]
PACKAGE = "example-robot-data"


@dataclass(frozen=True)
class Arm:
    """An arm whose files are in the package example-robot-data.

    Attributes:
        urdf: Its URDF, in the folder `robots` of the package.
        apart: Distance between the two bases [m].
        joint: Joint of the left arm that the loop drives.
        speed: Desired velocity of the joint [rad/s].
        srdf: Its SRDF, "" if none is needed.
    """

    urdf: str
    apart: float
    joint: str
    speed: float
    srdf: str = ""


ARMS = {
    "kinova": Arm(
        "kinova_description/robots/kinova.urdf", 0.9, "j2s6s200_joint_2", 0.6
    ),
    "panda": Arm(
        "panda_description/urdf/panda.urdf",
        1.2,
        "panda_joint2",
        1.5,
        srdf="panda_description/srdf/panda.srdf",  # allows the closed fingers
    ),
    "so100": Arm("so_arm_description/urdf/so100.urdf", 0.9, "shoulder_lift", 1.0),
    "so101": Arm("so_arm_description/urdf/so101.urdf", 0.9, "elbow_flex", 1.5),
    "ur3": Arm("ur_description/urdf/ur3_robot.urdf", 1.2, "shoulder_lift_joint", 1.5),
    "ur5": Arm("ur_description/urdf/ur5_robot.urdf", 2.0, "shoulder_lift_joint", 1.5),
    "ur10": Arm("ur_description/urdf/ur10_robot.urdf", 2.8, "shoulder_lift_joint", 1.5),
    "xarm7": Arm("xarm_description/urdf/xarm7.urdf", 1.2, "joint2", 1.5),
    "z1": Arm("z1_description/urdf/z1.urdf", 1.0, "joint2", 1.5),
}


@dataclass(frozen=True)
class Hour:
    """From the URDF to the guarded loop.

    Attributes:
        file: The scene file, with the pasted lines.
        lines: Number of lines that you write and paste, one for each robot.
        first: Findings of the first check.
        last: Findings of the last check.
        pasted: Lines that the first check named.
        seconds: Duration of the first check, fits of the links included [s].
        path: Joint positions in each cycle of the loop, shape (cycles + 1, n).
        said: Time [s] and sentence of the guard at each change of its level.
    """

    file: Path
    lines: int
    first: list[dict[str, Any]]
    last: list[dict[str, Any]]
    pasted: list[str]
    seconds: float
    path: np.ndarray
    said: list[tuple[float, str]]


def scene_text(arm: Arm) -> str:
    """A scene of two arms, face to face, over a table."""
    files = f"urdf: {PACKAGE}/robots/{arm.urdf}"
    files += f", srdf: {PACKAGE}/robots/{arm.srdf}" if arm.srdf else ""
    size, middle = round(arm.apart + 0.6, 3), arm.apart / 2
    return f"""\
cycle: {{period: {1 / RATE}}}
robots:
  left: {{{files}}}
  right: {{{files}, base: {{xyz: [{arm.apart}, 0, 0], rpy: [0, 0, 3.1416]}}}}
objects:
  table: {{box: [{size}, 1.2, 0.05], at: {{xyz: [{middle}, 0, -0.045]}}}}
"""


def check(file: Path) -> list[dict[str, Any]]:
    """Findings of `armguard check`."""
    command = [sys.executable, "-m", "armguard", "check", str(file), "--json"]
    printed = subprocess.run(command, check=False, stdout=subprocess.PIPE).stdout
    findings: list[dict[str, Any]] = json.loads(printed)["findings"]
    return findings


def failures(findings: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Findings that keep the scene from being guarded."""
    return [row for row in findings if row["status"] == "FAIL" or row["blocks"]]


def paste(file: Path, findings: list[dict[str, Any]]) -> list[str]:
    """Write the lines that the check named below their keys; returns them."""
    yaml, lines = YAML(), []
    yaml.width = 10_000
    scene = yaml.load(file)
    for row in failures(findings):
        place = scene
        for key in row["keys"]:
            place = place[key]
        place.update(YAML(typ="safe").load(row["paste"]))
        lines.append(row["paste"])
    yaml.dump(scene, file)
    return lines


def drive(scene: ag.Scene, arm: Arm) -> tuple[np.ndarray, list[tuple[float, str]]]:
    """Drive one joint of the left arm; see `path` and `said` of `Hour`."""
    guard = ag.Guard(scene)
    q, v = guard.home, 0 * guard.home
    desired = {f"left/{arm.joint}": arm.speed}
    path, said, level = [q], [], None
    for cycle in range(SECONDS * RATE):
        command = guard.filter(q, desired, cycle / RATE, velocity=v)
        v = command.velocity  # send this; these arms follow exactly
        q = q + v / RATE  # your driver reads the positions instead
        path.append(q)
        if command.verdict.level is not level:
            level = command.verdict.level
            said.append((cycle / RATE, command.why))
    return np.array(path), said


def first_hour(name: str, folder: Path) -> Hour:
    """From the URDF to the guarded loop; the scene file is written into the folder."""
    arm, file = ARMS[name], folder / f"{name}.yaml"
    text, package = scene_text(arm), folder / PACKAGE
    if not package.exists():
        package.symlink_to(robots_folder().parent)
    file.write_text(text)
    start = time.perf_counter()
    first = last = check(file)
    seconds = time.perf_counter() - start
    pasted = []
    if failures(first):
        pasted = paste(file, first)
        last = check(file)
    path, said = drive(ag.load_scene(file), arm)
    lines = len("\n".join([text.rstrip(), *pasted]).splitlines())
    return Hour(file, lines, first, last, pasted, seconds, path, said)


def show(name: str, hour: Hour) -> None:
    """Print one arm, step by step."""
    arm = ARMS[name]
    print(scene_text(arm))
    print(f"$ armguard check {hour.file}    # {hour.seconds:.1f} s")
    show_verdict(hour.first)
    if hour.pasted:
        print(f"\n$ armguard check {hour.file}    # the line is pasted")
        show_verdict(hour.last)
    print(
        f"\nloop at {RATE} Hz, desired velocity of left/{arm.joint}: {arm.speed} rad/s"
    )
    for seconds, sentence in hour.said:
        print(f"{seconds:6.2f} s  {sentence}")
    print(f"\nnext: armguard serve {hour.file} --rate {RATE} --view")


def show_verdict(findings: list[dict[str, Any]]) -> None:
    """Print failures, each with its line, and the verdict."""
    robots: dict[tuple[str, str, str], list[str]] = {}
    for row in failures(findings):
        sentence = row["sentence"].partition("': ")[2] or row["sentence"]
        like = (f"{row['status']} {sentence}", row["remedy"], row["paste"])
        robots.setdefault(like, []).append(".".join(row["keys"]))
    for (sentence, remedy, line), places in robots.items():
        print(
            f"{sentence}\n  -> {remedy}; write under {', '.join(places)}:\n     {line}"
        )
    print("NOT READY" if robots else "READY")


def row_of(name: str, hour: Hour) -> str:
    """One arm as a row of the table."""
    lines = dict.fromkeys(hour.pasted)
    said = "names the line" if lines else "READY"
    line = "<br>".join(f"`{line}`" for line in lines) or "-"
    return f"| {name} | {hour.lines} | {said} | {line} | {hour.seconds:.1f} s |"


def main(names: list[str]) -> int:
    """Guard the named arms, or all; 0 if each was guarded."""
    folder = Path(tempfile.mkdtemp(prefix="first-hour-"))
    if len(names) == 1:
        hours = [first_hour(names[0], folder)]
        show(names[0], hours[0])
    else:
        print("| arm | lines | first check | line to paste | duration |")
        print("| --- | --- | --- | --- | --- |")
        hours = []
        for name in names or ARMS:
            hours.append(first_hour(name, folder))
            print(row_of(name, hours[-1]), flush=True)
        print(f"\nscene files: {folder}")
    return int(any(failures(hour.last) for hour in hours))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
