"""URDF, xacro and MJCF to `RobotModel`: every oddity is an error with its place."""

from collections.abc import Callable, Mapping
from functools import partial
from math import inf
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from armguard.bounded import is_file
from armguard.errors import MeshError, ModelError, did_you_mean
from armguard.robot.mjcf_source import expand_mjcf
from armguard.robot.model import (
    Joint,
    JointKind,
    Link,
    MeshFile,
    Mimic,
    RobotModel,
    file_of,
)
from armguard.robot.packages import find_file
from armguard.robot.srdf import load_srdf, with_srdf
from armguard.robot.urdf_geometry import MeshFinder, read_collisions
from armguard.robot.xacro_source import Argument, expand_xacro
from armguard.robot.xml_source import Element, Reader, parse_xml, read_xml

Part = TypeVar("Part", Link, Joint)

# Shorter than this an axis gives no direction [-].
LEAST_AXIS = 1e-9

# Most elements of a robot; the largest of example-robot-data has 220 joints.
MOST_OF = {"link": 500, "joint": 500, "link/collision": 2_000}

# Largest sum of the files of its collision meshes, each as often as it is named [byte].
MOST_MESH_BYTES_OF_ROBOT = 100_000_000


def load_urdf(
    source: str | Path,
    *,
    srdf: str | Path | None = None,
    packages: Mapping[str, Path] | None = None,
    folder: Path | None = None,
    xacro_args: Mapping[str, Argument] | None = None,
) -> RobotModel:
    """Read a robot.

    Args:
        source: The URDF file, a xacro file with the ending .xacro, or an MJCF file.
        srdf: Its SRDF file: disabled pairs and named configurations. Without one, an
            MJCF file has its `<exclude>` and its home keyframe.
        packages: Folders of `package://` names.
        folder: The scene file's folder, if a scene file names the URDF.
        xacro_args: Values of the arguments of a xacro file, by name.

    Raises:
        ModelError: The description cannot be guarded as it is written, or is too large.
        MeshError: A mesh is not where the file says, or outside of the folders that
            may be read: the URDF's, the scene's, and those of its packages.
    """
    path = Path(source)
    root, expanded, is_mjcf = read_robot(path, packages, xacro_args)
    file = file_of(path, expanded)
    reader = Reader(file)
    check_counts(path.name, root)
    files = partial(find_file, urdf=path, packages=packages, folder=folder)
    links = by_name(reader, root, "link", partial(read_link, files=files))
    joints = by_name(reader, root, "joint", partial(read_joint, links=links))
    check_mesh_bytes(path.name, links)
    root_link = check_tree(file, links, joints)
    check_mimics(file, joints)
    if not any(link.collisions for link in links.values()):
        raise ModelError(
            f"'{path.name}' has no collision geometry on any of its {len(links)} "
            "links; there is nothing to guard"
        )
    missing = "a geom that collides" if is_mjcf else "a <collision>"
    notes = [
        f"link '{link.name}' has visual but no collision geometry; it is not guarded: "
        f"add {missing} to '{path.name}'"
        for link in links.values()
        if link.has_visual and not link.collisions
    ]
    model = RobotModel(
        name=root.get("name", path.stem),
        path=path.resolve(),
        links=links,
        joints=joints,
        root=root_link,
        notes=(*(note.text for note in root.iterchildren("note") if is_mjcf), *notes),
        expanded=expanded,
    )
    if srdf is not None:
        return load_srdf(Path(srdf), model)
    return with_srdf(Reader(path.name), root, model) if is_mjcf else model


def read_robot(
    path: Path,
    packages: Mapping[str, Path] | None = None,
    xacro_args: Mapping[str, Argument] | None = None,
) -> tuple[Element, bytes | None, bool]:
    """Root element of a robot's URDF, its text if expanded, and whether from MJCF."""
    if path.suffix == ".xacro" and is_file(path):
        expanded = expand_xacro(path, packages, xacro_args)
    elif xacro_args:
        raise ModelError(f"'{path.name}' is no xacro file; remove `xacro_args`")
    else:
        root = read_xml(path, "robot", "mujoco")
        if root.tag == "robot":
            return root, None, False
        expanded = expand_mjcf(path)
    return parse_xml(path, expanded, "robot"), expanded, path.suffix != ".xacro"


