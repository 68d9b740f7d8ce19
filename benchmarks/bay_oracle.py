"""The bay by other people's code: pinocchio for poses, coal for distances.

Nothing here comes from armguard, so what it says of the bay's files is a second
opinion: it reads the URDF and the scene file on its own.
"""

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from ruamel.yaml import YAML

Floats = NDArray[np.float64]

BAY = Path(__file__).parents[1] / "src/armguard/scene/bay"
ARMS = ("left", "right")
JOINTS = 7


@dataclass(frozen=True)
class Primitive:
    """A shape of the bay.

    Attributes:
        body: 'robot/link', or the object's name.
        shape: coal's shape.
        placement: Its frame in the world, or in its link.
        size: Radius and axis length of a capsule, radius of a sphere, or the full
            sizes of a box [m].
    """

    body: str
    shape: Any
    placement: Any
    size: tuple[float, ...]

    @property
    def moves(self) -> bool:
        """Whether it belongs to an arm."""
        return "/" in self.body


class Nearest(NamedTuple):
    """Two primitives, and what is between them.

    Attributes:
        distance: Signed distance [m].
        a: One body.
        b: The other.
        point_a: Witness point on A, world [m].
        point_b: Witness point on B, world [m].
    """

    distance: float
    a: str
    b: str
    point_a: Floats
    point_b: Floats


class BayOracle:
    """Both arms, the fixtures, and the pairs to be checked.

    Attributes:
        scene: The scene file's values.
        primitives: All primitives, the moving ones first.
        pairs: Indices of the primitives of each pair to be checked.
        adjacent: Number of pairs of neighbouring links.
        allowed: Number of pairs the scene allows.
        model: pinocchio's model of one arm.
        home: Home configuration, shape (14,) [rad].
    """

    def __init__(self, folder: Path = BAY) -> None:
        self.scene = YAML(typ="safe", pure=True).load(folder / "bay.yaml")
        urdf = folder / self.scene["robots"]["left"]["urdf"]
        self.model = pin.buildModelFromUrdf(str(urdf))
        self.bases = [se3(self.scene["robots"][arm]["base"]) for arm in ARMS]
        joint_names = list(self.model.names)[1:]
        self.joint_names = tuple(f"{a}/{j}" for a in ARMS for j in joint_names)
        self.home = np.array(
            [self.scene["robots"][a]["home"][j] for a in ARMS for j in joint_names],
            dtype=np.float64,
        )
        links = read_capsules(urdf)
        moving = [
            Primitive(f"{arm}/{p.body}", p.shape, p.placement, p.size)
            for arm in ARMS
            for p in links
        ]
        fixed = [
            part
            for name, entry in self.scene["objects"].items()
            for part in read_object(name, entry)
        ]
        self.primitives = (*moving, *fixed)
        self._select_pairs()

    def _select_pairs(self) -> None:
        """Pairs in which something moves, less the adjacent and the allowed."""
        allowed = {frozenset((e["a"], e["b"])) for e in self.scene["allow"]}
        self.adjacent = self.allowed = 0
        self.pairs: list[tuple[int, int]] = []
        for i, j in combinations(range(len(self.primitives)), 2):
            a, b = self.primitives[i], self.primitives[j]
            if not a.moves:
                continue
            same_arm = b.moves and i // JOINTS == j // JOINTS
            if same_arm and j == i + 1:
                self.adjacent += 1
            elif frozenset((a.body, b.body)) in allowed:
                self.allowed += 1
            else:
                self.pairs.append((i, j))

    def placements(self, q: Floats) -> list[Any]:
        """World frame of each primitive.

        Args:
            q: Positions of both arms, shape (14,) [rad].
        """
        frames = []
        for base, part in zip(self.bases, np.split(q, 2), strict=True):
            data = self.model.createData()
            pin.forwardKinematics(self.model, data, part)
            frames += [base * data.oMi[k + 1] for k in range(JOINTS)]
        moving = len(frames)
        return [
            frames[k] * p.placement if k < moving else p.placement
            for k, p in enumerate(self.primitives)
        ]

    def measure(self, q: Floats) -> list[Nearest]:
        """All pairs that are checked, in the order of `pairs`."""
        frames = [coal.Transform3s(T.rotation, T.translation)
                  for T in self.placements(q)]  # fmt: skip
        request, found = coal.DistanceRequest(), []
        request.enable_signed_distance = True
        for i, j in self.pairs:
            a, b = self.primitives[i], self.primitives[j]
            result = coal.DistanceResult()
            distance = coal.distance(
                a.shape, frames[i], b.shape, frames[j], request, result
            )
            found.append(
                Nearest(
                    float(distance),
                    a.body,
                    b.body,
                    np.array(result.getNearestPoint1()),
                    np.array(result.getNearestPoint2()),
                )
            )
        return found

    def nearest(self, q: Floats) -> Nearest:
        """The pair with the least signed distance."""
        return min(self.measure(q), key=lambda pair: pair.distance)

    def tips(self, q: Floats) -> Floats:
        """End of each arm's last capsule, on its surface; world, shape (2, 3) [m]."""
        frames = self.placements(q)
        found = []
        for k in (JOINTS - 1, 2 * JOINTS - 1):
            radius, length = self.primitives[k].size
            found.append(frames[k].act(np.array([0.0, 0.0, length / 2 + radius])))
        return np.array(found)

    def bounds(self, q: Floats) -> Floats:
        """Least and greatest coordinate of any primitive, shape (2, 3) [m]."""
        boxes = []
        for frame, p in zip(self.placements(q), self.primitives, strict=True):
            placed = coal.CollisionObject(
                p.shape, coal.Transform3s(frame.rotation, frame.translation)
            )
            placed.computeAABB()
            box = placed.getAABB()
            boxes.append((np.array(box.min_), np.array(box.max_)))
        low, high = zip(*boxes, strict=True)
        return np.array([np.min(low, axis=0), np.max(high, axis=0)])


