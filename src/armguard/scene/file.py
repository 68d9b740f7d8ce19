"""Scene files: own YAML, or a MoveIt planning scene, to a `Scene`."""

import logging
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from armguard.bounded import is_file
from armguard.errors import ArmguardError, did_you_mean
from armguard.geometry.shapes import PlacedShape
from armguard.robot import load_urdf
from armguard.robot.model import RobotModel
from armguard.robot.stopping import FiguresError
from armguard.scene.file_models import (
    RobotEntry,
    SceneModel,
    keys_of_figure,
    known_keys,
    stopping_arguments,
)
from armguard.scene.file_shapes import Place
from armguard.scene.meshes import Progress, Surface
from armguard.scene.moveit import build_moveit_scene, is_moveit_scene
from armguard.scene.region import check_region
from armguard.scene.robots import (
    SceneRobot,
    lacking_figures,
    stopping_line,
    without_figures,
)
from armguard.scene.scene import Scene
from armguard.scene.schema import keys_of, part_of, sentence_of
from armguard.scene.sensing import ReflexSettings, SensingSettings
from armguard.scene.sensors import SensorSettings
from armguard.scene.settings import ObjectSettings, RobotSettings
from armguard.scene.yaml_source import Keys, Problem, SceneFileError, YamlSource

log = logging.getLogger("armguard")

# Suffixes of files that describe a robot, not a scene.
ROBOT_FILES = (".urdf", ".xacro", ".xml")

