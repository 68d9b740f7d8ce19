"""Rates of the checker beside Pinocchio with Coal, on Pandas among balls and boxes.

    python benchmarks/batch_rates.py [panda_59_spheres.json] [--alone] [--json]

The file names links with spheres (x, y, z, radius) and joints with their frames.
Without it only the Panda of our own fit is measured. `--alone` leaves out the peers.
"""

import json
from collections.abc import Callable
from itertools import combinations
from pathlib import Path
from time import perf_counter_ns
from typing import Any

import numpy as np
from numpy.typing import NDArray

import armguard as ag
from armguard.robot.model import CollisionElement, Joint, JointKind, Link, RobotModel
from armguard.scene.compile import compile_scene
from episodes.campaign import command
from peers.pinocchio_coal import AllDistances, BroadPhase
from timing import quiet

Floats = NDArray[np.float64]

# Calls by name, each with the number of its rows.
Calls = dict[str, tuple[Callable[[], object], int]]

ROWS = 20_000
MOTIONS = 320
PEER_ROWS = 500
ROUNDS = 40

# Balls and boxes of each scene.
SCENES = {"nothing": (0, 0), "14 balls": (14, 0), "14 balls, 21 boxes": (14, 21)}

# Balls of a large scene, which fill a shell round the robot [m].
MANY = 10_000
SHELL = (0.9, 3.0)

MARGINS = (0.01, 0.02, 0.05, 0.1, 0.2, np.inf)


def panda(path: Path) -> RobotModel:
    """The robot of a file."""
    given = json.loads(path.read_text())
    links = {}
    for name, balls in given["links"].items():
        elements = [
            CollisionElement(
                geometry=ag.Sphere(radius=ball[3]),
                T_link_geometry=ag.Pose(xyz=tuple(ball[:3])).matrix(),
            )
            for ball in balls
        ]
        links[name] = Link(name=name, collisions=tuple(elements))
    joints = {
        one["name"]: Joint(
            name=one["name"],
            kind=JointKind(one["type"]),
            parent=one["parent"],
            child=one["child"],
            T_parent_joint=ag.Pose(xyz=one["xyz"], rpy=one["rpy"]).matrix(),
            axis=np.array(one.get("axis") or (0.0, 0.0, 1.0)),
            lower=one.get("lo") or 0.0,
            upper=one.get("hi") or 0.0,
        )
        for one in given["joints"]
    }
    return RobotModel(
        name="panda", path=None, links=links, joints=joints, root="panda_link0"
    )


def ring_scene(robot: RobotModel | str, balls: int, boxes: int) -> ag.Scene:
    """A robot among balls and boxes, 0.55 to 1.1 m from its base."""
    rng = np.random.default_rng(0)
    scene = ag.Scene(mode="fixed", buffer=0.0)
    scene.add_robot(robot, name="panda")
    for k in range(balls + boxes):
        angle, far, height = rng.uniform((0.0, 0.55, 0.0), (2.0 * np.pi, 1.1, 1.2))
        shape = ag.Sphere(radius=0.06) if k < balls else ag.Box(size=(0.1, 0.08, 0.12))
        place = (far * np.cos(angle), far * np.sin(angle), height)
        scene.add(shape, name=f"item{k}", pose=ag.Pose(xyz=place))
    return scene


def large_scene(robot: RobotModel | str) -> ag.Scene:
    """A robot among 35 items near it and many balls farther away."""
    scene, rng = ring_scene(robot, 14, 21), np.random.default_rng(2)
    way = rng.normal(size=(MANY, 3))
    way *= rng.uniform(*SHELL, (MANY, 1)) / np.linalg.norm(way, axis=1)[:, None]
    way[:, 2] += 0.5
    for k, place in enumerate(way):
        pose = ag.Pose(xyz=tuple(place))
        scene.add(ag.Sphere(radius=0.02), name=f"far{k}", pose=pose)
    return scene


def without_own_links(scene: ag.Scene) -> ag.Scene:
    """The scene, with all contacts between the robot's links allowed."""
    links = compile_scene(scene).body_names
    for a, b in combinations(
        sorted(n for n in set(links) if n.startswith("panda/")), 2
    ):
        scene.allow(a, b, reason="measured without")
    return scene


def clear_motions(checker: ag.Checker, home: Floats | None) -> Floats:
    """Rows of clear motions of 64: of 1.8 rad anywhere, or of 0.5 rad about home."""
    rng = np.random.default_rng(1)
    lower, upper = checker.lower, checker.upper
    joints, length = len(lower), 1.8 if home is None else 0.5
    begin = rng.uniform(lower, upper, (4 * MOTIONS, joints))
    if home is not None:
        begin = home + rng.normal(0.0, 0.15, begin.shape) * (upper - lower > 1.0)
    way = rng.normal(size=begin.shape) * (upper - lower > 1.0)
    way *= length / np.linalg.norm(way, axis=1)[:, None]
    end = begin + way
    inside = ((end >= lower) & (end <= upper)).all(axis=1)
    share = np.linspace(0.0, 1.0, 64)[:, None]
    motions = begin[inside, None] + share * way[inside, None]
    clear = checker.clear(motions.reshape(-1, joints)).reshape(-1, 64).all(axis=1)
    return motions[clear][:MOTIONS].reshape(-1, joints)