def se3(at: dict[str, list[float]] | None) -> Any:
    """A pose of the scene file."""
    at = at or {}
    rotation = pin.rpy.rpyToMatrix(*map(float, at.get("rpy", (0, 0, 0))))
    return pin.SE3(rotation, np.array(at.get("xyz", (0, 0, 0)), dtype=np.float64))


def read_capsules(urdf: Path) -> list[Primitive]:
    """One capsule for each link that has a cylinder, capped by two spheres."""
    found = []
    for link in ET.parse(urdf).getroot().iter("link"):
        for collision in link.iter("collision"):
            cylinder = collision.find("geometry/cylinder")
            if cylinder is None:
                continue
            radius = float(cylinder.get("radius", "nan"))
            length = float(cylinder.get("length", "nan"))
            origin = collision.find("origin")
            xyz = "0 0 0" if origin is None else origin.get("xyz", "0 0 0")
            placement = pin.SE3(np.eye(3), np.array([float(v) for v in xyz.split()]))
            found.append(
                Primitive(
                    link.get("name", ""),
                    coal.Capsule(radius, length),
                    placement,
                    (radius, length),
                )
            )
    return found


def read_object(name: str, entry: dict[str, Any]) -> list[Primitive]:
    """Primitives of an object of the scene file, in the world."""
    parts = entry.get("union", [{k: v for k, v in entry.items() if k != "at"}])
    outer = se3(entry.get("at"))
    return [read_shape(name, part, outer * se3(part.get("at"))) for part in parts]


def read_shape(name: str, part: dict[str, Any], placement: Any) -> Primitive:
    """One shape of the scene file; a capsule gets a frame at its middle, z along."""
    if "box" in part:
        size = tuple(map(float, part["box"]))
        return Primitive(name, coal.Box(*size), placement, size)
    if "sphere" in part:
        radius = float(part["sphere"]["radius"])
        return Primitive(name, coal.Sphere(radius), placement, (radius,))
    capsule = part["capsule"]
    start, end = (np.array(capsule[k], dtype=np.float64) for k in ("from", "to"))
    length, radius = float(np.linalg.norm(end - start)), float(capsule["radius"])
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), end - start)
    along = pin.SE3(turn.toRotationMatrix(), (start + end) / 2)
    return Primitive(
        name, coal.Capsule(radius, length), placement * along, (radius, length)
    )
