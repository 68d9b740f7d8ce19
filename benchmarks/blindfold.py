"""Arms under two cameras, of which one is blindfolded for a while.

Part of `make sense-campaign`. Each camera looks at one arm of the bay. An operator
moves both arms to and fro through the filter, lets go after a stop and tries again.
The others are compared with the same motion without a blindfold.
"""

import heapq
from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

import armguard as ag
from armguard.scene.bay import bay_scene
from armguard.scene.compile import compile_scene
from armguard.simulation.sensed import STEP, TRANSPORT, sensed_bay
from armguard.simulation.sensors import Rig
from closed_loop.judge import Judge

Floats = NDArray[np.float64]

# Times of a run: of the blindfold, and of its end; and where speeds are compared [s].
SETTLED, BLIND, SEES, END = 1.0, 4.0, 7.0, 11.0
WHILE, AFTER = (BLIND + 0.5, SEES), (SEES + 1.5, END)

# Desired speed [rad/s], and cycles after which the operator lets go of an arm that does
# not move, and before the next try.
SPEED, LETS_GO = 0.2, 10

# Times of the motion and points at each of them at which the view is compared.
LOOKS, POINTS = 12, 400

# How the camera fails: all of its distances are invalid, or it sends no frames.
KINDS = ("dark", "silent")

ARMS, BLINDED = ("left", "right"), "over_right"


def two_cameras() -> ag.Scene:
    """The bay with a camera above each arm."""
    scene = sensed_bay(zones=False, camera=False)
    scene.set_sensing(
        region={"centre": (-0.4, 0, 1.1), "size": 128}, cell=0.025, unknown="still",
        intruder={"speed": 1.6, "size": 0.05},
        start={"clear": 0.2, "reason": "the operator has looked"},
    )  # fmt: skip
    for name, y in (("over_left", 0.7), (BLINDED, -0.7)):
        scene.add_sensor(
            name, kind="depth", size=(160, 120), focal=100, range=(0.3, 3.0),
            pose=ag.Pose(xyz=(-0.4, y, 2.3), rpy=(np.pi, 0, 0)),
        )  # fmt: skip
    return scene


class Run:
    """One run; shares of the desired speed by time, and the travel while blind.

    Args:
        kind: One of `KINDS`; None for no blindfold.
        seed: Seed of the motion.
    """

    def __init__(self, kind: str | None, seed: int) -> None:
        self._kind, self._scene = kind, two_cameras()
        self._guard = ag.Guard(self._scene, self_test=False)
        self._sense = ag.Sense(self._scene, self._guard)
        self._rig, self._rng = Rig(self._scene, seed=seed), np.random.default_rng(seed)
        self._past: deque[tuple[float, Floats]] = deque(maxlen=60)
        self._due = [
            (sensor.period * (0.3 + 0.61 * k), name)
            for k, (name, sensor) in enumerate(self._scene.sensors.items())
        ]
        names = self._guard.q_names
        self._own = [np.array([n.startswith(arm) for n in names]) for arm in ARMS]
        self.times, self.shares = self._drive()

    def _drive(self) -> tuple[Floats, Floats]:
        q, v = self._scene.home.copy(), np.zeros(len(self._scene.home))
        phase = self._rng.uniform(0.0, 6.3, len(q))
        wait, still = [0, 0], [0, 0]
        times, shares = [], []
        for k in range(round(END / STEP)):
            t = (k + 1) * STEP
            self._past.append((t, q.copy()))
            self._sense.joints(q, t)
            self._see(t)
            wanted = SPEED * np.cos(1.3 * t + phase) * (t > SETTLED)
            given = wanted.copy()
            for arm, own in enumerate(self._own):
                given[own] *= wait[arm] == 0
                wait[arm] = max(wait[arm] - 1, 0)
            command = self._guard.filter(q, given, t, velocity=v)
            v = command.velocity.copy()
            q = q + STEP * v
            share = [float(np.abs(v[own]).sum()) for own in self._own]
            for arm, own in enumerate(self._own):
                stopped = share[arm] < 0.05 * np.abs(given[own]).sum()
                still[arm] = still[arm] + 1 if stopped else 0
                if still[arm] > LETS_GO:
                    wait[arm], still[arm] = LETS_GO, 0
            times.append(t)
            shares.append([*share, *(np.abs(wanted[own]).sum() for own in self._own)])
        return np.array(times), np.array(shares)

    def _see(self, t: float) -> None:
        """Send the frames that are due."""
        while self._due[0][0] + TRANSPORT + self._delay(self._due[0][1]) <= t:
            measured, name = heapq.heappop(self._due)
            period = self._scene.sensors[name].period
            heapq.heappush(self._due, (measured + period, name))
            _, q = min(self._past, key=lambda past: abs(past[0] - measured))
            distance = self._rig.read(name, q).distance
            fails = name == BLINDED and BLIND < measured <= SEES
            if fails and self._kind == "silent":
                continue
            if fails and self._kind == "dark":
                distance = np.full_like(distance, np.nan)
            self._sense.depth(name, distance, measured + self._delay(name))

    def _delay(self, name: str) -> float:
        return self._scene.sensors[name].delay

    def share(self, arm: int, first: float, last: float) -> float:
        """Share of the desired way of an arm between two times [-]."""
        chosen = (self.times > first) & (self.times <= last)
        done, wanted = self.shares[chosen][:, [arm, arm + 2]].sum(axis=0)
        return float(done / wanted)

    def back(self) -> float:
        """Time after the blindfold until the right arm has half of its speed [s]."""
        moves = self.shares[:, 1] > 0.5 * self.shares[:, 3]
        again = self.times[moves & (self.times > SEES)]
        return float(again[0] - SEES) if len(again) else np.inf

    def way(self) -> float:
        """Way of the right arm from half a second after the blindfold on [rad]."""
        chosen = (self.times > WHILE[0]) & (self.times <= WHILE[1])
        return float(STEP * self.shares[chosen, 1].sum())


