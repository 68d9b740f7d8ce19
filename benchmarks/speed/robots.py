"""`bench robots`: cycles of two arms of one kind over a table, beside their peers.

The states are those of a filtered drive: every joint sways at a share of its top
speed, and the guard limits it. `step` and the peers judge the same states again. The
rows in which `path` is slowest beside a peer come first.
"""

import re
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from armguard.errors import UnknownNameError
from armguard.geometry import Box, Pose
from armguard.guard import Level
from armguard.respond import Guard
from armguard.robot.named import find_named_robot, robots_folder
from armguard.scene import Scene, bay_scene, load_scene, load_trajectory
from arrays import Floats
from closed_loop.scenes import filled
from peers import Peer, available_peers
from timing import Progress, percentiles, quiet, time_calls

CYCLES = 2000

# Time between cycles [s]; shares of the joints' top speeds [-].
PERIOD = 4e-3
SHARES = (0.0, 0.25, 0.6, 1.0)

# Greatest amplitude of a joint [rad], and share of its range [-].
AMPLITUDE, RANGE = 0.35, 0.4

PASSES = 3

# Our own calls among the contestants.
OURS = ("filter", "path", "fixed")

# Robots of example-robot-data, and half the distance of their bases [m].
ARMS = {"panda": 0.55, "ur5": 1.0, "xarm7": 0.5, "so101": 0.45}

# The public planning scenes, beside the project; the row of a way into a shelf at which
# a finger is 21 mm from a can; and the buffer there [m].
PUBLIC = Path(__file__).parents[2].parent / "shared" / "motionbench"
SHELF = PUBLIC / "bookshelf_small_panda"
ROW = 3
BUFFER = 0.01

# Joints of a humanoid that are no arm's.
BELOW_ARMS = re.compile(
    r'(<joint name="\w*(?:hip|knee|ankle|waist)\w*" type=")revolute'
)


def scenes() -> dict[str, Any]:
    """Scenes by name, each a function of the mode."""
    found: dict[str, Any] = {"bay": bay_scene}
    for name, half in ARMS.items():
        found[name] = lambda mode, name=name, half=half: two_arms(name, half, mode)
    found |= {"baxter": baxter, "humanoids": humanoids}
    return found | ({"shelf": shelf} if SHELF.is_dir() else {})


def shelf(mode: str) -> Scene:
    """A Panda that reaches into a public shelf with cans; see `filled`."""
    bare = load_scene(SHELF / "scene0001.yaml")
    way = load_trajectory(SHELF / "path0001.csv")
    place = dict(zip(way.names, way.q[ROW].tolist(), strict=True))
    for robot in bare.robots.values():
        robot.home.update(place)
    return filled(Scene(mode=mode, buffer=BUFFER), bare, lambda name: {})


def baxter(mode: str) -> Scene:
    """A robot with two arms at a table."""
    scene = Scene(mode=mode)
    scene.add_robot("baxter", "baxter")
    table = Pose(xyz=(0.9, 0, -0.1))
    scene.add(Box(size=(0.8, 1.6, 0.04)), "table", pose=table)
    return scene


def humanoids(mode: str) -> Scene:
    """Two humanoids face to face at a table, whose legs and waists are fixed."""
    scene, half = Scene(mode=mode), 0.45
    text = BELOW_ARMS.sub(r"\1fixed", find_named_robot("g1").urdf.read_text())
    packages = {"example-robot-data": robots_folder().parent}
    with TemporaryDirectory() as folder:
        urdf = Path(folder, "g1_arms.urdf")
        urdf.write_text(text)
        for name, x, turn in (("left", -half, 0.0), ("right", half, np.pi)):
            base = Pose(xyz=(x, 0, 0), rpy=(0, 0, turn))
            scene.add_robot(urdf, name, base=base, packages=packages)
    scene.add(Box(size=(0.3, 1.2, 0.04)), "table", pose=Pose(xyz=(0, 0, -0.1)))
    return scene


def two_arms(name: str, half: float, mode: str) -> Scene:
    """Two arms face to face at a table with a post between them."""
    scene = Scene(mode=mode)
    scene.add_robot(name, "left", base=Pose(xyz=(-half, 0, 0)))
    scene.add_robot(name, "right", base=Pose(xyz=(half, 0, 0), rpy=(0, 0, np.pi)))
    table = Pose(xyz=(0, 0, -0.15))
    scene.add(Box(size=(3 * half, 2 * half, 0.04)), "table", pose=table)
    post = Pose(xyz=(0, half, 0.2))
    scene.add(Box(size=(0.06, 0.06, 0.4)), "post", pose=post)
    return scene


class Drive(NamedTuple):
    """States of a filtered drive and how long its cycles took.

    Attributes:
        q: Positions, shape (k, n) [rad or m].
        v: Velocities, shape (k, n) [rad/s or m/s].
        times: Durations of `Guard.filter`, shape (k,) [ns].
        tested: Pairs measured in a cycle, on average [-].
        levels: Cycles by level.
    """

    q: Floats
    v: Floats
    times: Floats
    tested: float
    levels: dict[str, int]


