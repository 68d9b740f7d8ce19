"""Other libraries asked about the same pairs: `ask(pair)` gives a signed distance.

`None` where the library has no such pair. A rounding is no shape of theirs: they are
asked about the sharp shape, and the rounding is taken off their answer. Coal and MuJoCo
have tolerances of 1e-12 and a thousand iterations; python-fcl, with 1e-6, offers no way
to set them. They are asked in processes of their own: they may hang or die, the
campaign not.
"""

import multiprocessing
import os
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from typing import Any

import coal
import fcl
import mujoco
import numpy as np

from accuracy.judge import NAMES, judge
from accuracy.regimes import REGIMES, Pair
from armguard.geometry import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    ShapeKind,
    Sphere,
)
from peers.mujoco_margin import GEOM, placed
from peers.shapes import along_z, coal_convex, outward_faces, peer_geometry

# Beyond this MuJoCo computes no distance [m].
FARTHEST = 1e9


def both(library: Any, convex: Any, pair: Pair) -> list[Any] | None:
    """Shapes and frames of a pair in a library; None where it lacks one."""
    found = [
        peer_geometry(library, convex, shape, T)
        for shape, T in ((pair.shape_a, pair.T_a), (pair.shape_b, pair.T_b))
    ]
    return None if None in found else found


def ask_coal(pair: Pair) -> float | None:
    """Coal."""
    found = both(coal, coal_convex, pair)
    if found is None:
        return None
    request = coal.DistanceRequest()
    request.enable_signed_distance = True
    request.gjk_tolerance = request.epa_tolerance = 1e-12
    request.gjk_max_iterations = request.epa_max_iterations = 1000
    placed = [
        part
        for shape, T in found
        for part in (shape, coal.Transform3s(T[:3, :3], T[:3, 3]))
    ]
    try:
        return float(coal.distance(*placed, request, coal.DistanceResult()))
    except RuntimeError as error:
        if "not yet" in str(error) or "not supported" in str(error):
            return None
        raise


def fcl_convex(vertices: Any, faces: Any) -> Any:
    """FCL's convex polytope."""
    flat = np.concatenate([np.full((len(faces), 1), 3), faces], axis=1).flatten()
    return fcl.Convex(vertices, len(faces), flat)


def ask_fcl(pair: Pair) -> float | None:
    """FCL, by python-fcl."""
    found = both(fcl, fcl_convex, pair)
    if found is None:
        return None
    placed = [
        fcl.CollisionObject(shape, fcl.Transform(T[:3, :3].copy(), T[:3, 3].copy()))
        for shape, T in found
    ]
    request = fcl.DistanceRequest(enable_signed_distance=True)
    return float(fcl.distance(*placed, request, fcl.DistanceResult()))


def add_geom(spec: Any, name: str, shape: Any, T: Any) -> bool:
    """Add a mocap body with the shape as its geom; False if MuJoCo has none."""
    match shape:
        case Sphere():
            kind, size = GEOM.mjGEOM_SPHERE, (shape.radius, 0.0, 0.0)
        case Capsule():
            length, T = along_z(shape, T)
            kind, size = GEOM.mjGEOM_CAPSULE, (shape.radius, length / 2.0, 0.0)
        case Box():
            kind, size = GEOM.mjGEOM_BOX, shape.half_extents
        case Cylinder():
            kind, size = GEOM.mjGEOM_CYLINDER, (shape.radius, shape.height / 2.0, 0.0)
        case Ellipsoid():
            kind, size = GEOM.mjGEOM_ELLIPSOID, shape.semi_axes
        case HalfSpace():
            kind, size = GEOM.mjGEOM_PLANE, (1.0, 1.0, 1.0)
        case Hull() if outward_faces(shape) is not None:
            kind, size = GEOM.mjGEOM_MESH, (0.0, 0.0, 0.0)
            mesh = spec.add_mesh(name=name)
            mesh.uservert = shape.vertices.flatten()
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
        case _:
            return False
    body = spec.worldbody.add_body(name=name, mocap=True, **placed(T))
    geom = body.add_geom(name=name, type=kind, size=list(size))
    if kind == GEOM.mjGEOM_MESH:
        geom.meshname = name
    return True


def ask_mujoco(pair: Pair) -> float | None:
    """MuJoCo: `mj_geomDistance` on a model of two geoms."""
    spec = mujoco.MjSpec()
    spec.option.ccd_tolerance = 1e-12
    spec.option.ccd_iterations = 1000
    if not add_geom(spec, "a", pair.shape_a, pair.T_a):
        return None
    if not add_geom(spec, "b", pair.shape_b, pair.T_b):
        return None
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return float(mujoco.mj_geomDistance(model, data, 0, 1, FARTHEST, np.zeros(6)))


def sharp(ask: Callable[[Pair], float | None]) -> Callable[[Pair], float | None]:
    """Takes the rounding of a pair off a peer's answer about the sharp shapes."""

    def rounded(pair: Pair) -> float | None:
        found = ask(pair)
        if found is None:
            return None
        return found - pair.shape_a.rounding - pair.shape_b.rounding

    return rounded


