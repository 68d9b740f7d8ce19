"""MJCF to URDF, in a child process: MuJoCo's own parser reads the file.

A body becomes a link with the body's frame, the world the root link. What SRDF says of
a URDF is beside the links: `<exclude>` as `<disable_collisions>`, the home keyframe as
a `<group_state>`, and notes as `<note>`.
"""

import sys
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from armguard.errors import ModelError
from armguard.geometry.pose import Pose
from armguard.robot.child import MOST_MESSAGE, MOST_SECONDS, answer, convert, given

Element = Any  # an lxml element; its stubs call it private
Floats = NDArray[np.float64]

# How a refusal that is a whole sentence begins in the child's message.
REFUSED = "refused: "

ADVICE = {
    "FREE": "remove it, and place the robot with `base` in the scene; a body that "
    "moves freely is an object of the scene",
    "BALL": "write it as three hinge joints",
    "PLANE": "remove it, or name the robot's own file, and add the plane to the scene: "
    "`objects: {floor: {half_space: {}}}`",
    "HFIELD": "remove it, and add the terrain to the scene as a mesh",
    "SDF": "write it as a mesh",
}


def expand_mjcf(path: Path, seconds: float = MOST_SECONDS) -> bytes:
    """The URDF, with its SRDF and notes, of an MJCF file.

    Args:
        path: The MJCF file.
        seconds: Longest conversion [s].

    Raises:
        ModelError: MuJoCo is not installed, refuses the file, or takes too long; or the
            robot has a part that cannot be guarded.
    """
    return convert(
        __name__,
        path,
        {},
        seconds,
        kind="MJCF",
        package="mujoco",
        endless="large meshes and textures, and remove them",
        refusal=refusal,
    )


def refusal(file: str, message: str) -> str:
    """One sentence from the message of the child."""
    if message.startswith(REFUSED):
        return message.removeprefix(REFUSED)
    return f"'{file}' cannot be read: {message[:MOST_MESSAGE]}; correct the MJCF file"


def main() -> None:
    """Convert the file that standard input names; the URDF goes to standard output."""
    path = Path(given()["path"])
    import mujoco

    warnings: list[str] = []
    mujoco.set_mju_user_warning(warnings.append)
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        robot = MujocoRobot(path, spec, spec.compile())
        robot.notes += [f"'{path.name}': MuJoCo warns: {text}" for text in warnings]
        answer(etree.tostring(robot.urdf(), pretty_print=True))
    except ModelError as error:
        sys.exit(f"{REFUSED}{error}")
    except Exception as error:  # MuJoCo has its own errors, and those of its parsers
        sys.exit(f"{error or type(error).__name__}")