# Problems of one file that are reported; each takes a search for its line.
MOST_PROBLEMS = 20


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
        progress: Called with the step, its number and their count, before
            anything that takes long.

    Raises:
        SceneFileError: The file is wrong; each problem with file, line and key path.
    """
    source = YamlSource(Path(path))
    if is_moveit_scene(source.values):
        return build_moveit_scene(source, robot=robot, progress=progress)
    return build_scene(source, validated(source), progress)


def stated_cycle(path: str | Path) -> dict[str, float]:
    """The `period` and `late` that a scene file states, by name [s].

    Raises:
        SceneFileError: The file is wrong.
    """
    source = YamlSource(Path(path))
    if is_moveit_scene(source.values):
        return {}
    cycle, stated = validated(source).cycle, source.values.get("cycle") or {}
    return {name: getattr(cycle, name) for name in ("period", "late") if name in stated}


def validated(source: YamlSource) -> SceneModel:
    """The file's values, checked against the grammar.

    Raises:
        SceneFileError: They do not follow it.
    """
    if not isinstance(source.values, dict):
        robot = source.path.suffix.lower() in ROBOT_FILES
        hint = f"; for a scene of this robot: armguard init {source.path}" * robot
        raise source.problem((), f"must be a mapping with the key 'robots'{hint}")
    try:
        model = SceneModel.model_validate(source.values)
        return model
    except ValidationError as errors:
        found = errors.errors(include_url=False)[:MOST_PROBLEMS]
    problems = Problems(source)
    for error in found:
        keys = keys_of(error["loc"])
        if error["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
            known = known_keys(keys[:-1])
            near, rate = did_you_mean(str(keys[-1]), known), error["input"]
            if keys == ("cycle", "rate") and isinstance(rate, int | float) and rate > 0:
                near = f"give the period, {{period: {1.0 / rate:.4g}}}"
            sentence = f"there is no such key; {near}"
        else:
            sentence = sentence_of(dict(error))
        known = known_keys(keys)[:6]
        if sentence.startswith("expected a mapping, got") and known:
            sentence += f"; its keys are {', '.join(known)}"
        problems.add(keys, sentence)
    raise problems.error()


class Problems:
    """What is wrong in a file, collected.

    Args:
        source: The file.
    """

    def __init__(self, source: YamlSource) -> None:
        self.source = source
        self._found: list[Problem] = []

    def __len__(self) -> int:
        """How many there are."""
        return len(self._found)

    def add(self, keys: Keys, sentence: str, **remedy: Any) -> None:
        """Add one, with the fields of its remedy, unless there are enough."""
        if len(self) < MOST_PROBLEMS:
            found = self.source.found(keys, sentence)
            self._found.append(replace(found, **remedy))

    @contextmanager
    def at(self, *keys: str | int) -> Iterator[None]:
        """Whatever goes wrong inside is a problem of these keys."""
        try:
            yield
        except FiguresError as error:
            entry = self.source.values["robots"][keys[1]].get("stopping")
            self.add((*keys, *keys_of_figure(error, entry)), str(error))
        except ArmguardError as error:
            self.add(keys, str(error))

    def error(self) -> SceneFileError:
        """All of them by line, each once."""
        return SceneFileError(
            sorted(dict.fromkeys(self._found), key=lambda problem: problem.line)
        )


class Draft(Scene):
    """A scene without primitives around its links: what its files say, unread meshes.

    Everything that needs no mesh is checked on it, before one is read or fitted.
    """

    def _fitted(self, robot: SceneRobot, progress: Progress | None) -> SceneRobot:
        return robot


@contextmanager
def each_line_once() -> Iterator[None]:
    """Drop repeated lines of the log: a draft and its scene warn of the same values."""
    written = set[str]()

    def is_new(record: logging.LogRecord) -> bool:
        line = record.getMessage()
        new = line not in written
        written.add(line)
        return new

    log.addFilter(is_new)
    try:
        yield
    finally:
        log.removeFilter(is_new)


@each_line_once()
def build_scene(
    source: YamlSource, model: SceneModel, progress: Progress | None
) -> Scene:
    """Build a scene; errors of its parts get the line of their key.

    Raises:
        SceneFileError: A part cannot be built, or parts contradict each other.
    """
    problems = Problems(source)
    place = place_of(source.path.resolve().parent, model.packages)
    robots = robot_sources(model, place, problems)
    parts = parts_of_objects(model, replace(place, reads=False), problems, None)
    fill(Draft(**scene_settings(model)), model, robots, parts, problems)
    if problems:
        raise problems.error()
    parts = parts_of_objects(model, place, problems, progress)
    scene = Scene(**scene_settings(model))
    if not problems:
        fill(scene, model, robots, parts, problems, progress)
    if problems:
        raise problems.error()
    return scene


def scene_settings(model: SceneModel) -> dict[str, Any]:
    """Arguments of `Scene`."""
    return {
        "mode": model.mode,
        "period": model.cycle.period,
        "late": model.cycle.late,
        "buffer": model.buffer,
        "margin": model.margin,
        "index": model.index,
    }


def parts_of_objects(
    model: SceneModel, place: Place, problems: Problems, progress: Progress | None
) -> dict[str, list[Surface | PlacedShape]]:
    """Parts of each object that can be read."""
    parts = {}
    for name, entry in model.objects.items():
        if len(problems) == MOST_PROBLEMS:
            break
        with problems.at("objects", name):
            parts[name] = entry.parts_of_all(place, progress)
    return parts


def fill(
    scene: Scene,
    model: SceneModel,
    robots: Mapping[str, str | RobotModel],
    parts: Mapping[str, list[Surface | PlacedShape]],
    problems: Problems,
    progress: Progress | None = None,
) -> None:
    """Add robots, objects and rules of the file to a scene.

    Args:
        scene: The scene.
        model: The file.
        robots: See `robot_sources`.
        parts: Parts of the objects.
        problems: Receives what is wrong.
        progress: See `load_scene`.
    """
    folder = problems.source.path.resolve().parent
    for name, urdf in robots.items():
        with problems.at("robots", name):
            add_robot(scene, name, model.robots[name], urdf, folder, progress)
    for name, own in parts.items():
        if len(problems) == MOST_PROBLEMS:
            break
        with problems.at("objects", name):
            entry = model.objects[name]
            settings = part_of(entry, ObjectSettings)
            scene.add(own, name=name, pose=entry.at.pose(), **settings)
    if not problems:
        for k, allow in enumerate(model.allow):
            with problems.at("allow", k):
                scene.allow(allow.a, allow.b, reason=allow.reason)
        for k, pair in enumerate(model.buffers):
            with problems.at("buffers", k):
                scene.set_buffer(pair.a, pair.b, pair.buffer)
    for name, sensor in model.sensors.items():
        with problems.at("sensors", name):
            settings = part_of(sensor, SensorSettings)
            scene.add_sensor(name, pose=sensor.at.pose(), **settings)
    if model.reflex is not None and not problems:
        with problems.at("reflex"):
            scene.set_reflex(**part_of(model.reflex, ReflexSettings))
    if model.sensing is not None and not problems:
        with problems.at("sensing"):
            settings = part_of(model.sensing, SensingSettings)
            scene.set_sensing(**settings, zones=model.sensing.scene_zones())
    for group in lacking_figures(scene.robots.values()):
        problems.add(
            ("robots", group[0].name),
            without_figures(group),
            robots=tuple(robot.name for robot in group),
            paste=stopping_line(group[0].model),
        )
    if scene.sensing is not None and not problems:
        with problems.at("sensing", "region"):
            check_region(scene.sensing, scene.robots.values())
    if not problems:
        with problems.at("margin"):
            scene.validate()


def place_of(folder: Path, packages: Mapping[str, str]) -> Place:
    """Where files of a scene may be; paths of packages count from its folder."""
    return Place(folder, {name: folder / path for name, path in packages.items()})


def robot_sources(
    model: SceneModel, place: Place, problems: Problems
) -> dict[str, str | RobotModel]:
    """Each robot's model, or its name if it is one by name."""
    found: dict[str, str | RobotModel] = {}
    for name, entry in model.robots.items():
        beside = place.folder / entry.urdf
        if not ({"/", "."} & set(entry.urdf) or is_file(beside)):
            found[name] = entry.urdf
            continue
        with problems.at("robots", name):
            own = place_of(place.folder, {**model.packages, **entry.packages})
            srdf = None if entry.srdf is None else own.folder / entry.srdf
            found[name] = load_urdf(
                beside,
                srdf=srdf,
                packages=own.packages,
                folder=own.folder,
                xacro_args=entry.xacro_args,
            )
    return found


def add_robot(
    scene: Scene,
    name: str,
    entry: RobotEntry,
    urdf: str | RobotModel,
    folder: Path,
    progress: Progress | None,
) -> None:
    """Add a robot of the file."""
    scene.add_robot(
        urdf,
        name=name,
        base=entry.base.pose(),
        srdf=None if entry.srdf is None else folder / entry.srdf,
        stopping=None
        if entry.stopping is None
        else stopping_arguments(entry.stopping, folder),
        home=entry.home,
        progress=progress,
        **part_of(entry, RobotSettings),
    )
