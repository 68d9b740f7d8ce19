"""What is where: robots, objects, allowed pairs, scene files; flat tables."""

from armguard.scene.bay import bay_path, bay_scene, bay_task
from armguard.scene.compile import compile_scene
from armguard.scene.file import load_scene
from armguard.scene.gripping import Grasp, Gripper
from armguard.scene.meshes import Surface, convex_pieces, mesh_hull
from armguard.scene.scene import Scene
from armguard.scene.tables import SceneTables
from armguard.scene.trajectory import Trajectory, load_trajectory
from armguard.scene.two_pandas import two_pandas_path, two_pandas_scene

__all__ = [
    "Grasp",
    "Gripper",
    "Scene",
    "SceneTables",
    "Surface",
    "Trajectory",
    "bay_path",
    "bay_scene",
    "bay_task",
    "compile_scene",
    "convex_pieces",
    "load_scene",
    "load_trajectory",
    "mesh_hull",
    "two_pandas_path",
    "two_pandas_scene",
]