class MujocoRobot:
    """A compiled model, and its parts as elements of a URDF.

    Args:
        path: The MJCF file.
        spec: Its elements, as MuJoCo has read them.
        model: What MuJoCo has compiled of it.
    """

    def __init__(self, path: Path, spec: Any, model: Any) -> None:
        self.path, self.spec, self.model = path, spec, model
        # MuJoCo counts the lines of included files too.
        self.has_lines = b"<include" not in path.read_bytes()
        bodies, joints = range(model.nbody), range(model.njnt)
        self.links = [model.body(k).name or f"body_{k}" for k in bodies]
        self.joints = [model.joint(k).name or f"joint_{k}" for k in joints]
        self.specs = {
            kind: {element.id: element for element in getattr(spec, kind)}
            for kind in ("geoms", "joints", "meshes", "equalities", "bodies")
        }
        self.notes: list[str] = []
        self.mimics = self.find_mimics()

    def urdf(self) -> Element:
        """The robot.

        Raises:
            ModelError: It has a part that cannot be guarded.
        """
        if len(self.spec.flexes):
            raise ModelError(
                f"'{self.path.name}' has a <flex>; a body that deforms cannot be "
                "guarded: remove it"
            )
        root = etree.Element("robot", name=self.spec.modelname or self.path.stem)
        for body in range(self.model.nbody):
            link = etree.SubElement(root, "link", name=self.links[body])
            self.add_geoms(link, body)
        for body in range(1, self.model.nbody):
            self.add_joints(root, body)
        for a, b, reason in self.disabled_pairs():
            attributes = {"link1": self.links[a], "link2": self.links[b]}
            etree.SubElement(root, "disable_collisions", attributes, reason=reason)
        self.add_home(root)
        for note in self.notes:
            etree.SubElement(root, "note").text = note
        return root

    def fail(self, kind: str, number: int, sentence: str) -> ModelError:
        """An error about an element, with its line where MuJoCo knows it."""
        return ModelError(f"'{self.path.name}'{self.line(kind, number)}: {sentence}")

    def line(self, kind: str, number: int) -> str:
        """The line of an element, after a space; empty if it is not known."""
        info = self.specs[kind][number].info if self.has_lines else ""
        return f" {info}" if info.startswith("line") else ""

    def find_mimics(self) -> dict[int, tuple[int, float, float]]:
        """The joint another follows, multiplier and offset, by its number.

        Raises:
            ModelError: A joint follows two.
        """
        import mujoco

        model, found = self.model, dict[int, tuple[int, float, float]]()
        for k in np.flatnonzero(model.eq_active0).tolist():
            follower, leader = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
            constant, factor, *others = model.eq_data[k, :5].tolist()
            kind = mujoco.mjtEq(model.eq_type[k]).name.removeprefix("mjEQ_").lower()
            if kind != "joint" or leader < 0 or any(others):
                self.notes.append(
                    f"'{self.path.name}'{self.line('equalities', k)}: the <{kind}> of "
                    "<equality> is no linear coupling of two joints; its joints are "
                    "guarded as independent ones, give the position of each"
                )
                continue
            if follower in found:
                name = self.joints[follower]
                raise self.fail(
                    "equalities", k, f"joint '{name}' follows two joints; remove one"
                )
            zero = model.qpos0[model.jnt_qposadr[[follower, leader]]]
            found[follower] = leader, factor, zero[0] + constant - factor * zero[1]
        return found

    def add_geoms(self, link: Element, body: int) -> None:
        """Geoms of a body: `<collision>` if they collide with any, else `<visual>`.

        Raises:
            ModelError: One cannot be guarded.
        """
        model = self.model
        paired = {*model.pair_geom1.tolist(), *model.pair_geom2.tolist()}
        first = model.body_geomadr[body]
        for k in range(first, first + model.body_geomnum[body]):
            collides = model.geom_contype[k] or model.geom_conaffinity[k] or k in paired
            if collides and model.body_mocapid[body] >= 0:
                raise self.fail(
                    "bodies",
                    body,
                    f"body '{self.links[body]}' is a mocap body, which joints do not "
                    "move; remove it, and add it to the scene as an object",
                )
            try:
                shape, T = self.shape(k)
            except ModelError:
                if collides:
                    raise
                continue
            element = etree.SubElement(link, "collision" if collides else "visual")
            add_origin(element, T)
            etree.SubElement(element, "geometry").append(shape)

    def shape(self, k: int) -> tuple[Element, Floats]:
        """A geom as a shape of URDF, and its frame in the link's.

        Raises:
            ModelError: URDF has no such shape.
        """
        import mujoco

        model = self.model
        kind = mujoco.mjtGeom(model.geom_type[k]).name.removeprefix("mjGEOM_")
        radius, length, _ = size = model.geom_size[k].tolist()
        T = transform(model.geom_pos[k], model.geom_quat[k])
        if kind in ADVICE:
            body = self.links[model.geom_bodyid[k]]
            raise self.fail(
                "geoms",
                k,
                f"geom '{model.geom(k).name}' of body '{body}' is of type "
                f"{kind.lower()}, which no link can have; {ADVICE[kind]}",
            )
        if kind == "MESH":
            mesh = int(model.geom_dataid[k])
            T_geom_mesh = transform(model.mesh_pos[mesh], model.mesh_quat[mesh])
            return self.mesh(mesh), T @ np.linalg.inv(T_geom_mesh)
        sizes = {
            "SPHERE": {"radius": text([radius])},
            "CAPSULE": {"radius": text([radius]), "length": text([2.0 * length])},
            "CYLINDER": {"radius": text([radius]), "length": text([2.0 * length])},
            "BOX": {"size": text([2.0 * half for half in size])},
            "ELLIPSOID": {"radii": text(size)},
        }
        return etree.Element(kind.lower(), sizes[kind]), T

    def mesh(self, number: int) -> Element:
        """A `<mesh>`, by the file it is read from.

        Raises:
            ModelError: It is from no file, or its vertices are moved.
        """
        model, mesh = self.model, self.specs["meshes"][number]
        start, name = int(model.mesh_pathadr[number]), model.mesh(number).name
        if start < 0:
            raise self.fail(
                "meshes",
                number,
                f"mesh '{name}' is from no file; write it to an STL or OBJ file",
            )
        if np.any(mesh.refpos) or not np.array_equal(mesh.refquat, (1, 0, 0, 0)):
            raise self.fail(
                "meshes",
                number,
                f"mesh '{name}' has a refpos or refquat; remove them, and set `pos` "
                "and `quat` of its geoms",
            )
        # Whole in MuJoCo 4; before, as it is written.
        file = bytes(model.paths)[start:].split(b"\0", 1)[0].decode()
        file = str(self.path.parent / self.spec.meshdir / file)
        scale = text(model.mesh_scale[number])
        return etree.Element("mesh", filename=file, scale=scale)

    def add_joints(self, root: Element, body: int) -> None:
        """Joints between a body and its parent.

        Several joints of a body, and one that is not in its origin, get links without
        geometry between them; a body without a joint is fixed.

        Raises:
            ModelError: A joint cannot be guarded.
        """
        model, own = self.model, self.links[body]
        parent = self.links[model.body_parentid[body]]
        T = transform(model.body_pos[body], model.body_quat[body])
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        for k in range(first, first + count):
            kind = self.joint_kind(k)
            anchor, zero = np.eye(4), float(model.qpos0[model.jnt_qposadr[k]])
            back = transform(-zero * model.jnt_axis[k], (1, 0, 0, 0))
            if kind != "prismatic":
                anchor[:3, 3] = model.jnt_pos[k]
                back = turned(model.jnt_axis[k], -zero)
            last = k == first + count - 1 and not anchor[:3, 3].any()
            child = own if last else f"{own}.{self.joints[k]}"
            if not last:
                etree.SubElement(root, "link", name=child)
            self.add_joint(root, k, kind, (parent, child), T @ anchor @ back)
            parent, anchor[:3, 3] = child, -anchor[:3, 3]
            T = anchor
        if parent != own:
            fixed = add_joint(root, f"{own}.fixed", "fixed", (parent, own))
            add_origin(fixed, T)

    def joint_kind(self, k: int) -> str:
        """The type of a joint in a URDF.

        Raises:
            ModelError: It cannot be guarded.
        """
        import mujoco

        kind = mujoco.mjtJoint(self.model.jnt_type[k]).name.removeprefix("mjJNT_")
        limited, name = bool(self.model.jnt_limited[k]), f"joint '{self.joints[k]}'"
        if kind in ADVICE:
            raise self.fail("joints", k, f"{name} is {kind.lower()}; {ADVICE[kind]}")
        if kind == "SLIDE" and not limited:
            raise self.fail(
                "joints",
                k,
                f'{name} slides and has no range; add `range="LOWER UPPER"`',
            )
        if kind == "SLIDE":
            return "prismatic"
        return "revolute" if limited else "continuous"

    def add_joint(
        self, root: Element, k: int, kind: str, ends: tuple[str, str], T: Floats
    ) -> None:
        """A hinge or a slide between two links, its frame at T in the first."""
        model = self.model
        joint = add_joint(root, self.joints[k], kind, ends)
        add_origin(joint, T)
        etree.SubElement(joint, "axis", xyz=text(model.jnt_axis[k]))
        if model.jnt_limited[k]:
            lower, upper = map(text, model.jnt_range[k][:, None])
            etree.SubElement(joint, "limit", lower=lower, upper=upper)
        if k in self.mimics:
            leader, factor, offset = self.mimics[k]
            etree.SubElement(
                joint,
                "mimic",
                joint=self.joints[leader],
                multiplier=text([factor]),
                offset=text([offset]),
            )

    def disabled_pairs(self) -> Iterator[tuple[int, int, str]]:
        """Pairs of bodies that MuJoCo does not check, each with its reason.

        Beside `<exclude>` these are parent and child with several joints between them,
        which are no neighbours here.
        """
        model = self.model
        for signature in model.exclude_signature.tolist():
            yield signature >> 16, signature & 0xFFFF, "<exclude>"
        groups = model.body_weldid.tolist()
        for body in np.flatnonzero(model.body_jntnum > 1):
            above = groups[model.body_parentid[body]]
            sides = [[k for k, g in enumerate(groups) if g == s] for s in (above, body)]
            for a, b in product(*sides):
                yield a, b, f"joined by {model.body_jntnum[body]} joints"

    def add_home(self, root: Element) -> None:
        """The keyframe `home`, or the only one, as a group state."""
        model = self.model
        names = [model.key(k).name for k in range(model.nkey)]
        if "home" not in names and len(names) != 1:
            return
        positions = model.key_qpos[names.index("home") if "home" in names else 0]
        state = etree.SubElement(root, "group_state", name="home")
        for name, place in zip(self.joints, model.jnt_qposadr, strict=True):
            etree.SubElement(state, "joint", name=name, value=text([positions[place]]))


