"""Light, floor and the first point of view."""

import numpy as np
import viser

from armguard.robot.kinematics import forward_kinematics
from armguard.scene.tables import SceneTables
from armguard.station.view.drawing.frames import Floats

# Behind the arms the camera stands this far, in extents of what they may reach [-].
BACK, ASIDE, ABOVE = 1.35, 0.85, 0.8

BACKGROUND = (238, 241, 244)


def set_stage(server: viser.ViserServer, tables: SceneTables) -> None:
    """Put up light and floor, and the camera where arms hide least."""
    scene = server.scene
    scene.set_up_direction("+z")
    scene.configure_default_lights(enabled=True, cast_shadow=False)
    scene.set_background_image(np.full((2, 2, 3), BACKGROUND, dtype=np.uint8))
    scene.add_grid(
        "/floor",
        width=8.0,
        height=8.0,
        plane="xy",
        cell_size=0.25,
        section_size=1.0,
        cell_color=(216, 220, 224),
        section_color=(192, 198, 204),
    )
    arms, middle, extent = whereabouts(tables)
    towards = arms - middle
    towards[2] = 0.0
    size = np.linalg.norm(towards)
    towards = towards / size if size > 0.05 else np.array([0.0, -1.0, 0.0])
    aside = np.array([-towards[1], towards[0], 0.0])
    eye = arms + extent * (BACK * towards + ASIDE * aside + [0.0, 0.0, ABOVE])
    server.initial_camera.position = eye
    server.initial_camera.look_at = (arms + middle) / 2.0


def whereabouts(tables: SceneTables) -> tuple[Floats, Floats, float]:
    """Middle of the arms, of all that is near them, and how far that extends [m]."""
    poses = np.zeros((len(tables.parent), 12))
    forward_kinematics(
        tables.home,
        tables.parent,
        tables.joint_kind,
        tables.q_index,
        tables.gain,
        tables.T_parent_joint,
        tables.axis,
        poses,
    )
    robots = [tables.links[part.tool].body for part in tables.robots]
    roots = [k for k, up in enumerate(tables.parent) if up < 0]
    places = poses[:, [3, 7, 11]]
    arms = places[[*robots, *roots]].mean(axis=0)
    tools = places[robots].mean(axis=0)
    base = places[roots].mean(axis=0)
    reach = float(np.linalg.norm(tools - base))
    middle = tools + (tools - base) * [1.0, 1.0, 0.0]
    spread = float(np.ptp(places, axis=0).max())
    return arms, middle, max(reach, spread, 0.5)
