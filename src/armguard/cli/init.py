"""`armguard init`: a commented scene of one or two robots that `check` passes."""

import json
import os
from collections.abc import Mapping
from math import pi
from pathlib import Path
from typing import Annotated, Any

import typer
from typer import Option

from armguard.cli.console import loading_bar, out
from armguard.cli.drafts import SCHEMA, Draft, scene_text
from armguard.cli.home import is_free, verified_homes
from armguard.cli.plausibility import reaches, same
from armguard.errors import SceneError
from armguard.geometry import Box, Pose
from armguard.robot import load_urdf
from armguard.robot.model import JointKind, RobotModel
from armguard.robot.stopping import ASSUMPTION
from armguard.robot.stopping.figures import FIGURES
from armguard.scene import Scene, compile_scene, load_scene
from armguard.scene.file_models import scene_schema
from armguard.scene.inseparable import inseparable_links
from armguard.scene.posture import touching_fingers
from armguard.scene.robots import load_robot

# Names of the robots, by how many there are.
NAMES = {1: ("arm",), 2: ("left", "right")}

# Assumed figures of joints that turn and of joints that slide: least deceleration of a
# stop [rad/s², m/s²], and top speed where the robot's file has none [rad/s, m/s].
DECELERATION = 2.5, 0.5
VELOCITY = 3.2, 0.25

# A cycle may be late by this share of the period [-].
LATE_SHARE = 0.1

# Heights of the table's top that are tried, relative to the bases [m].
TOPS = (-0.02, -0.1, -0.3)

# Thickness of the table, and how far it extends beyond the bases [m].
THICKNESS = 0.05
BORDER = 0.5


def init(
    robot: Annotated[
        list[str],
        typer.Argument(help="One or two robots: names, or URDF, xacro or MJCF files."),
    ],
    output: Annotated[
        Path, Option("--output", "-o", help="The scene file to write.")
    ] = Path("scene.yaml"),
    rate: Annotated[
        float, Option(min=1.0, max=10_000.0, help="Cycles a second of your loop [Hz].")
    ] = 50.0,
    package: Annotated[
        list[str] | None, Option(help="Folder of `package://` names, as NAME=FOLDER.")
    ] = None,
    xacro_arg: Annotated[
        list[str] | None, Option(help="Argument of the xacro files, as NAME=VALUE.")
    ] = None,
    force: Annotated[bool, Option(help="Replace files that exist.")] = False,
) -> None:
    """Write a scene file for your robots.

    The file has comments, and beside it lies its JSON Schema for editors.
    """
    if len(robot) not in NAMES:
        raise SceneError(
            f"got {len(robot)} robots; give one or two, then add others to the file"
        )
    schema = output.with_name(SCHEMA)
    grammar = json.dumps(scene_schema(), indent=1) + "\n"
    for path, text in ((output, None), (schema, grammar)):
        if path.exists() and not force and path.read_text(encoding="utf-8") != text:
            raise SceneError(
                f"'{path}' exists; replace it with --force, or write elsewhere: "
                "-o OTHER_FOLDER/scene.yaml"
            )
    if not output.parent.is_dir():
        raise SceneError(f"folder '{output.parent}' does not exist; create it first")
    packages = {name: Path(at) for name, at in by_name("--package", package).items()}
    xacro_args = by_name("--xacro-arg", xacro_arg)
    drafts = [
        draft_of(name, source, output.parent, packages, xacro_args)
        for name, source in zip(NAMES[len(robot)], robot, strict=True)
    ]
    scene = arranged(drafts, 1.0 / rate)
    folders = {name: relative(at, output.parent) for name, at in packages.items()}
    write(output, scene_text(scene, drafts, output.name, folders))
    schema.write_text(grammar, encoding="utf-8")
    out.print(f"wrote {output} and {schema}", markup=False, soft_wrap=True)
    out.print(
        "next: replace the values marked ASSUMED, then `armguard check "
        f"{output}` and `armguard serve {output} --rate {rate:g} --view`",
        markup=False,
        soft_wrap=True,
    )


def by_name(option: str, given: list[str] | None) -> dict[str, str]:
    """Values of an option by name.

    Raises:
        SceneError: One has no name or no value.
    """
    found = {}
    for pair in given or []:
        name, _, value = pair.partition("=")
        if not name or not value:
            raise SceneError(f"{option} is '{pair}'; write {option} NAME=VALUE")
        found[name] = value
    return found


