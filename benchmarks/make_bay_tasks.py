"""Make the bay's three tasks from their keyframes, and check what is claimed of them.

    python benchmarks/make_bay_tasks.py            # write, check, print the table
    python benchmarks/make_bay_tasks.py --check    # write nothing; the files must agree

The files come out the same to the last byte everywhere: the speed profile is made of
parabolas and straight lines, and positions are rounded to a millionth of a radian. The
checks use pinocchio and coal (`bay_oracle.py`) and none of armguard's code.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from ruamel.yaml import YAML

from bay_oracle import ARMS, BAY, JOINTS, BayOracle, Floats, Nearest

# The paper's cycle [s].
PERIOD = 0.030

# Share of a keyframe spent gathering speed, and as much losing it [-].
RAMP = 0.25

# A keyframe: how many cycles it lasts, what the operator does, and, if any joints move,
# where those of each arm end up.
Keyframe = Sequence[Any]
FILE = Path(__file__).with_name("bay_keyframes.yaml")
KEYFRAMES = YAML(typ="safe", pure=True).load(FILE)
TASKS: Mapping[int, Sequence[Keyframe]] = {n: KEYFRAMES[n] for n in (150, 700, 2000)}

# What an arm is there to handle; all else that rests is a fixture.
HANDLED = ("oru_left", "oru_right", "battery", "tool")

# The kinds of approach each task has to have.
APPROACHES = {
    150: ("arm-fixture",),
    700: ("arm-arm",),
    2000: ("arm-fixture", "arm-object", "arm-arm"),
}

# The paper's highest speed, 24 in/s, taken as a bound for the tips [m/s].
TOP_SPEED = 0.61
# Surfaces never come nearer than this: the operator hits nothing [m].
LEAST_DISTANCE = 0.002
# All pairs farther apart than this is a clear cycle [m]; share that must be [-].
CLEAR = 0.080
CLEAR_SHARE = 0.60


def trapezoid(u: float) -> float:
    """Way done at the time `u` of a stretch from rest to rest, both in [0, 1]."""
    if u > 0.5:
        return 1.0 - trapezoid(1.0 - u)
    top = 1.0 / (1.0 - RAMP)
    return top * u * u / (2.0 * RAMP) if u < RAMP else top * (u - RAMP / 2.0)


def configurations(home: Floats, keyframes: Sequence[Keyframe]) -> Floats:
    """Positions at every cycle, rounded as in the file, shape (cycles, 14) [rad]."""
    rows, here = [], home
    for cycles, _, *moves in keyframes:
        goal = here.copy()
        for arm, joints in moves[0].items() if moves else ():
            for joint, position in joints.items():
                goal[ARMS.index(arm) * JOINTS + joint - 1] = position
        for k in range(1, cycles + 1):
            rows.append(here + trapezoid(k / cycles) * (goal - here))
        here = goal
    # Adding zero turns the negative zero that rounding makes into a plain one.
    return np.asarray(np.round(np.array(rows), 6) + 0.0, dtype=np.float64)


def csv_text(names: Sequence[str], q: Floats) -> str:
    """The text of a task's file."""
    lines = [",".join(("t", *names))]
    for k, row in enumerate(q):
        lines.append(",".join((f"{k * PERIOD:.2f}", *(f"{v:.6f}" for v in row))))
    return "\n".join(lines) + "\n"


def kind_of(pair: Nearest) -> str:
    """What approaches what; pairs of links of one arm are 'one arm'."""
    if "/" in pair.b:
        same = pair.a.split("/")[0] == pair.b.split("/")[0]
        return "one arm" if same else "arm-arm"
    return "arm-object" if pair.b in HANDLED else "arm-fixture"


