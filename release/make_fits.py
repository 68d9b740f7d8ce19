"""Writes the fits that the package brings, from checkouts of descriptions.

python release/make_fits.py FOLDER [ROW ...]

FOLDER has a checkout for each row of release/descriptions.yaml. Fits in the cache are
not made again.
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from ruamel.yaml import YAML

from armguard.robot import FittedLink, RobotModel, find_named_robot, load_urdf
from armguard.robot.fitting import fit_link, fit_robot
from armguard.robot.fitting.ready import FOLDER, ready_file
from armguard.robot.fitting.store import as_dict, fit_key
from armguard.robot.known_arms import known_arms
from armguard.robot.meshes import load_triangles
from armguard.robot.model import Link, MeshFile

TABLE = Path(__file__).with_name("descriptions.yaml")


def described(row: dict[str, Any], name: str, folder: Path) -> RobotModel:
    """A robot of a row.

    Args:
        row: The row.
        name: The robot.
        folder: The row's checkout.
    """
    if "repository" not in row:
        return load_urdf(find_named_robot(name).urdf)
    robot = row["robots"][name]
    return load_urdf(
        folder / robot["file"],
        packages={k: folder / at for k, at in row.get("packages", {}).items()},
        folder=folder,
        xacro_args=robot.get("arguments"),
    )


def is_of_meshes(link: Link) -> bool:
    """Whether a link has meshes, and nothing else."""
    shapes = [element.geometry for element in link.collisions]
    return bool(shapes) and all(isinstance(shape, MeshFile) for shape in shapes)


def fit_row(fit: FittedLink, link: Link) -> dict[str, Any]:
    """A fit as plain numbers; `proven_fit` reads them."""
    hulls = []
    for element, placed in zip(link.collisions, fit.exact, strict=True):
        assert isinstance(element.geometry, MeshFile)
        points = load_triangles(element.geometry).reshape(-1, 3)
        first = {p.tobytes(): k for k, p in reversed(list(enumerate(points)))}
        corners = [first[corner.tobytes()] for corner in placed.shape.vertices]
        hulls.append(
            {
                "corners": np.diff(corners, prepend=0).tolist(),
                "rounding": placed.shape.rounding,
                "model_error": placed.model_error,
            }
        )
    shapes = [as_dict(placed) for placed in fit.shapes]
    return {"shapes": shapes, "hulls": hulls, "contained": fit.contained}


def file_of(row: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The file of a row: arms and keys of links by robot; fits no other file has.

    Args:
        row: The row.
        folder: Its checkout.
    """
    robots: dict[str, dict[str, Any]] = {}
    fits: dict[str, dict[str, Any]] = {}
    settings = fit_link.__kwdefaults__.values()
    held = {key for path in FOLDER.glob("*.json") for key in ready_file(path)["fits"]}
    for name in row["robots"]:
        model = described(row, name, folder)
        print(name, flush=True)
        fitted = fit_robot(model)
        links = [link for link in model.links.values() if is_of_meshes(link)]
        keys = {link.name: fit_key(link, settings) for link in links}
        arms = [arm.name for arm in known_arms(model)]
        robots[name] = {"arms": arms, "links": keys}
        for link in links:
            key = keys[link.name]
            if key not in fits and key not in held:
                fits[key] = fit_row(fitted[link.name], link)
    return {"robots": robots, "fits": fits}


def main() -> None:
    """Write the files of the rows given, of all without any."""
    table = YAML(typ="safe", pure=True).load(TABLE)
    folder, *rows = sys.argv[1:]
    paths = {name: FOLDER / f"{name}.json" for name in rows or table}
    FOLDER.mkdir(exist_ok=True)
    for path in paths.values():
        # What it holds is made again.
        path.unlink(missing_ok=True)
    for name, path in paths.items():
        file = file_of(table[name], (Path(folder) / name).resolve())
        text = json.dumps(file, separators=(",", ":"))
        # A line for each fit.
        path.write_text(text.replace('},"', '},\n"') + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