def drive(guard: Guard, share: float, cycles: int) -> Drive:
    """Drive all joints at a share of their top speeds, as far as the guard permits."""
    tables = guard.tables
    n = len(tables.home)
    top = np.concatenate([part.stopping.velocity for part in tables.robots])
    amplitude = np.minimum(AMPLITUDE, RANGE * (tables.upper - tables.lower))
    pace = share * top / amplitude * (0.6 + 0.4 * (np.arange(n) * 7 % 11) / 11)
    t = np.arange(cycles)[:, None] * PERIOD
    desired = amplitude * pace * np.cos(pace * t + 0.9 * np.arange(n))
    q, v = np.tile(tables.home, (cycles, 1)), np.zeros((cycles, n))
    times, tested = np.zeros(cycles), 0
    levels: dict[str, int] = {}
    for k in range(cycles):
        command = guard.filter(
            q[k], desired[k], k * PERIOD, velocity=v[k], now=k * PERIOD
        )
        times[k] = command.verdict.cycle_time * 1e9
        tested += command.verdict.counts.pairs_tested
        level = Level(command.verdict.level).name
        levels[level] = levels.get(level, 0) + 1
        if k + 1 < cycles:
            v[k + 1] = command.velocity
            q[k + 1] = q[k] + PERIOD * v[k + 1]
    return Drive(q, v, times, tested / cycles, levels)


def stepped(guard: Guard, found: Drive, paced: bool) -> Floats:
    """Durations of `Guard.step` for the states of a drive [ns]."""
    times = np.zeros(len(found.q))
    guard.reset()
    for k, (q, v) in enumerate(zip(found.q, found.v, strict=True)):
        if paced:
            verdict = guard.step(q, k * PERIOD, velocity=v, now=k * PERIOD)
        else:
            verdict = guard.step(q)
        times[k] = verdict.cycle_time * 1e9
    return times


def bench(cycles: int, progress: Progress, only: str | None = None) -> dict[str, Any]:
    """Durations by scene, speed and contestant; the slowest beside a peer first.

    Args:
        cycles: Cycles at each speed.
        progress: Called with a sentence before each scene and speed.
        only: Name of a scene; all if None.

    Raises:
        UnknownNameError: There is no such scene.
    """
    rows = []
    absent: set[str] = set()
    known = scenes()
    if only is not None and only not in known:
        raise UnknownNameError(f"no scene is named '{only}'; known: {', '.join(known)}")
    for name, scene in known.items() if only is None else [(only, known[only])]:
        progress(f"{name}: fitting and compiling")
        path, fixed = (
            Guard(timed(scene(mode)), self_test=False) for mode in ("path", "fixed")
        )
        found = list(available_peers(path.tables))
        absent |= {one for one in found if isinstance(one, str)}
        peers = [one for one in found if not isinstance(one, str)]
        for share in SHARES:
            progress(f"{name}: {cycles} cycles at {share:g} of the top speed")
            rows.append(
                {"scene": name, "share": share} | row(path, fixed, peers, share, cycles)
            )
    rows.sort(key=lambda one: one["path_over_peer"], reverse=True)
    return {
        "cycles": cycles,
        "period": PERIOD,
        "rows": rows,
        "not_installed": sorted(absent),
    }


def timed(scene: Scene) -> Scene:
    """A scene with the bench's period."""
    scene.period = PERIOD
    return scene


def row(
    path: Guard, fixed: Guard, peers: list[Peer], share: float, cycles: int
) -> dict[str, Any]:
    """Figures of one scene at one speed."""
    path.reset()
    states = drive(path, share, cycles)
    times: dict[str, list[Floats]] = {"filter": [states.times]}
    rows = [peer.positions(states.q) for peer in peers]
    with quiet():
        for _ in range(PASSES):
            path.reset()
            times["filter"].append(drive(path, share, cycles).times)
            times.setdefault("path", []).append(stepped(path, states, True))
            times.setdefault("fixed", []).append(stepped(fixed, states, False))
            for peer, own in zip(peers, rows, strict=True):
                times.setdefault(peer.name, []).append(time_calls(peer.step, own))
    figures = {name: percentiles(np.concatenate(own)) for name, own in times.items()}
    fastest = min(
        (figures[peer.name]["median_us"] for peer in peers), default=float("nan")
    )
    return {
        "pairs": path.tables.checkable_pairs,
        "tested": states.tested,
        "mean_share": float(
            np.abs(states.v).mean() / max(np.abs(states.v).max(), 1e-9)
        ),
        "levels": states.levels,
        "fastest_peer_us": fastest,
        "path_over_peer": figures["path"]["median_us"] / fastest,
        "fixed_over_peer": figures["fixed"]["median_us"] / fastest,
        # The least of the passes for each cycle: work, without the machine's noise.
        "longest_us": {
            name: float(np.min(times[name], axis=0).max() / 1e3) for name in OURS
        },
        "figures": figures,
    }
