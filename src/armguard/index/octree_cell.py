"""Does a primitive inhabit a cell, and how far is it from changing its mind."""

from armguard.geometry.cell_gap import cell_gap
from armguard.index.octree_state import BORDER, OctreeState
from armguard.index.world import World
from armguard.kernel import kernel

# How far beyond a primitive's own box an outermost cell is thought to reach [m]. Any
# positive length serves: it only has to be outside the primitive.
BEYOND = 1.0


@kernel
def grown_gap(i: int, node: int, world: World, state: OctreeState) -> float:
    """Distance between a grown primitive and a cell [m]; it inhabits the cell if <= 0.

    The distance of the core to the cell minus the radius and the growth, so that a
    negative value says how far the core may withdraw before the primitive leaves. Far
    away, a lower bound of it.
    Cells at the root's border reach outwards without end: a primitive that leaves the
    root cube stays in the tree.

    A NaN row gives NaN, which callers must read as "inhabits".
    """
    cells, border = state.cells, state.nodes[node, BORDER]
    x0, y0, z0 = cells[node, 0], cells[node, 1], cells[node, 2]
    x1, y1, z1 = cells[node, 3], cells[node, 4], cells[node, 5]
    box = world.boxes[i]
    if border:
        if border & 1:
            x0 = min(x0, box[0] - BEYOND)
        if border & 2:
            y0 = min(y0, box[1] - BEYOND)
        if border & 4:
            z0 = min(z0, box[2] - BEYOND)
        if border & 8:
            x1 = max(x1, box[3] + BEYOND)
        if border & 16:
            y1 = max(y1, box[4] + BEYOND)
        if border & 32:
            z1 = max(z1, box[5] + BEYOND)
    # A box round the primitive that is too far away settles it; what is left for the
    # exact test is near, or inside. The gap of the box is a bound from below.
    apart = max(x0 - box[3], box[0] - x1)
    apart = max(apart, y0 - box[4], box[1] - y1)
    apart = max(apart, z0 - box[5], box[2] - z1)
    if apart > world.growth[i]:
        return float(apart - world.growth[i])
    row = world.rows[i]
    gap = cell_gap(world.kinds[i], row, x0, y0, z0, x1, y1, z1)
    return float(gap - row[0] - world.growth[i])