def by_name(
    reader: Reader, root: Element, tag: str, read: Callable[[Reader, Element], Part]
) -> dict[str, Part]:
    """Links or joints by name, in the order of the file.

    Raises:
        ModelError: A name is there twice, or a part cannot be read.
    """
    found: dict[str, Part] = {}
    for element in root.iterchildren(tag):
        part = read(reader, element)
        if part.name in found:
            line = found[part.name].line
            raise reader.fail(element, f"{tag} '{part.name}' is already on line {line}")
        found[part.name] = part
    return found


def check_counts(file: str, root: Element) -> None:
    """Refuse a description with too many parts.

    Raises:
        ModelError: It has too many.
    """
    for tags, most in MOST_OF.items():
        count, tag = len(root.findall(tags)), tags.split("/")[-1]
        if count > most:
            raise ModelError(f"'{file}' has {count:,} <{tag}>; the limit is {most:,}")


def check_mesh_bytes(file: str, links: Mapping[str, Link]) -> None:
    """Refuse a robot whose meshes are too large together, before one is read.

    Raises:
        MeshError: They are.
    """
    total = sum(
        element.geometry.path.stat().st_size
        for link in links.values()
        for element in link.collisions
        if isinstance(element.geometry, MeshFile)
    )
    if total > MOST_MESH_BYTES_OF_ROBOT:
        raise MeshError(
            f"the collision meshes of '{file}' have {total / 1e6:.1f} MB; the limit is "
            f"{MOST_MESH_BYTES_OF_ROBOT / 1e6:g} MB: make them coarser"
        )


def read_link(reader: Reader, element: Element, files: MeshFinder) -> Link:
    """One <link>."""
    return Link(
        name=reader.attribute(element, "name"),
        collisions=read_collisions(reader, element, files),
        has_visual=element.find("visual") is not None,
        line=element.sourceline,
    )


def read_joint(reader: Reader, element: Element, links: Mapping[str, Link]) -> Joint:
    """One <joint> between links of the file."""
    name = reader.attribute(element, "name")
    type_name = reader.attribute(element, "type")
    known = [kind.value for kind in JointKind]
    if type_name in ("floating", "planar"):
        raise reader.fail(
            element,
            f"joint '{name}' is {type_name}; write it as three to six revolute and "
            "prismatic joints, or fix it and give the base a pose",
        )
    if type_name not in known:
        raise reader.fail(
            element,
            f"joint '{name}' has type '{type_name}'; {did_you_mean(type_name, known)}",
        )
    kind = JointKind(type_name)
    lower, upper, velocity = read_limits(reader, element, name, kind)
    ends = []
    for role in ("parent", "child"):
        found = element.find(role)
        if found is None:
            raise reader.fail(element, f"joint '{name}' has no <{role}>")
        link = reader.attribute(found, "link")
        if link not in links:
            raise reader.fail(
                element,
                f"joint '{name}' has {role} link '{link}', which does not exist; "
                f"{did_you_mean(link, links)}",
            )
        ends.append(link)
    return Joint(
        name=name,
        kind=kind,
        parent=ends[0],
        child=ends[1],
        T_parent_joint=reader.origin(element),
        axis=read_axis(reader, element, name, kind),
        lower=lower,
        upper=upper,
        velocity=velocity,
        mimic=read_mimic(reader, element),
        line=element.sourceline,
    )


