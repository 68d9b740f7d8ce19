"""A robot as a kinematic tree: links, joints, what each link is made of."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.shapes import PlacedShape, Shape


class JointKind(Enum):
    """How a joint's position moves its child link."""

    FIXED = "fixed"
    REVOLUTE = "revolute"
    CONTINUOUS = "continuous"
    PRISMATIC = "prismatic"


@dataclass(frozen=True, slots=True)
class Mimic:
    """Position of a joint that follows another: multiplier · q + offset.

    Attributes:
        joint: Name of the joint that is followed.
        multiplier: Factor [-].
        offset: Constant [rad or m].
    """

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Joint:
    """Connection of a child link to its parent link.

    Attributes:
        name: Name in the URDF.
        kind: How it moves.
        parent: Parent link.
        child: Child link.
        T_parent_joint: Joint frame in the parent link's frame at position 0, (4, 4).
        axis: Unit axis in the joint's frame, shape (3,).
        lower: Least position; -inf for continuous joints [rad or m].
        upper: Greatest position; +inf for continuous joints [rad or m].
        velocity: Speed limit, None if the file gives none [rad/s or m/s].
        mimic: The joint it follows, or None.
        line: Line in the URDF, 0 if it has none.
    """

    name: str
    kind: JointKind
    parent: str
    child: str
    T_parent_joint: NDArray[np.float64]
    axis: NDArray[np.float64]
    lower: float
    upper: float
    velocity: float | None = None
    mimic: Mimic | None = None
    line: int = 0


@dataclass(frozen=True, slots=True)
class Cylinder:
    """URDF's cylinder: axis z, about the frame's origin; enclosed by fitting.

    Attributes:
        radius: Radius [m].
        length: Full length [m].
    """

    radius: float
    length: float


@dataclass(frozen=True, slots=True)
class MeshFile:
    """A mesh on disk.

    Attributes:
        path: File.
        scale: Factor on each axis [-].
    """

    path: Path
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class CollisionElement:
    """One `<collision>` of a link.

    Attributes:
        geometry: A shape of ours, a cylinder or a mesh.
        T_link_geometry: Its frame in the link's, shape (4, 4).
        line: Line in the URDF.
    """

    geometry: Shape | Cylinder | MeshFile
    T_link_geometry: NDArray[np.float64]
    line: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Link:
    """A rigid part.

    Attributes:
        name: Name in the URDF.
        collisions: Its collision elements, as written.
        has_visual: Whether the URDF gives it a visual; a visible link without
            collision geometry is a hole in the guard.
        line: Line in the URDF.
    """

    name: str
    collisions: tuple[CollisionElement, ...] = ()
    has_visual: bool = False
    line: int = 0


@dataclass(frozen=True, slots=True)
class DisabledPair:
    """A pair of links that its file exempts from checking.

    Attributes:
        link_a: One link.
        link_b: The other.
        reason: Why, in the words of the file.
    """

    link_a: str
    link_b: str
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class RobotModel:
    """A robot as its files describe it.

    Attributes:
        name: Name in the URDF.
        path: The URDF, None for a model built in memory.
        links: Links by name, in the order of the file.
        joints: Joints by name, in the order of the file.
        root: The one link no joint has as its child.
        disabled_pairs: From the SRDF.
        group_states: Named configurations from the SRDF: state name to joint
            positions by joint name [rad or m].
        notes: What a reader of the files should know, one sentence each.
        expanded: The URDF that a xacro or MJCF file was expanded to, None for a URDF
            file.
    """

    name: str
    path: Path | None
    links: Mapping[str, Link]
    joints: Mapping[str, Joint]
    root: str
    disabled_pairs: tuple[DisabledPair, ...] = ()
    group_states: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    expanded: bytes | None = None

    def __repr__(self) -> str:
        """Name, and counts of links and joints."""
        counts = f"{len(self.links)} links, {len(self.q_names)} joints"
        return f"<RobotModel {self.name}: {counts}>"

    @property
    def file(self) -> str:
        """What messages call the text that lines are counted in."""
        return self.name if self.path is None else file_of(self.path, self.expanded)

    @property
    def q_names(self) -> tuple[str, ...]:
        """Joints that need a position, in the order of the file: not fixed, no mimic.

        This order is the order of the robot's part of `q`.
        """
        return tuple(
            joint.name
            for joint in self.joints.values()
            if joint.kind is not JointKind.FIXED and joint.mimic is None
        )


def file_of(path: Path, expanded: bytes | None) -> str:
    """Name of a robot's file; it says so if lines are those of its expansion."""
    return path.name if expanded is None else f"{path.name} (expanded to URDF)"


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedLink:
    """The primitives that stand for a link in the guard.

    Attributes:
        link: Name of the link.
        shapes: Primitives in the link's frame; their union holds the whole
            collision geometry.
        overreach: Model error: no point of the union's surface is farther than
            this from the collision geometry [m].
        source: What was enclosed, in words: "mesh", "exact", "cylinder" …
        exact: The collision geometry itself, meshes by their convex hulls, in the
            link's frame; empty if `shapes` are the geometry already.
        contained: Whether the hulls were proven to lie in `shapes`; if not, the meshes
            do but their hulls, which may be larger, stick out.
    """

    link: str
    shapes: tuple[PlacedShape, ...]
    overreach: float
    source: str
    exact: tuple[PlacedShape, ...] = ()
    contained: bool = True
