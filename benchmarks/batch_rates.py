"""Rates of the checker beside Pinocchio with Coal, on a Panda of spheres.

    python benchmarks/batch_rates.py panda_59_spheres.json [--alone]

The file names links with spheres (x, y, z, radius) and joints with their frames.
"""

import json
import sys
from pathlib import Path
from time import perf_counter_ns

import numpy as np

import armguard as ag
from armguard.robot.model import CollisionElement, Joint, JointKind, Link, RobotModel
from armguard.scene.compile import compile_scene
from peers.pinocchio_coal import AllDistances, BroadPhase
from timing import quiet

ROWS = 20_000
PEER_ROWS = 500
ROUNDS = 5


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


def ring_scene(path: Path) -> ag.Scene:
    """The robot among 14 balls and 21 boxes, 0.55 to 1.1 m from its base."""
    rng = np.random.default_rng(0)
    scene = ag.Scene(mode="fixed", buffer=0.0)
    scene.add_robot(panda(path), name="panda")
    for k in range(35):
        angle, far, height = rng.uniform((0.0, 0.55, 0.0), (2.0 * np.pi, 1.1, 1.2))
        shape = ag.Sphere(radius=0.06) if k < 14 else ag.Box(size=(0.1, 0.08, 0.12))
        place = (far * np.cos(angle), far * np.sin(angle), height)
        scene.add(shape, name=f"item{k}", pose=ag.Pose(xyz=place))
    return scene


def main() -> None:
    """Print nanoseconds a configuration, the best of some rounds."""
    scene = ring_scene(Path(sys.argv[1]))
    tables, checker = compile_scene(scene), ag.Checker(scene)
    rng = np.random.default_rng(1)
    anywhere = rng.uniform(tables.lower, tables.upper, (ROWS, len(tables.lower)))
    share = np.linspace(0.0, 1.0, 64)[:, None]
    ends = anywhere[: 2 * (ROWS // 64)].reshape(-1, 2, 1, len(tables.lower))
    motions = (ends[:, 0] + share * (ends[:, 1] - ends[:, 0]) * 0.3).reshape(
        -1, len(tables.lower)
    )
    peers = [AllDistances(tables), BroadPhase(tables)]
    print(f"{len(tables.kinds)} primitives, {tables.checkable_pairs} pairs; ns a row")
    for name, rows in (("anywhere", anywhere), ("motions", motions)):
        calls = {
            "clear": (checker.clear, rows),
            "distances": (checker.distances, rows),
            "distances to 0.1 m": (lambda q: checker.distances(q, 0.1), rows),
        }
        for peer in peers:
            calls[peer.name] = (
                lambda q, step=peer.step: [step(one) for one in q],
                rows[:PEER_ROWS],
            )
        for what, (call, q) in calls.items():
            best = np.inf
            with quiet():
                for _ in range(ROUNDS):
                    start = perf_counter_ns()
                    call(q)
                    best = min(best, (perf_counter_ns() - start) / len(q))
            print(f"{name:9} {what:28} {best:10.0f}")
        print(f"{name:9} share of clear rows {checker.clear(rows).mean():.2f}")


if __name__ == "__main__":
    main()