def seen_alone(seed: int) -> float:
    """Share of the space beside the left arm that the right camera alone sees [-].

    Of random points 10 to 100 mm off its links on the desired way, by MuJoCo's rays.

    Args:
        seed: Seed of the motion.
    """
    scene, bare = two_cameras(), bay_scene("path")
    rig, judge = Rig(scene), Judge(bare, compile_scene(bare))
    n, rng = len(scene.home), np.random.default_rng(1)
    phase = np.random.default_rng(seed).uniform(0.0, 6.3, n)
    left = [g for g, owner in enumerate(judge.owners) if owner.startswith("left/")]
    alone = total = 0
    for t in np.linspace(*WHILE, LOOKS):
        turned = np.sin(1.3 * t + phase) - np.sin(1.3 * SETTLED + phase)
        q = scene.home + SPEED / 1.3 * turned
        judge.place(q)
        g = rng.choice(left, POINTS)
        size = judge.model.geom_size[g]
        axes = judge.data.geom_xmat[g].reshape(-1, 3, 3)[:, :, 2]
        off = rng.normal(size=(POINTS, 3))
        off /= np.linalg.norm(off, axis=1)[:, None]
        points = (
            judge.data.geom_xpos[g]
            + axes * (rng.uniform(-1, 1, POINTS) * size[:, 1])[:, None]
        )
        points += off * (size[:, 0] + rng.uniform(0.01, 0.1, POINTS))[:, None]
        others, own = (sees(rig, scene, name, q, points) for name in scene.sensors)
        alone += int((own & ~others).sum())
        total += POINTS
    return alone / total


def sees(
    rig: Rig, scene: ag.Scene, name: str, q: Floats, points: Floats
) -> NDArray[np.bool_]:
    """Which points a camera sees, shape (n,)."""
    sensor = scene.sensors[name]
    T = sensor.pose.matrix()
    local = (points - T[:3, 3]) @ T[:3, :3]
    rays = local / np.linalg.norm(local, axis=1)[:, None]
    ends = np.abs(local[:, :2] / local[:, 2:]) < np.tan(0.5 * np.array(sensor.view))
    free = rig.look(name, q, rays) >= local[:, 2]
    return np.asarray(free & ends.all(axis=1) & (local[:, 2] > 0.0))


def measure(runs: int) -> list[dict[str, Any]]:
    """A row for each way to fail.

    Args:
        runs: Runs of each, with motions of their own.
    """
    free = [Run(None, seed) for seed in range(runs)]
    alone = max(seen_alone(seed) for seed in range(runs))
    rows = []
    for kind in KINDS:
        blind = [Run(kind, seed) for seed in range(runs)]
        row: dict[str, Any] = {"kind": kind, "runs": runs, "alone": alone}
        for arm, name in enumerate(ARMS):
            for part, (first, last) in {"while": WHILE, "after": AFTER}.items():
                shares = [
                    [one.share(arm, first, last) for one in s] for s in (blind, free)
                ]
                mine, other = np.mean(shares, axis=1)
                row[f"{name}_{part}"] = float(mine / other)
        row["way"] = max(one.way() for one in blind)
        row["back"] = [one.back() for one in blind]
        rows.append(row)
    return rows


def table(rows: list[dict[str, Any]]) -> str:
    """The rows as a table of the page."""
    lines = [
        "| right camera | runs | seen by it alone | left arm meanwhile | "
        "right arm meanwhile [rad] | right arm moves again after, median and longest "
        "[s] | left, right arm later |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in rows:
        back = row["back"]
        lines.append(
            f"| {row['kind']} | {row['runs']} | {100 * row['alone']:.1f} % "
            f"| {row['left_while']:.2f} | "
            f"{row['way']:.4f} | {np.median(back):.2f}, {max(back):.2f} | "
            f"{row['left_after']:.2f}, {row['right_after']:.2f} |"
        )
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    print(table(measure(2)))
