"""The world before the first cycle: all robots at home, all primitives indexed."""

import numpy as np
from numpy.typing import NDArray

from armguard.geometry.bounds import row_bounds
from armguard.geometry.place import place_row
from armguard.index import BruteForce, JointTable, Octree, World
from armguard.index.joint_cells import JointCells, no_cells
from armguard.kernel import kernel
from armguard.motion.joint_links import fixed_primitives, joint_links
from armguard.robot.kinematics import forward_kinematics
from armguard.scene.tables import SceneTables

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


def world_at_home(tables: SceneTables, T_world: NDArray[np.float64]) -> World:
    """The primitives, placed at the home configuration; `T_world` is written."""
    world = World(
        kinds=tables.kinds,
        rows=tables.local_rows.copy(),
        boxes=np.zeros((len(tables.kinds), 6)),
        owners=tables.owners,
        growth=tables.growth,
    )
    forward_kinematics(
        tables.home,
        tables.parent,
        tables.joint_kind,
        tables.q_index,
        tables.gain,
        tables.T_parent_joint,
        tables.axis,
        T_world,
    )
    place_all(tables.kinds, tables.bodies, tables.local_rows, T_world, world)
    return world


@kernel(inline=False, entry=True)
def place_all(
    kinds: Ints, bodies: Ints, local_rows: Floats, T_world: Floats, world: World
) -> None:
    """Write the world row and the bounding box of every primitive."""
    for i in range(kinds.shape[0]):
        if bodies[i] >= 0:
            place_row(kinds[i], local_rows[i], T_world[bodies[i]], world.rows[i])
        row_bounds(kinds[i], world.rows[i], 0.0, world.boxes[i])


def joint_cells_of(index: Octree | BruteForce) -> JointCells:
    """The joint-space table of an index; without links if it is another index."""
    return index.cells if isinstance(index, JointTable) else no_cells()


def build_index(tables: SceneTables, world: World) -> Octree | BruteForce:
    """The index that the scene declares: octree, joint-space table or brute force."""
    if tables.index.kind == "brute_force":
        return BruteForce(world)
    if tables.index.kind == "joint_table":
        return JointTable(
            world, joint_links(tables), fixed_primitives(tables), reach=tables.margin
        )
    return Octree(
        world,
        leaf_capacity=tables.index.leaf_capacity,
        max_depth=tables.index.max_depth,
        cube=(tables.cube_centre, tables.cube_edge),
    )