class Findings:
    """What the oracle sees in a task.

    Args:
        oracle: The bay.
        q: Positions at every cycle, shape (cycles, 14) [rad].

    Attributes:
        nearest: Nearest pair of each cycle.
        closest: Nearest pair of the whole task, by the kind of approach.
        moving: Which joints move into each cycle, shape (cycles - 1, 14).
        tip_speed: Speeds of both tips, shape (cycles - 1, 2) [m/s].
        wrong: Claims that do not hold, one sentence each.
    """

    def __init__(self, oracle: BayOracle, q: Floats) -> None:
        self.buffer = float(oracle.scene["buffer"])
        measured = [oracle.measure(row) for row in q]
        self.nearest = [min(pairs, key=distance_of) for pairs in measured]
        self.closest: dict[str, Nearest] = {}
        for pair in (pair for pairs in measured for pair in pairs):
            known = self.closest.setdefault(kind_of(pair), pair)
            if pair.distance < known.distance:
                self.closest[kind_of(pair)] = pair
        self.moving = np.diff(q, axis=0) != 0.0
        tips = np.array([oracle.tips(row) for row in q])
        self.tip_speed = np.linalg.norm(np.diff(tips, axis=0), axis=2) / PERIOD
        self.wrong = self._check_motion(oracle, q) + self._check_distances(q)

    def _check_motion(self, oracle: BayOracle, q: Floats) -> list[str]:
        """Limits of joints and tips, and the bay's walls."""
        wrong = []
        model = oracle.model
        lower = np.tile(model.lowerPositionLimit, 2)
        upper = np.tile(model.upperPositionLimit, 2)
        if not ((q >= lower) & (q <= upper)).all():
            wrong.append("a joint leaves its limits")
        speed = np.abs(np.diff(q, axis=0)).max(axis=0) / PERIOD
        if not (speed <= np.tile(model.velocityLimit, 2)).all():
            wrong.append("a joint is faster than its limit")
        if not self.tip_speed.max() <= TOP_SPEED:
            wrong.append(
                f"a tip moves at {self.tip_speed.max():.2f} m/s; the bound is "
                f"{TOP_SPEED} m/s"
            )
        cube = oracle.scene["index"]["cube"]
        low = np.array(cube["centre"]) - cube["edge"] / 2
        boxes = np.array([oracle.bounds(row) for row in q])
        if (
            not (boxes[:, 0] >= low).all()
            or not (boxes[:, 1] <= low + cube["edge"]).all()
        ):
            wrong.append("a primitive leaves the bay")
        return wrong

    def _check_distances(self, q: Floats) -> list[str]:
        """Approaches there must be, contacts there must not be."""
        wrong = [
            f"no {kind} approach comes within the buffer"
            for kind in APPROACHES[len(q)]
            if not self.closest[kind].distance < self.buffer
        ]
        least = min(self.nearest, key=distance_of)
        if not least.distance > LEAST_DISTANCE:
            wrong.append(
                f"{least.a} and {least.b} are {least.distance * 1e3:.1f} mm apart; it "
                f"must be more than {LEAST_DISTANCE * 1e3:g} mm"
            )
        if not self.share_beyond(CLEAR) > CLEAR_SHARE:
            wrong.append(f"only {self.share_beyond(CLEAR):.0%} of the cycles are clear")
        return wrong

    def share_beyond(self, distance: float) -> float:
        """Share of the cycles in which all pairs are at least this far apart [-]."""
        return float(np.mean([pair.distance >= distance for pair in self.nearest]))

    def rows(self) -> list[tuple[str, str]]:
        """The findings as rows of a table."""
        count = self.moving.sum(axis=1)
        both = self.moving[:, :JOINTS].any(axis=1) & self.moving[:, JOINTS:].any(axis=1)
        moving_tips = self.tip_speed[self.tip_speed > 0.0]
        rows = [
            ("duration [s]", f"{(len(self.nearest) - 1) * PERIOD:.2f}"),
            ("cycles with one joint moving", f"{(count == 1).mean():.0%}"),
            ("cycles with both arms moving", f"{both.mean():.0%}"),
            ("cycles at rest", f"{(count == 0).mean():.0%}"),
            ("tip speed, median while it moves [m/s]", f"{np.median(moving_tips):.2f}"),
            ("tip speed, highest [m/s]", f"{self.tip_speed.max():.2f}"),
            ("cycles with all pairs ≥ 80 mm apart", f"{self.share_beyond(CLEAR):.0%}"),
            ("cycles within the buffer", f"{1.0 - self.share_beyond(self.buffer):.0%}"),
        ]
        for kind in ("arm-fixture", "arm-object", "arm-arm", "one arm"):
            pair = self.closest[kind]
            names = f"{pair.a}, {pair.b}"
            rows.append((f"nearest {kind} [mm]", f"{pair.distance * 1e3:.1f}: {names}"))
        return rows


def distance_of(pair: Nearest) -> float:
    """Signed distance of a pair [m]."""
    return pair.distance


def print_table(columns: dict[int, list[tuple[str, str]]]) -> None:
    """Markdown table, one column a task."""
    tasks = list(columns)
    print("| | " + " | ".join(f"{n} cycles" for n in tasks) + " |")
    print("| --- " * (len(tasks) + 1) + "|")
    for row in zip(*columns.values(), strict=True):
        print(f"| {row[0][0]} | " + " | ".join(cell for _, cell in row) + " |")


def main() -> int:
    """Write or compare the files; 1 if a file differs or a claim does not hold."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing")
    check = parser.parse_args().check
    oracle = BayOracle()
    columns, wrong = {}, []
    for cycles, keyframes in TASKS.items():
        q = configurations(oracle.home, keyframes)
        path, text = BAY / f"task_{cycles}.csv", csv_text(oracle.joint_names, q)
        if len(q) != cycles:
            wrong.append(f"task_{cycles}: the keyframes make {len(q)} cycles")
            continue
        if not check:
            path.write_bytes(text.encode())
        elif path.read_bytes() != text.encode():
            wrong.append(f"{path.name} differs from its keyframes; run without --check")
        findings = Findings(oracle, q)
        columns[cycles] = findings.rows()
        wrong += [f"{path.name}: {sentence}" for sentence in findings.wrong]
    print_table(columns)
    for sentence in wrong:
        print(sentence, file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