def read_axis(
    reader: Reader, element: Element, name: str, kind: JointKind
) -> NDArray[np.float64]:
    """Unit axis of a joint; x if the file gives none, as URDF says."""
    found = element.find("axis")
    if found is None or kind is JointKind.FIXED:
        return np.array([1.0, 0.0, 0.0])
    axis = np.array(reader.numbers(found, "xyz", 3))
    length = float(np.linalg.norm(axis))
    if not length > LEAST_AXIS:
        raise reader.fail(
            found, f"joint '{name}' has axis \"{found.get('xyz')}\" of length 0"
        )
    return axis / length


def read_limits(
    reader: Reader, element: Element, name: str, kind: JointKind
) -> tuple[float, float, float | None]:
    """Lower and upper limit, and speed limit if there is one."""
    limit = element.find("limit")
    velocity = None
    if limit is not None and limit.get("velocity") is not None:
        (velocity,) = reader.numbers(limit, "velocity", 1)
        if velocity < 0.0:
            raise reader.fail(limit, f"joint '{name}' has velocity limit {velocity}")
    if kind is JointKind.FIXED:
        return 0.0, 0.0, None
    if kind is JointKind.CONTINUOUS:
        return -inf, inf, velocity
    if limit is None:
        raise reader.fail(
            element, f"joint '{name}' is {kind.value} and has no <limit lower upper>"
        )
    (lower,) = reader.numbers(limit, "lower", 1, "0")
    (upper,) = reader.numbers(limit, "upper", 1, "0")
    if not lower <= upper:
        raise reader.fail(
            limit, f"joint '{name}' has lower limit {lower} above its upper {upper}"
        )
    return lower, upper, velocity


def read_mimic(reader: Reader, element: Element) -> Mimic | None:
    """The joint another follows, or None."""
    found = element.find("mimic")
    if found is None:
        return None
    (multiplier,) = reader.numbers(found, "multiplier", 1, "1")
    (offset,) = reader.numbers(found, "offset", 1, "0")
    return Mimic(reader.attribute(found, "joint"), multiplier, offset)


def check_mimics(file: str, joints: Mapping[str, Joint]) -> None:
    """A mimic follows a joint that exists, moves, and follows no other itself."""
    for joint in joints.values():
        if joint.mimic is None:
            continue
        followed = joints.get(joint.mimic.joint)
        at = f"'{file}' line {joint.line}: joint '{joint.name}'"
        if followed is None:
            raise ModelError(
                f"{at} mimics '{joint.mimic.joint}', which does not exist; "
                f"{did_you_mean(joint.mimic.joint, joints)}"
            )
        if followed.kind is JointKind.FIXED:
            raise ModelError(f"{at} mimics '{followed.name}', which is fixed")
        if followed.mimic is not None:
            raise ModelError(
                f"{at} mimics '{followed.name}', which is a mimic itself; name the "
                f"joint '{followed.mimic.joint}' that moves both"
            )


def check_tree(
    file: str, links: Mapping[str, Link], joints: Mapping[str, Joint]
) -> str:
    """Name of the root link.

    Raises:
        ModelError: No link, two parents, a loop, or more than one root.
    """
    if not links:
        raise ModelError(f"'{file}' has no <link>")
    parent_of: dict[str, Joint] = {}
    for joint in joints.values():
        other = parent_of.get(joint.child)
        if other is not None:
            raise ModelError(
                f"'{file}' line {joint.line}: link '{joint.child}' is the child of "
                f"joint '{joint.name}' and of '{other.name}'; a link has one parent"
            )
        parent_of[joint.child] = joint
    for name in links:
        seen = [name]
        while seen[-1] in parent_of:
            above = parent_of[seen[-1]].parent
            if above in seen:
                loop = " -> ".join([*seen[seen.index(above) :], above])
                raise ModelError(
                    f"'{file}' line {parent_of[above].line}: links form a loop: {loop}"
                )
            seen.append(above)
    roots = [name for name in links if name not in parent_of]
    if len(roots) > 1:
        named = ", ".join(f"'{name}'" for name in roots)
        raise ModelError(
            f"'{file}' has {len(roots)} links without a parent: {named}; a robot has "
            "one root, join the others to it with joints"
        )
    return roots[0]