def draft_of(
    name: str,
    source: str,
    folder: Path,
    packages: Mapping[str, Path],
    xacro_args: dict[str, str],
) -> Draft:
    """A robot by name or by file, with assumed figures where it brings none.

    Args:
        name: Its name in the scene.
        source: Its name, or its file.
        folder: The scene file's folder.
        packages: Folders of packages by name.
        xacro_args: Arguments of a xacro file.
    """
    path = Path(source)
    is_file = path.is_file()
    beside = path.with_suffix(".srdf")
    srdf = beside if is_file and beside.is_file() else None
    own = xacro_args if path.suffix == ".xacro" else {}
    robot: str | RobotModel = source
    if is_file:
        robot = load_urdf(
            path, srdf=srdf, packages=packages, folder=folder, xacro_args=own
        )
    model, _, figures = load_robot(robot, srdf, packages)
    draft = Draft(name, source, model, is_named=not is_file, xacro_args=own)
    if is_file:
        draft.source = relative(path, folder)
        draft.srdf = relative(srdf, folder) if srdf else None
    if figures is None:
        draft.stopping = assumed_stopping(model)
    return draft


def relative(path: Path, folder: Path) -> str:
    """A path as seen from the folder of the scene file, never a robot's name."""
    found = Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()
    return found if "/" in found or "." in found else f"./{found}"


def assumed_stopping(model: RobotModel) -> dict[str, Any]:
    """Figures of a robot that brings none, each marked as an assumption."""
    ceiling = FIGURES["velocity"].ceiling
    slides = {
        name: model.joints[name].kind is JointKind.PRISMATIC for name in model.q_names
    }
    known = {name: model.joints[name].velocity for name in model.q_names}
    figures: dict[str, Any] = {
        "deceleration": same({name: DECELERATION[s] for name, s in slides.items()})
    }
    sources = {"deceleration": ASSUMPTION + "armguard init; measure it"}
    if any(speed is None or not 0.0 < speed <= ceiling for speed in known.values()):
        figures["velocity"] = same(
            {
                name: speed
                if speed and 0.0 < speed <= ceiling
                else VELOCITY[slides[name]]
                for name, speed in known.items()
            }
        )
        sources["velocity"] = ASSUMPTION + "armguard init; see its manual"
    return {**figures, "sources": sources}


def arranged(drafts: list[Draft], period: float) -> Scene:
    """The robots face each other above a table, at a free home.

    Raises:
        SceneError: No free home was found.
    """
    scene = Scene(
        period=float(f"{period:.6g}"), late=float(f"{LATE_SHARE * period:.6g}")
    )
    for draft in drafts:
        gap = 0.0
        if scene.robots:
            reach = max(reaches(scene, compile_scene(scene)).values())
            gap = max(round(reach, 1), 0.1)
            draft.base = Pose(xyz=(gap, 0.0, 0.0), rpy=(0.0, 0.0, round(pi, 4)))
        with loading_bar() as progress:
            scene.add_robot(
                draft.source if draft.is_named else draft.model,
                name=draft.name,
                base=draft.base,
                stopping=draft.stopping or None,
                gripper=draft.gripper,
                progress=progress,
            )
    for (a, b), reason in touching_fingers(scene, compile_scene(scene)).items():
        scene.allow(a, b, reason=reason)
    for pair in inseparable_links(scene, compile_scene(scene)):
        pair.settle(scene)
    reach = max(reaches(scene, compile_scene(scene)).values())
    last = drafts[-1].base.xyz[0]
    size = (last + 2.0 * BORDER, 2.0 * max(reach, BORDER), THICKNESS)
    for top in TOPS:
        at = Pose(xyz=(last / 2.0, 0.0, top - THICKNESS / 2.0))
        scene.add(Box(size=size), "table", pose=at)
        if is_free(scene, set()) or settle(scene, drafts):
            return scene
        scene.remove("table")
    if is_free(scene, set()) or settle(scene, drafts):
        return scene
    raise SceneError(
        "no posture was found in which no links touch; write the scene by hand, see "
        "docs/scene-file.md, and allow the pairs that `armguard check` names"
    )


def settle(scene: Scene, drafts: list[Draft]) -> bool:
    """Move all robots to a free home; whether there is one."""
    homes = verified_homes(scene, set(scene.robots))
    for draft in drafts:
        draft.home = homes.get(draft.name, {})
        if draft.home:
            scene.set_home(draft.name, draft.home)
    return bool(homes)


def write(path: Path, text: str) -> None:
    """Write a scene file that can be loaded, or none.

    Raises:
        SceneFileError: It cannot be loaded.
    """
    trial = path.with_name(f".{path.name}.new")
    try:
        trial.write_text(text, encoding="utf-8")
        load_scene(trial)
        trial.replace(path)
    finally:
        trial.unlink(missing_ok=True)
