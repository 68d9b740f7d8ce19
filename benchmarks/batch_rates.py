"""Rates of the checker beside Pinocchio with Coal, on a Panda of spheres.

    python benchmarks/batch_rates.py panda_59_spheres.json [--alone]

The file names links with spheres (x, y, z, radius) and joints with their frames.
`--alone` leaves out the peers.
"""

import json
import sys
from pathlib import Path
from time import perf_counter_ns

import numpy as np
from numpy.typing import NDArray

import armguard as ag
from armguard.robot.model import CollisionElement, Joint, JointKind, Link, RobotModel
from armguard.scene.compile import compile_scene
from armguard.scene.tables import SceneTables
from peers.pinocchio_coal import AllDistances, BroadPhase
from timing import quiet

Floats = NDArray[np.float64]

ROWS = 20_000
MOTIONS = 320
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


def clear_motions(
    checker: ag.Checker, tables: SceneTables, home: Floats | None
) -> Floats:
    """Rows of clear motions of 64: of 1.8 rad anywhere, or of 0.5 rad about home."""
    rng = np.random.default_rng(1)
    joints, length = len(tables.lower), 1.8 if home is None else 0.5
    begin = rng.uniform(tables.lower, tables.upper, (4 * MOTIONS, joints))
    if home is not None:
        begin = home + rng.normal(0.0, 0.15, begin.shape)
    way = rng.normal(size=begin.shape)
    way *= length / np.linalg.norm(way, axis=1)[:, None]
    end = begin + way
    inside = ((end >= tables.lower) & (end <= tables.upper)).all(axis=1)
    share = np.linspace(0.0, 1.0, 64)[:, None]
    motions = begin[inside, None] + share * way[inside, None]
    clear = checker.clear(motions.reshape(-1, joints)).reshape(-1, 64).all(axis=1)
    return motions[clear][:MOTIONS].reshape(-1, joints)


def main() -> None:
    """Print nanoseconds a configuration, the best of some rounds."""
    scene = ring_scene(Path(sys.argv[1]))
    tables, checker = compile_scene(scene), ag.Checker(scene)
    two = ag.Checker(scene, threads=2)
    rng = np.random.default_rng(1)
    kinds = {
        "anywhere": rng.uniform(tables.lower, tables.upper, (ROWS, len(tables.lower))),
        "motions": clear_motions(checker, tables, None),
        "about home": clear_motions(checker, tables, np.asarray(scene.home)),
    }
    peers = [AllDistances(tables), BroadPhase(tables)]
    print(f"{len(tables.kinds)} primitives, {tables.checkable_pairs} pairs; ns a row")
    for name, rows in kinds.items():
        calls = {
            "clear": (checker.clear, rows),
            "clear, two threads": (two.clear, rows),
            "distances": (checker.distances, rows),
            "distances to 0.1 m": (lambda q: checker.distances(q, 0.1), rows),
        }
        for peer in peers if "--alone" not in sys.argv else ():
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
            print(f"{name:10} {what:28} {best:10.0f}")
        print(f"{name:10} share of clear rows {checker.clear(rows).mean():.2f}")
        if name != "anywhere":
            show_proofs(name, checker, rows.reshape(-1, 64, rows.shape[1]))


def show_proofs(name: str, checker: ag.Checker, motions: Floats) -> None:
    """Print how long proofs take, of motions and of a plan of 32 motions' rows."""
    plan = motions[:32]
    joints = motions.shape[2]
    calls = {
        "prove, ns a motion": (motions[:, 0], motions[:, -1]),
        "prove, ns a row of a plan": (
            plan[:, :-1].reshape(-1, joints),
            plan[:, 1:].reshape(-1, joints),
        ),
    }
    for what, (starts, ends) in calls.items():
        best = np.inf
        with quiet():
            for _ in range(ROUNDS):
                start = perf_counter_ns()
                found = checker.prove(starts, ends)
                best = min(best, (perf_counter_ns() - start) / len(starts))
        print(f"{name:10} {what:28} {best:10.0f}, {found.proven.mean():.4f} proven")


if __name__ == "__main__":
    main()
