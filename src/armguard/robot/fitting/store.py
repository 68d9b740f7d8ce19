"""Fits kept on disk, by the geometry they are of and the code that made them."""

import json
import os
import tempfile
from collections.abc import Iterable
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from armguard.geometry import shapes as convex
from armguard.geometry.pose import Pose
from armguard.geometry.shapes import Box, Capsule, Hull, PlacedShape, Sphere
from armguard.kernel import PACKAGE, cache_home
from armguard.robot.model import Cylinder, FittedLink, Link, MeshFile

# Decimals of a pose that count in a key: the last bits of a sine differ between
# machines, and zero has two signs [-].
DECIMALS = 9

KINDS = {
    "sphere": Sphere,
    "capsule": Capsule,
    "box": Box,
    "cylinder": convex.Cylinder,
    "ellipsoid": convex.Ellipsoid,
    "hull": Hull,
}


def fit_key(link: Link, settings: Iterable[object]) -> str:
    """Hash of a link's geometry and the settings of its fit.

    Equal mesh files have one key, whatever their place and the text of their URDF.
    Poses count to a nanometre; primitives are grown by more (`SEAM`).

    Args:
        link: The link.
        settings: What else its fit depends on, as numbers.
    """
    digest = sha256(repr(tuple(settings)).encode())
    for element in link.collisions:
        pose = np.round(element.T_link_geometry, DECIMALS) + 0.0
        digest.update(pose.tobytes())
        geometry = element.geometry
        if isinstance(geometry, MeshFile):
            digest.update(repr(geometry.scale).encode())
            digest.update(geometry.path.suffix.lower().encode())
            digest.update(sha256(geometry.path.read_bytes()).digest())
        else:
            digest.update(repr(geometry).encode())
    return digest.hexdigest()[:32]


@cache
def code_hash() -> str:
    """Hash of the code that fits: other code keeps fits of its own."""
    sources = sorted((PACKAGE / "robot" / "fitting").glob("*.py"))
    return sha256(b"".join(map(Path.read_bytes, sources))).hexdigest()[:16]


def path_of(key: str) -> Path:
    """File of a fit."""
    return cache_home() / "fits" / f"{key}-{code_hash()}.json"


def read_fit(key: str, link: str) -> FittedLink | None:
    """A kept fit; None if there is none, or none that can be read."""
    try:
        held = json.loads(path_of(key).read_text(encoding="utf-8"))
        return FittedLink(
            link=link,
            shapes=tuple(as_shape(s) for s in held["shapes"]),
            overreach=float(held["overreach"]),
            source=str(held["source"]),
            exact=tuple(as_shape(s) for s in held["exact"]),
            contained=bool(held["contained"]),
        )
    except (OSError, ValueError, KeyError, TypeError):
        return None


def write_fit(key: str, fit: FittedLink) -> None:
    """Keep a fit; a cache that cannot be written is no reason to stop."""
    held = {
        "shapes": [as_dict(s) for s in fit.shapes],
        "overreach": fit.overreach,
        "source": fit.source,
        "exact": [as_dict(s) for s in fit.exact],
        "contained": fit.contained,
    }
    path = path_of(key)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            json.dump(held, file)
        Path(name).replace(path)
    except OSError:
        return


def as_dict(placed: PlacedShape) -> dict[str, Any]:
    """A placed primitive as plain numbers; floats survive JSON bit for bit."""
    shape = placed.shape
    sizes = {
        name: getattr(shape, name)
        for name in "radius rounding start end size height semi_axes".split()
        if hasattr(shape, name)
    }
    if isinstance(shape, Hull):
        sizes["points"] = shape.vertices.tolist()
    return {
        "kind": shape.kind.name.lower(),
        "sizes": sizes,
        "xyz": placed.pose.xyz,
        "rpy": placed.pose.rpy,
        "model_error": placed.model_error,
    }


def as_shape(held: dict[str, Any]) -> PlacedShape:
    """The placed primitive of `as_dict`."""
    sizes = {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in held["sizes"].items()
    }
    shape: Any = KINDS[held["kind"]](**sizes)
    pose = Pose(xyz=tuple(held["xyz"]), rpy=tuple(held["rpy"]))
    return PlacedShape(shape, pose, float(held["model_error"]))


def is_exact(link: Link) -> bool:
    """Whether a link needs no fit: all its shapes are ours."""
    return not any(isinstance(e.geometry, Cylinder | MeshFile) for e in link.collisions)
