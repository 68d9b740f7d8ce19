"""Files of cell jobs: a scene, and the plans of each robot in it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

from pydantic import Field, ValidationError

from armguard.bounded import shown
from armguard.errors import did_you_mean
from armguard.maps.cell_plan import CellPlan, CoordinationError
from armguard.maps.coordination import CoordinationMap, Coordinator
from armguard.maps.line_cell import Conveyor, LineCell, LinePlan, Track
from armguard.plans.plan import Plan
from armguard.scene import Scene, load_scene
from armguard.scene.meshes import Progress
from armguard.scene.schema import (
    ByJoint,
    Name,
    NotNegative,
    Number,
    Positive,
    Strict,
    model_of,
    sentence_of,
)
from armguard.scene.yaml_source import YamlSource, dotted

# A plan has so many alternatives at most; the proofs of each take seconds.
MOST_ALTERNATIVES = 4

Row = Annotated[int, Field(ge=0)]


class PlanEntry(Strict):
    """The plan of one robot.

    Attributes:
        file: Its file, see `Plan.read`; relative to the job.
        interpolation: See `Plan.of`.
        following_error: See `CellPlan` [rad or m].
        skew: See `CellPlan` [s].
        names: See `CellPlan`.
        priority: See `CellPlan`.
    """

    file: Name
    interpolation: Literal["linear", "cubic", "quintic"] | None = None
    following_error: ByJoint[NotNegative] = 0.0
    skew: NotNegative = 0.0
    names: dict[Row, Name] = Field(default_factory=dict)
    priority: int = 1


class JobModel(Strict):
    """A cell job.

    Attributes:
        scene: Its scene file, relative to the job.
        floor: Least distance that links of two robots have to keep [m].
        plans: The plan of each robot.
    """

    scene: Name
    floor: NotNegative = 0.0
    plans: Annotated[dict[Name, PlanEntry], Field(min_length=2)]


class CellJob(NamedTuple):
    """A cell job as it is read.

    Attributes:
        scene: Its scene.
        floor: See `JobModel` [m].
        plans: The plan of each robot.
    """

    scene: Scene
    floor: float
    plans: dict[str, CellPlan]


def read_job(path: Path, progress: Progress | None = None) -> CellJob:
    """A cell job.

    Args:
        path: The job, YAML.
        progress: See `load_scene`.

    Raises:
        SceneFileError: The file is no cell job, or its scene file is wrong.
        TrajectoryError: A plan is no plan of its robot.
    """
    source = YamlSource(path)
    job = model_of(source, JobModel, PlanEntry)
    scene = load_scene(path.parent / job.scene, progress=progress)
    plans = {}
    for robot, entry in job.plans.items():
        if robot not in scene.robots:
            near = did_you_mean(robot, scene.robots)
            raise source.problem(("plans", robot), f"is no robot of the scene; {near}")
        plans[robot] = plan_of(robot, entry, path.parent, scene)
    return CellJob(scene, job.floor, plans)


def map_of(job: CellJob) -> CoordinationMap:
    """The map of a cell job.

    Raises:
        CoordinationError: The plans cannot be coordinated.
    """
    return Coordinator(job.scene, tuple(job.plans), floor=job.floor).map(job.plans)


def plan_of(robot: str, entry: PlanEntry, folder: Path, scene: Scene) -> CellPlan:
    """The plan of an entry."""
    plan = Plan.read(
        folder / entry.file, scene, interpolation=entry.interpolation, hold_home=True
    )
    errors = entry.following_error
    if isinstance(errors, dict):
        errors = {f"{robot}/{joint}": error for joint, error in errors.items()}
    return CellPlan(
        plan=plan,
        following_error=errors,
        skew=entry.skew,
        names=entry.names,
        priority=entry.priority,
    )


class TrackEntry(Strict):
    """The part of a plan that follows an item on the belt, see `Track`.

    Attributes:
        start: Where it begins, in time of the plan [s].
        end: Where it ends [s].
        at: Place of the item on the belt at `start` [m].
        speed: Speed of the belt for which the plan is made [m/s].
    """

    start: NotNegative
    end: Positive
    at: Number
    speed: Positive


class LinePlanEntry(PlanEntry):
    """A plan that jobs use.

    Attributes:
        robot: Its robot.
        follows: The part that follows the belt.
        alternatives: See `LinePlan`.
    """

    robot: Name
    follows: TrackEntry | None = None
    alternatives: Annotated[int, Field(ge=0, le=MOST_ALTERNATIVES)] = 0


class ConveyorEntry(Strict):
    """A belt.

    Attributes:
        slowest: Its least speed [m/s].
        fastest: Its greatest speed [m/s].
        speed: Its usual speed: that of a belt that is not measured [m/s].
    """

    slowest: NotNegative
    fastest: Positive
    speed: Positive


class JobEntry(Strict):
    """A job.

    Attributes:
        plans: Plans that can do it, that which is preferred first.
        offset: Place on the belt at which its item arrives [m].
    """

    plans: Annotated[tuple[Name, ...], Field(min_length=1)]
    offset: Number = 0.0


class ArrivalEntry(JobEntry):
    """A job that arrives.

    Attributes:
        t: When [s].
    """

    t: NotNegative


class LineJobModel(Strict):
    """A cell job of robots that are coordinated on line.

    Attributes:
        scene: Its scene file, relative to the job.
        floor: See `JobModel`.
        conveyor: The belt, if there is one.
        plans: Plans that jobs use, by name.
        jobs: Jobs that arrive, besides those that are read on line.
    """

    scene: Name
    floor: NotNegative = 0.0
    conveyor: ConveyorEntry | None = None
    plans: Annotated[dict[Name, LinePlanEntry], Field(min_length=2)]
    jobs: tuple[ArrivalEntry, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class LineJob:
    """A cell job that is ready to be executed on line.

    Attributes:
        scene: The scene.
        cell: What is proven of its plans.
        speed: Usual speed of the belt; 0 without one [m/s].
        arrivals: Jobs that arrive, by time.
    """

    scene: Scene
    cell: LineCell
    speed: float
    arrivals: tuple[ArrivalEntry, ...]


def read_line_job(
    path: Path, progress: Progress | None = None, *, more: bool = False
) -> LineJob:
    """A cell job for coordination on line, its plans proven against each other.

    Args:
        path: The job, YAML.
        progress: See `load_scene` and `LineCell.of`.
        more: Whether jobs are read on line as well, so that it need not have any.

    Raises:
        SceneFileError: The file is no such job, or its scene file is wrong.
        TrajectoryError: A plan is no plan of its robot.
        CoordinationError: The plans cannot be coordinated.
    """
    source = YamlSource(path)
    job = model_of(source, LineJobModel, LinePlanEntry)
    if not job.jobs and not more:
        sentence = "has none; give one, or read them on line with --jobs"
        raise source.problem(("jobs",), sentence)
    scene = load_scene(path.parent / job.scene, progress=progress)
    plans = line_plans(source, job, path.parent, scene)
    for k, arrival in enumerate(job.jobs):
        for name in arrival.plans:
            if name not in plans:
                near = did_you_mean(name, plans)
                raise source.problem(("jobs", k), f"'{name}' is no plan; {near}")
    belt, speed = None, 0.0
    if job.conveyor is not None:
        belt = Conveyor(job.conveyor.slowest, job.conveyor.fastest)
        speed = job.conveyor.speed
        if not belt.slowest <= speed <= belt.fastest:
            sentence = "must be from 'slowest' to 'fastest'"
            raise source.problem(("conveyor", "speed"), sentence)
    cell = LineCell.of(scene, plans, conveyor=belt, floor=job.floor, progress=progress)
    arrivals = tuple(sorted(job.jobs, key=lambda one: one.t))
    return LineJob(scene, cell, speed, arrivals)


def job_of(line: str) -> JobEntry:
    """A job on a line of text: a JSON object with the keys of `JobEntry`.

    Raises:
        CoordinationError: It is none.
    """
    try:
        return JobEntry.model_validate_json(line)
    except ValidationError as errors:
        error = errors.errors(include_url=False)[0]
    where, sentence = dotted(error["loc"]), sentence_of(dict(error))
    if error["type"] == "extra_forbidden":
        sentence = f"there is no such key; {did_you_mean(where, JobEntry.model_fields)}"
    elif error["type"] == "json_invalid":
        sentence = f"is no JSON: {error['ctx']['error']}"
    parts = filter(None, (f"'{shown(line)}'", where, sentence))
    raise CoordinationError(": ".join(parts))


def line_plans(
    source: YamlSource, job: LineJobModel, folder: Path, scene: Scene
) -> dict[str, LinePlan]:
    """Plans of a cell job for coordination on line, by name."""
    plans = {}
    for name, entry in job.plans.items():
        if entry.robot not in scene.robots:
            near = did_you_mean(entry.robot, scene.robots)
            keys = ("plans", name, "robot")
            raise source.problem(keys, f"'{entry.robot}' is no robot; {near}")
        plan = plan_of(entry.robot, entry, folder, scene)
        track = Track(**entry.follows.model_dump()) if entry.follows else None
        plans[name] = LinePlan(entry.robot, plan, track, entry.alternatives)
    return plans