def add_joint(root: Element, name: str, kind: str, ends: tuple[str, str]) -> Element:
    """A `<joint>` between two links."""
    joint = etree.SubElement(root, "joint", name=name, type=kind)
    for role, link in zip(("parent", "child"), ends, strict=True):
        etree.SubElement(joint, role, link=link)
    return joint


def add_origin(element: Element, T: Floats) -> None:
    """The `<origin>` of an element, for a frame of shape (4, 4)."""
    pose = Pose.from_matrix(T)
    etree.SubElement(element, "origin", xyz=text(pose.xyz), rpy=text(pose.rpy))


def text(numbers: Any) -> str:
    """Numbers as an attribute has them; they are read back bit for bit."""
    return " ".join(repr(float(number)) for number in numbers)


def transform(position: Any, quaternion: Any) -> Floats:
    """Frame at a position, turned by a quaternion, scalar first; shape (4, 4)."""
    import mujoco

    T, R = np.eye(4), np.zeros(9)
    mujoco.mju_quat2Mat(R, np.array(quaternion, dtype=np.float64))
    T[:3, :3], T[:3, 3] = R.reshape(3, 3), position
    return T


def turned(axis: Floats, angle: float) -> Floats:
    """Frame in the origin, turned about an axis by an angle [rad], shape (4, 4)."""
    import mujoco

    quaternion = np.zeros(4)
    mujoco.mju_axisAngle2Quat(quaternion, axis, angle)
    return transform(np.zeros(3), quaternion)