def best_times(calls: Calls, rounds: int = ROUNDS) -> dict[str, float]:
    """Nanoseconds a row of calls and their rows: the best of rounds in turns."""
    best = dict.fromkeys(calls, float("inf"))
    for call, _ in calls.values():
        call()
    for _ in range(rounds):
        for name, (call, count) in calls.items():
            start = perf_counter_ns()
            call()
            best[name] = min(best[name], (perf_counter_ns() - start) / count)
    return best


def rates(scene: ag.Scene) -> dict[str, dict[str, float]]:
    """Times of a scene's rows [ns], by where the rows are."""
    checker, two = ag.Checker(scene), ag.Checker(scene, threads=2)
    rng, joints = np.random.default_rng(1), len(checker.lower)
    kinds = {
        "random": rng.uniform(checker.lower, checker.upper, (ROWS, joints)),
        "motions": clear_motions(checker, None),
        "about home": clear_motions(checker, np.asarray(scene.home)),
    }
    found = {}
    for kind, q in kinds.items():
        calls: Calls = {
            "clear": (lambda q=q: checker.clear(q), len(q)),
            "distances": (lambda q=q: checker.distances(q), len(q)),
            "distances to 0.1 m": (lambda q=q: checker.distances(q, 0.1), len(q)),
        }
        if kind != "random":
            ways = q.reshape(-1, 64, joints)
            starts, ends = ways[:, 0], ways[:, -1]
            rows = ways[:32, :-1].reshape(-1, joints), ways[:32, 1:].reshape(-1, joints)
            calls |= {
                "prove, a motion": (
                    lambda a=starts, b=ends: checker.prove(a, b),
                    len(ways),
                ),
                "prove, a row of a plan": (
                    lambda rows=rows: checker.prove(*rows),
                    len(rows[0]),
                ),
            }
        with quiet():
            found[kind] = best_times(calls)
        # Threads that start in `quiet` would share its one core.
        more = {"clear, two threads": (lambda q=q: two.clear(q), len(q))}
        found[kind] |= best_times(more)
    return found


def by_margin(scene: ag.Scene) -> dict[str, float]:
    """Times of `distances` along motions, by margin [ns a row]."""
    checker = ag.Checker(scene)
    q = clear_motions(checker, None)
    with quiet():
        return best_times(
            {f"{m:g}": (lambda m=m: checker.distances(q, m), len(q)) for m in MARGINS}
        )


def peer_rates(scene: ag.Scene) -> dict[str, float]:
    """Times of the peers in random configurations [ns]."""
    tables = compile_scene(scene)
    rng = np.random.default_rng(1)
    q = rng.uniform(tables.lower, tables.upper, (PEER_ROWS, len(tables.lower)))
    calls = {
        peer.name: (lambda step=peer.step: [step(one) for one in q], len(q))
        for peer in (AllDistances(tables), BroadPhase(tables))
    }
    with quiet():
        return best_times(calls)


def measure(robots: dict[str, RobotModel | str], *, peers: bool) -> dict[str, Any]:
    """All figures, by robot and scene."""
    found: dict[str, Any] = {}
    for name, robot in robots.items():
        for scene, (balls, boxes) in SCENES.items():
            found[f"{name}, {scene}"] = rates(ring_scene(robot, balls, boxes))
        bare = without_own_links(ring_scene(robot, 14, 21))
        found[f"{name}, 14 balls, 21 boxes, own links left out"] = rates(bare)
        found[f"{name}, {MANY} balls more"] = rates(large_scene(robot))
        found[f"{name}, by margin"] = by_margin(ring_scene(robot, 14, 21))
        found[f"{name}, by margin, own links left out"] = by_margin(bare)
        # Pinocchio has no joint for the finger that follows the other.
        if peers and isinstance(robot, RobotModel):
            found[f"{name}, peers"] = peer_rates(ring_scene(robot, 14, 21))
    return found


def robots_of(files: list[str]) -> dict[str, RobotModel | str]:
    """The robots: that of a file if one is given, and that of our own fit."""
    found: dict[str, RobotModel | str] = {}
    if files:
        found["spheres"] = panda(Path(files[0]))
    return found | {"own fit": "panda"}


def main() -> None:
    """Print nanoseconds a row, the best of some rounds."""
    parser = command(__doc__)
    parser.add_argument("files", nargs="*", metavar="FILE", help="robots of spheres")
    parser.add_argument("--alone", action="store_true", help="no peers")
    parser.add_argument("--json", action="store_true")
    chosen = parser.parse_args()
    found = measure(robots_of(chosen.files), peers=not chosen.alone)
    if chosen.json:
        print(json.dumps(found, indent=1))
        return
    for name, kinds in found.items():
        print(name)
        for kind, times in kinds.items():
            row = times if isinstance(times, dict) else {"": times}
            print(f"  {kind:12}", ", ".join(f"{k} {v:.1f}" for k, v in row.items()))


if __name__ == "__main__":
    main()
