"""Scene files: own YAML, or a MoveIt planning scene, to a `Scene`."""

from collections.abc import Callable, Mapping
from math import inf
from pathlib import Path
from reprlib import Repr
from typing import Any

from pydantic import BaseModel, ValidationError

from armguard.bounded import is_file
from armguard.errors import ArmguardError, did_you_mean
from armguard.robot import load_urdf
from armguard.robot.stopping import FiguresError
from armguard.scene.file_models import (
    GripperModel,
    ObjectModel,
    RobotEntry,
    SceneModel,
)
from armguard.scene.file_parts import Place, object_parts, pose_of, triple
from armguard.scene.file_stopping import keys_of_figure, stopping_arguments
from armguard.scene.gripping import Grasp, Gripper
from armguard.scene.meshes import Progress
from armguard.scene.moveit import build_moveit_scene, is_moveit_scene
from armguard.scene.scene import Scene, check_figures
from armguard.scene.settings import CubeSettings, IndexSettings, ResponseSettings
from armguard.scene.yaml_source import Problem, SceneFileError, YamlSource, dotted

Keys = tuple[str | int, ...]

# Problems of one file that are reported; each takes a search for its line.
MOST_PROBLEMS = 20

# How values of a file appear in messages.
BRIEF = Repr()
BRIEF.maxlevel = 2


def load_scene(
    path: str | Path,
    *,
    robot: str | Path | None = None,
    progress: Progress | None = None,
) -> Scene:
    """Read a scene file.

    Args:
        path: Own YAML (docs/scene-file.md), or a MoveIt planning scene as it is.
        robot: URDF for a MoveIt scene, which only names its robot.
        progress: Called with what is done, its number and their count, before
            anything that takes long.

    Raises:
        SceneFileError: The file is wrong; each problem with file, line and key path.
    """
    source = YamlSource(Path(path))
    if is_moveit_scene(source.values):
        return build_moveit_scene(source, robot=robot, progress=progress)
    return build_scene(source, validated(source), progress)


def validated(source: YamlSource) -> SceneModel:
    """The file's values, checked against the grammar."""
    if not isinstance(source.values, dict):
        raise source.problem(1, "", "must be a mapping with the key 'robots'")
    try:
        return SceneModel.model_validate(source.values)
    except ValidationError as error:
        found = error.errors(include_url=False)[:MOST_PROBLEMS]
        problems = [as_problem(source, dict(e)) for e in found]
        raise SceneFileError(unique(problems)) from None


def unique(problems: list[Problem]) -> list[Problem]:
    """Problems without repetition, by line."""
    return sorted(dict.fromkeys(problems), key=lambda p: p.line)


def as_problem(source: YamlSource, error: dict[str, Any]) -> Problem:
    """One of pydantic's findings in our words."""
    keys = tuple(key for key in error["loc"] if not is_branch(key))
    got, context = error.get("input"), error.get("ctx", {})
    kind = str(error["type"])
    if kind == "extra_forbidden":
        known = known_keys(keys[:-1])
        sentence = f"there is no such key; {did_you_mean(str(keys[-1]), known)}"
    elif kind == "missing":
        sentence = "is missing"
    elif kind == "too_long" and isinstance(got, dict):
        count = context["max_length"]
        sentence = f"has {len(got):,} entries; the limit is {count:,}"
    elif kind in ("too_short", "too_long"):
        count = context.get("min_length") or context.get("max_length")
        if isinstance(got, dict) or count == 1:
            sentence = f"needs at least {count}"
        else:
            sentence = f"expected {count} numbers, got {context['actual_length']}"
    elif kind in ("float_parsing", "float_type", "int_parsing", "int_type"):
        sentence = f"expected a number, got {BRIEF.repr(got)}"
    elif kind == "finite_number":
        sentence = f"is {got}; it must be finite"
    elif kind in ("greater_than", "greater_than_equal", "less_than_equal"):
        sign = {"greater_than": ">", "greater_than_equal": ">="}.get(kind, "<=")
        bound = context.get("gt", context.get("ge", context.get("le")))
        sentence = f"is {BRIEF.repr(got)}; it must be {sign} {bound:g}"
    elif kind in ("list_type", "model_type", "dict_type"):
        wanted = "a list of numbers" if kind == "list_type" else "a mapping"
        sentence = f"expected {wanted}, got {BRIEF.repr(got)}"
    elif kind == "string_type":
        sentence = f"expected text, got {BRIEF.repr(got)}"
    elif kind == "string_too_short":
        sentence = "must not be empty"
    elif kind == "literal_error":
        sentence = f"is {BRIEF.repr(got)}; it must be {context['expected']}"
    else:
        sentence = str(error["msg"]).removeprefix("Value error, ")
    return Problem(source.path.name, source.line(keys), dotted(keys), sentence)


def is_branch(key: str | int) -> bool:
    """Whether a part of pydantic's path names a branch of a union, not a key."""
    return isinstance(key, str) and (
        key == "SizedBox" or key.startswith(("list[", "constrained-"))
    )


def known_keys(keys: Keys) -> list[str]:
    """Keys a mapping of the grammar may have, as a user writes them."""
    model: Any = SceneModel
    for key in keys:
        if isinstance(key, int) or model is None:
            continue
        if not (isinstance(model, type) and issubclass(model, BaseModel)):
            return []
        fields = {f.alias or name: f for name, f in model.model_fields.items()}
        if key in fields:
            model = inner_model(fields[key].annotation)
    if not (isinstance(model, type) and issubclass(model, BaseModel)):
        return []
    return [f.alias or name for name, f in model.model_fields.items()]


