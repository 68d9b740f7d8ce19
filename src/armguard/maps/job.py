"""Files of cell jobs: a scene, and the plan of each robot in it."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from armguard.errors import did_you_mean
from armguard.maps.cell_plan import CellPlan
from armguard.maps.coordination import CoordinationMap, Coordinator
from armguard.plans.plan import Plan
from armguard.scene import Scene, load_scene
from armguard.scene.meshes import Progress
from armguard.scene.schema import (
    ByJoint,
    Name,
    NotNegative,
    Strict,
    model_of,
)
from armguard.scene.yaml_source import YamlSource

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


def read_job(path: Path, progress: Progress | None = None) -> CoordinationMap:
    """The map of a cell job.

    Args:
        path: The job, YAML.
        progress: See `load_scene`.

    Raises:
        SceneFileError: The file is no cell job, or its scene file is wrong.
        TrajectoryError: A plan is no plan of its robot.
        CoordinationError: The plans cannot be coordinated.
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
    coordinator = Coordinator(scene, tuple(plans), floor=job.floor)
    return coordinator.map(plans)


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
