"""A scene as bytes that need no other file, and the scene they hold, to the last bit.

Robots with the primitives that were fitted to them, shapes and surfaces of objects,
rules and settings: the bytes are the whole scene, on a machine that has neither its
URDF files nor its meshes. They are JSON, compressed; nothing in them is run.
"""

import json
import zlib
from base64 import b64decode, b64encode
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from hashlib import blake2b
from pathlib import Path
from typing import Any

import numpy as np

from armguard.bounded import shown
from armguard.errors import SceneError
from armguard.geometry.pose import Pose
from armguard.geometry.shapes import Cylinder as CylinderShape
from armguard.geometry.shapes import PlacedShape
from armguard.geometry.shapes.registry import SHAPES
from armguard.robot.model import (
    CollisionElement,
    Cylinder,
    DisabledPair,
    FittedLink,
    Joint,
    JointKind,
    Link,
    MeshFile,
    Mimic,
    RobotModel,
)
from armguard.robot.stopping import StoppingFigures
from armguard.robot.stopping.table import StopTable
from armguard.scene.contents import Allowance
from armguard.scene.gripping import Grasp, Gripper
from armguard.scene.meshes import Surface
from armguard.scene.objects import SceneObject
from armguard.scene.robots import SceneRobot
from armguard.scene.scene import Scene
from armguard.scene.sensing import (
    IntruderSettings,
    RegionSettings,
    SceneSensing,
    SceneZone,
    StartSettings,
)
from armguard.scene.settings import CubeSettings, IndexSettings, ResponseSettings

# What may be in a scene, by name; nothing else is ever made of an archive.
PARTS: dict[str, type] = {
    part.__name__: part
    for part in (
        *SHAPES.values(), Allowance, CollisionElement, CubeSettings, Cylinder,
        DisabledPair, FittedLink, Grasp, Gripper, IndexSettings, IntruderSettings,
        Joint, Link, MeshFile, Mimic, PlacedShape, Pose, RegionSettings,
        ResponseSettings, RobotModel, SceneObject, SceneRobot, SceneSensing, SceneZone,
        StartSettings, StopTable, StoppingFigures, Surface,
    )
}  # fmt: skip
# Links have elements of the same name.
PARTS["CylinderShape"] = CylinderShape
NAMES = {part: name for name, part in PARTS.items()}

# Attributes of a scene: arguments of `Scene`, and what is added to one.
SETTINGS = ("mode", "period", "late", "buffer", "_margin", "index")
HELD = ("_robots", "_objects", "allowances", "pair_buffers", "notes")

# Key of a mapping that has its kind.
KIND = "$"

# Of the archive's form; another one is refused.
FORM = 1

# What an archive may unpack to [byte]; its JSON takes a dozen times that in memory.
MOST_UNPACKED = 64 << 20


class ArchiveError(SceneError):
    """A scene cannot be archived, or an archive holds none."""


def archive_of(scene: Scene) -> bytes:
    """The scene as bytes.

    Raises:
        ArchiveError: Something in it is known to this program alone, such as a shape
            with a support function of its own.
    """
    parts = {key.strip("_"): plain(getattr(scene, key)) for key in (*SETTINGS, *HELD)}
    if scene.sensing is not None:
        parts["sensing"] = plain(scene.sensing)
    whole = {"form": FORM, **parts}
    return zlib.compress(json.dumps(whole, separators=(",", ":")).encode())


def scene_of(archive: bytes) -> Scene:
    """The scene that an archive holds.

    Raises:
        ArchiveError: It holds none, or one of another form.
    """
    try:
        whole = json.loads(unpacked(archive))
        if whole["form"] != FORM:
            raise ArchiveError(
                f"a scene was archived in form {whole['form']}; this version reads "
                f"form {FORM}"
            )
        whole = {key: remade(value) for key, value in whole.items()}
        scene = Scene(**{key.strip("_"): whole[key.strip("_")] for key in SETTINGS})
        for key in HELD:
            if type(whole[key.strip("_")]) is not type(getattr(scene, key)):
                raise TypeError(f"its {key.strip('_')} are of another type")
            setattr(scene, key, whole[key.strip("_")])
        scene.sensing = whole.get("sensing")
        if not isinstance(scene.sensing, SceneSensing | None):
            raise TypeError("its sensing is of another type")
    except ArchiveError:
        raise
    except Exception as error:  # whatever a stranger's numbers and names lead to
        why = shown(str(error) or type(error).__name__)
        raise ArchiveError(f"an archived scene cannot be read: {why}") from error
    return scene


def unpacked(archive: bytes) -> bytes:
    """The JSON of an archive.

    Raises:
        ArchiveError: It is larger than is accepted.
        zlib.error: It is no archive.
    """
    stream = zlib.decompressobj()
    whole = stream.decompress(archive, MOST_UNPACKED)
    if stream.unconsumed_tail:
        raise ArchiveError(
            f"an archived scene unpacks to more than {MOST_UNPACKED >> 20} MiB"
        )
    if not stream.eof:
        raise ArchiveError("an archived scene is cut off")
    return whole


def hash_of(archive: bytes) -> str:
    """What distinguishes archived scenes, in hexadecimal digits."""
    return blake2b(archive, digest_size=16).hexdigest()


def plain(value: Any) -> Any:
    """A part of a scene as JSON has it."""
    if isinstance(value, np.generic):
        return value.item()
    if value is None or isinstance(value, str | int | float):
        return value
    if isinstance(value, JointKind):
        return {KIND: "joint", "value": value.value}
    if isinstance(value, np.ndarray):
        data = b64encode(np.ascontiguousarray(value).tobytes()).decode()
        shape, dtype = list(value.shape), value.dtype.str
        return {KIND: "array", "dtype": dtype, "shape": shape, "data": data}
    if isinstance(value, list):
        return [plain(item) for item in value]
    if isinstance(value, tuple):
        return {KIND: "tuple", "items": [plain(item) for item in value]}
    if isinstance(value, Path):
        return {KIND: "path", "value": str(value)}
    if isinstance(value, Mapping):
        items = [[plain(key), plain(item)] for key, item in value.items()]
        return {KIND: "mapping", "items": items}
    name = NAMES.get(type(value), "")
    if not name or isinstance(value, Enum):
        raise ArchiveError(
            f"the scene holds a {type(value).__name__}, which only this program knows; "
            "a recording of it cannot be replayed without it"
        )
    if not is_dataclass(value):
        raise ArchiveError(f"the scene holds a {name}, which is no plain data")
    own = {f.name: plain(getattr(value, f.name)) for f in fields(value) if f.init}
    return {KIND: name, **own}


def remade(value: Any) -> Any:
    """The part of a scene that was made JSON."""
    if isinstance(value, list):
        return [remade(item) for item in value]
    if not isinstance(value, dict):
        return value
    kind = value[KIND]
    if kind == "joint":
        return JointKind(value["value"])
    if kind == "array":
        data = np.frombuffer(b64decode(value["data"]), np.dtype(value["dtype"]))
        return data.reshape(value["shape"]).copy()
    if kind == "tuple":
        return tuple(remade(item) for item in value["items"])
    if kind == "path":
        return Path(value["value"])
    if kind == "mapping":
        return {remade(key): remade(item) for key, item in value["items"]}
    if kind not in PARTS:
        raise ArchiveError(f"an archived scene holds a '{kind}', no part of one")
    return PARTS[kind](**{k: remade(v) for k, v in value.items() if k != KIND})