def inner_model(annotation: Any) -> Any:
    """The grammar's mapping inside an annotation, None if there is none."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for argument in getattr(annotation, "__args__", ()):
        found = inner_model(argument)
        if found is not None:
            return found
    return None


def build_scene(
    source: YamlSource, model: SceneModel, progress: Progress | None
) -> Scene:
    """Build a scene; errors of its parts get the line of their key."""
    cube = model.index.cube
    scene = Scene(
        mode=model.mode,
        period=model.cycle.period,
        late=model.cycle.late,
        buffer=model.buffer,
        margin=model.margin,
        index=IndexSettings(
            kind=model.index.kind,
            leaf_capacity=model.index.leaf_capacity,
            max_depth=model.index.max_depth,
            cube=None if cube is None else CubeSettings(triple(cube.centre), cube.edge),
        ),
    )
    problems: list[Problem] = []

    def attempt(keys: Keys, action: Callable[[], object]) -> None:
        if len(problems) >= MOST_PROBLEMS:
            return
        try:
            action()
        except FiguresError as error:
            entry = model.robots[str(keys[1])].stopping
            keys = (*keys, *keys_of_figure(error, entry))
            problems.append(
                Problem(source.path.name, source.line(keys), dotted(keys), str(error))
            )
        except ArmguardError as error:
            problems.append(
                Problem(source.path.name, source.line(keys), dotted(keys), str(error))
            )

    for name, robot in model.robots.items():
        attempt(
            ("robots", name),
            lambda n=name, r=robot: add_robot(  # type: ignore[misc]
                scene, source, n, r, model.packages, progress
            ),
        )
    for name, thing in model.objects.items():
        attempt(
            ("objects", name),
            lambda n=name, t=thing: add_object(  # type: ignore[misc]
                scene, source, n, t, model.packages, progress
            ),
        )
    if not problems:
        for k, allow in enumerate(model.allow):
            attempt(
                ("allow", k),
                lambda p=allow: scene.allow(p.a, p.b, reason=p.reason),  # type: ignore[misc]
            )
        for k, pair in enumerate(model.buffers):
            attempt(
                ("buffers", k),
                lambda p=pair: scene.set_buffer(p.a, p.b, p.buffer),  # type: ignore[misc]
            )
        for name in scene.robots:
            attempt(
                ("robots", name),
                lambda n=name: check_figures(scene.robots[n]),  # type: ignore[misc]
            )
    if not problems:
        attempt(("margin",), scene.validate)
    if problems:
        raise SceneFileError(unique(problems))
    return scene


def add_object(
    scene: Scene,
    source: YamlSource,
    name: str,
    entry: ObjectModel,
    packages: Mapping[str, str],
    progress: Progress | None,
) -> None:
    """Add an object of the file; relative paths count from the file's folder."""
    scene.add(
        object_parts(entry, place_of(source, packages), progress),
        name=name,
        pose=pose_of(entry.at),
        attached_to=entry.attached_to,
        buffer=entry.buffer,
        present=entry.present,
        top_speed=entry.top_speed,
        person=entry.person,
        graspable=entry.graspable
        if isinstance(entry.graspable, bool)
        else Grasp(**entry.graspable.model_dump()),
        rests_on=entry.rests_on,
        error=entry.error,
        stale=inf if entry.stale is None else entry.stale,
    )


def place_of(source: YamlSource, packages: Mapping[str, str]) -> Place:
    """Where paths of a scene file count from, and the folders it declares."""
    folder = source.path.resolve().parent
    return Place(folder, {name: folder / path for name, path in packages.items()})


def gripper_of(entry: GripperModel) -> Gripper:
    """A gripper of the file."""
    return Gripper(
        link=entry.link,
        fingers=tuple(entry.fingers),
        coarse=entry.coarse,
        swap=entry.swap,
    )


def add_robot(
    scene: Scene,
    source: YamlSource,
    name: str,
    entry: RobotEntry,
    packages: Mapping[str, str],
    progress: Progress | None,
) -> None:
    """Add a robot of the file; relative paths count from the file's folder."""
    place = place_of(source, {**packages, **entry.packages})
    folder = place.folder
    beside = folder / entry.urdf
    srdf = None if entry.srdf is None else folder / entry.srdf
    named = not ({"/", "."} & set(entry.urdf) or is_file(beside))
    scene.add_robot(
        entry.urdf
        if named
        else load_urdf(beside, srdf=srdf, packages=place.packages, folder=folder),
        name=name,
        base=pose_of(entry.base),
        srdf=srdf,
        buffer=entry.buffer,
        mode=entry.mode,
        stopping=None
        if entry.stopping is None
        else stopping_arguments(entry.stopping, folder),
        response=entry.response
        if isinstance(entry.response, str)
        else ResponseSettings(**entry.response.model_dump()),
        gripper=None if entry.gripper is None else gripper_of(entry.gripper),
        fit_target=entry.fit_target,
        max_primitives=entry.max_primitives,
        home=entry.home,
        progress=progress,
    )  # fmt: skip