PEERS: dict[str, Callable[[Pair], float | None]] = {
    "Coal": sharp(ask_coal),
    "FCL": sharp(ask_fcl),
    "MuJoCo": sharp(ask_mujoco),
}


# A peer that has not answered by then hangs [s].
PATIENCE = 1.0

# Errors above this count, relative to the scale; as do those of the oracle [-].
NOTABLE = 1e-6

# What may be wrong with an answer, the unsafe side first.
VERDICTS = {
    "too far": "apart, and farther than the truth",
    "too shallow": "overlapping, and the depth too small",
    "not seen": "overlapping, and reported apart",
    "too near": "apart, and nearer than the truth, or reported overlapping",
    "too deep": "overlapping, and the depth too large",
    "no number": "NaN, infinite or ±1.8e308",
    "refused": "an exception",
    "hung": f"no answer within {PATIENCE:g} s",
    "died": "the process was gone",
}


def serve(pipe: Connection, peer: str) -> None:
    """Answer pairs, in the child."""
    # What libraries print about themselves is not part of the report.
    quiet = os.open(os.devnull, os.O_WRONLY)
    os.dup2(quiet, 1)
    os.dup2(quiet, 2)
    pipe.send("ready")
    while True:
        pair = pipe.recv()
        try:
            pipe.send(PEERS[peer](pair))
        except Exception as error:
            pipe.send(str(error).strip().splitlines()[-1:] or [type(error).__name__])


class Asked:
    """A peer in a child that is started again when it is lost."""

    def __init__(self, peer: str) -> None:
        """Start it."""
        self.peer = peer
        self.start()

    def start(self) -> None:
        """Start a child."""
        # Forked, so that one is soon back: what it needs is loaded already.
        context = multiprocessing.get_context("fork")
        self.pipe, theirs = context.Pipe()
        self.child = context.Process(
            target=serve, args=(theirs, self.peer), daemon=True
        )
        self.child.start()
        theirs.close()
        self.pipe.recv()

    def ask(self, pair: Pair) -> Any:
        """A distance, None, a list with a message, or the word hung or died."""
        try:
            self.pipe.send(pair)
            if self.pipe.poll(PATIENCE):
                return self.pipe.recv()
            lost = "hung"
        except (EOFError, OSError):
            lost = "died"
        self.stop()
        self.start()
        return lost

    def stop(self) -> None:
        """End the child."""
        self.child.kill()
        self.child.join()
        self.pipe.close()


def verdict(answer: Any, lower: float, upper: float, margin: float) -> str | None:
    """What is wrong with an answer, if anything."""
    if isinstance(answer, list):
        return "refused"
    if isinstance(answer, str):
        return answer
    if not np.isfinite(answer) or abs(answer) > 1e300:
        return "no number"
    if answer > upper + margin:
        if upper > 0.0:
            return "too far"
        return "not seen" if answer > margin else "too shallow"
    if answer < lower - margin:
        return "too near" if lower > 0.0 else "too deep"
    return None


def compare(task: tuple[str, str, int]) -> dict[str, Any]:
    """Ask a peer about pairs of all kinds in one regime and judge its answers."""
    peer, regime, count = task
    asked = Asked(peer)
    found: dict[str, Any] = {}
    for name in NAMES:
        if ShapeKind.SUPPORT in NAMES[name]:
            # Known by its support alone: no peer has it.
            continue
        found[name] = entry = {"asked": 0, "unsupported": 0, "worst": 0.0, "wrong": {}}
        batch = judge(*NAMES[name], regime, range(count))
        for k, answer in enumerate(answers(asked, batch.pairs)):
            if answer is None:
                entry["unsupported"] += 1
                continue
            entry["asked"] += 1
            size = batch.scale[k]
            lower, upper = float(batch.lower[k]), float(batch.upper[k])
            error = 0.0
            if isinstance(answer, float) and abs(answer) < 1e300:
                error = max(answer - upper, lower - answer) / size
            entry["worst"] = max(entry["worst"], error)
            word = verdict(answer, lower, upper, NOTABLE * size)
            if word:
                case = entry["wrong"].setdefault(word, {"count": 0, "error": -1.0})
                case["count"] += 1
                if error > case["error"]:
                    case.update(
                        error=error,
                        regime=regime,
                        number=k,
                        answer=answer if isinstance(answer, float) else None,
                        truth=lower,
                        ours=float(batch.out[k, 0]),
                    )
    asked.stop()
    return found


def answers(asked: Asked, pairs: list[Pair]) -> Iterator[Any]:
    """Answers, in order; nothing is asked after two in a row were lost."""
    lost = 0
    for pair in pairs:
        answer = None if lost == 2 else asked.ask(pair)
        lost = lost + 1 if answer in ("hung", "died") else lost * (lost == 2)
        yield answer


def tasks(peers: list[str], count: int) -> list[tuple[str, str, int]]:
    """Work for all regimes."""
    return [(peer, regime, count) for regime in REGIMES for peer in peers]
