"""Real-time collision guard for robot arms: joint angles in, verdicts out.

Example:
    >>> import armguard as ag
    >>> guard = ag.Guard(ag.bay_scene())
    >>> verdict = guard.step(guard.home)
    >>> verdict.level.name
    'CLEAR'
"""

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from armguard.batch.checker import Checker
    from armguard.batch.results import NearestPairs, ProvenMotions, Witnesses
    from armguard.cells.cell_map import CellMap
    from armguard.cells.region_trees import RegionHits, RegionTrees
    from armguard.cells.view import CellView, NearestCell, NearestCells
    from armguard.errors import (
        ArmguardError,
        CellMapError,
        GraspError,
        HomeContactError,
        MeshError,
        ModelError,
        OctreeError,
        PoseError,
        SceneError,
        SelfTestError,
        ShapeError,
        TrajectoryError,
        UnknownNameError,
    )
    from armguard.geometry import (
        SHAPES,
        Box,
        Capsule,
        Cone,
        Cylinder,
        Ellipsoid,
        HalfSpace,
        Hull,
        PlacedShape,
        Pose,
        Proximities,
        Proximity,
        Sphere,
        SupportShape,
        Triangle,
        distance,
        distances,
        register_shape,
    )
    from armguard.guard import (
        Contract,
        Counts,
        Level,
        NearPair,
        Reason,
        Region,
        Verdict,
    )
    from armguard.index import BruteForce, Octree
    from armguard.maps.cell_plan import CellPlan, CoordinationError
    from armguard.maps.coordination import (
        CoordinationMap,
        Coordinator,
        coordination_map,
    )
    from armguard.maps.interlocks import Interlock
    from armguard.maps.schedule import Schedule
    from armguard.plans.plan import Plan
    from armguard.plans.proof import PlanProof
    from armguard.plans.verify import PlanVerifier, verify
    from armguard.prove.paving import NearestPlace, NearInterval
    from armguard.respond import Action, Command, Guard, Held
    from armguard.robot.stopping import StoppingFigures, StopTable, stopping_figures
    from armguard.scene import (
        Grasp,
        Gripper,
        Scene,
        Trajectory,
        bay_scene,
        bay_task,
        load_scene,
        load_trajectory,
    )
    from armguard.sense import Intake, Sense, SensorHealth
    from armguard.service.client import Client, SensorClient

__version__ = version("armguard")

# Public names and the room each comes from. They are imported when first used, so
# that `import armguard` is quick and a scene can be read without compiling anything.
_ROOMS = {
    "armguard.batch.checker": ("Checker",),
    "armguard.batch.results": ("NearestPairs", "ProvenMotions", "Witnesses"),
    "armguard.cells.cell_map": ("CellMap",),
    "armguard.cells.region_trees": ("RegionHits", "RegionTrees"),
    "armguard.cells.view": ("CellView", "NearestCell", "NearestCells"),
    "armguard.errors": (
        "ArmguardError",
        "CellMapError",
        "GraspError",
        "HomeContactError",
        "MeshError",
        "ModelError",
        "OctreeError",
        "PoseError",
        "SceneError",
        "SelfTestError",
        "ShapeError",
        "TrajectoryError",
        "UnknownNameError",
    ),
    "armguard.geometry": (
        "SHAPES",
        "Box",
        "Capsule",
        "Cone",
        "Cylinder",
        "Ellipsoid",
        "HalfSpace",
        "Hull",
        "PlacedShape",
        "Pose",
        "Proximities",
        "Proximity",
        "Sphere",
        "SupportShape",
        "Triangle",
        "distance",
        "distances",
        "register_shape",
    ),
    "armguard.guard": (
        "Contract",
        "Counts",
        "Level",
        "NearPair",
        "Reason",
        "Region",
        "Verdict",
    ),
    "armguard.index": ("BruteForce", "Octree"),
    "armguard.maps.cell_plan": ("CellPlan", "CoordinationError"),
    "armguard.maps.coordination": (
        "CoordinationMap",
        "Coordinator",
        "coordination_map",
    ),
    "armguard.maps.interlocks": ("Interlock",),
    "armguard.maps.schedule": ("Schedule",),
    "armguard.plans.plan": ("Plan",),
    "armguard.plans.proof": ("PlanProof",),
    "armguard.plans.verify": ("PlanVerifier", "verify"),
    "armguard.prove.paving": ("NearInterval", "NearestPlace"),
    "armguard.respond": ("Action", "Command", "Guard", "Held"),
    "armguard.robot.stopping": ("StopTable", "StoppingFigures", "stopping_figures"),
    "armguard.scene": (
        "Grasp",
        "Gripper",
        "Scene",
        "Trajectory",
        "bay_scene",
        "bay_task",
        "load_scene",
        "load_trajectory",
    ),
    "armguard.sense": ("Intake", "Sense", "SensorHealth"),
    "armguard.service.client": ("Client", "SensorClient"),
}
_ROOM_OF = {name: room for room, names in _ROOMS.items() for name in names}

__all__ = [
    "SHAPES",
    "Action",
    "ArmguardError",
    "Box",
    "BruteForce",
    "Capsule",
    "CellMap",
    "CellMapError",
    "CellPlan",
    "CellView",
    "Checker",
    "Client",
    "Command",
    "Cone",
    "Contract",
    "CoordinationError",
    "CoordinationMap",
    "Coordinator",
    "Counts",
    "Cylinder",
    "Ellipsoid",
    "Grasp",
    "GraspError",
    "Gripper",
    "Guard",
    "HalfSpace",
    "Held",
    "HomeContactError",
    "Hull",
    "Intake",
    "Interlock",
    "Level",
    "MeshError",
    "ModelError",
    "NearInterval",
    "NearPair",
    "NearestCell",
    "NearestCells",
    "NearestPairs",
    "NearestPlace",
    "Octree",
    "OctreeError",
    "PlacedShape",
    "Plan",
    "PlanProof",
    "PlanVerifier",
    "Pose",
    "PoseError",
    "ProvenMotions",
    "Proximities",
    "Proximity",
    "Reason",
    "Region",
    "RegionHits",
    "RegionTrees",
    "Scene",
    "SceneError",
    "Schedule",
    "SelfTestError",
    "Sense",
    "SensorClient",
    "SensorHealth",
    "ShapeError",
    "Sphere",
    "StopTable",
    "StoppingFigures",
    "SupportShape",
    "Trajectory",
    "TrajectoryError",
    "Triangle",
    "UnknownNameError",
    "Verdict",
    "Witnesses",
    "bay_scene",
    "bay_task",
    "coordination_map",
    "distance",
    "distances",
    "load_scene",
    "load_trajectory",
    "register_shape",
    "stopping_figures",
    "verify",
]


def __getattr__(name: str) -> Any:
    """Import a public name from its room."""
    if name not in _ROOM_OF:
        raise AttributeError(f"module 'armguard' has no attribute '{name}'")
    return getattr(import_module(_ROOM_OF[name]), name)


def __dir__() -> list[str]:
    """Public names."""
    return __all__
