"""Picture of an octree, like the paper's Fig. 3: a slice, and the tree in space."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.errors import OctreeError
from armguard.geometry.cell_gap import cell_gap
from armguard.geometry.shapes import ShapeKind
from armguard.index.octree import Octree

Floats = NDArray[np.float64]

# Points along each side of the grid for the slice through the primitives.
GRID = 400


def draw_octree(
    octree: Octree, path: Path, *, title: str = "", height: float | None = None
) -> None:
    """Write a PNG: a horizontal slice, and all leaves with members in space.

    In the slice, leaves are squares shaded by the number of their members, and
    primitives are filled. Moving ones are drawn with their growth in the index.

    Args:
        octree: The tree.
        path: File to write.
        title: Heading.
        height: z of the slice [m]; the plane that meets most leaves if None.

    Raises:
        OctreeError: matplotlib is not installed.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        raise OctreeError(
            "pictures need matplotlib: pip install 'armguard[plot]'"
        ) from None
    leaves = octree.leaves()
    cells, counts = octree.cells(leaves), octree.state.nodes["members"][leaves]
    z = busiest_height(cells) if height is None else height
    figure = Figure(figsize=(14, 7), dpi=90)
    FigureCanvasAgg(figure)
    draw_slice(figure.add_subplot(1, 2, 1), octree, cells, counts, z)
    draw_space(figure.add_subplot(1, 2, 2, projection="3d"), cells, counts)
    figure.suptitle(
        f"{title}  N = {octree.leaf_capacity}, {len(leaves)} leaves, "
        f"{len(octree.world.kinds)} primitives"
    )
    figure.tight_layout()
    figure.savefig(path)


def busiest_height(cells: Floats) -> float:
    """Height of the horizontal plane that meets the most leaves [m]."""
    middles = (cells[:, 2] + cells[:, 5]) / 2.0
    met = [int(((cells[:, 2] < z) & (z < cells[:, 5])).sum()) for z in middles]
    return float(middles[int(np.argmax(met))])


def draw_slice(
    axes: Any, octree: Octree, cells: Floats, counts: NDArray[np.int32], z: float
) -> None:
    """Draw leaves and primitives in the plane at height z [m]."""
    from matplotlib.patches import Rectangle

    met = (cells[:, 2] <= z) & (z < cells[:, 5])
    for cell, count in zip(cells[met], counts[met], strict=True):
        axes.add_patch(
            Rectangle(
                (cell[0], cell[1]),
                cell[3] - cell[0],
                cell[4] - cell[1],
                facecolor="white" if count == 0 else (0.0, 0.35, 0.7, 0.08 * count),
                edgecolor="0.35",
                linewidth=0.8,
            )
        )
        if count:
            axes.text(cell[0], cell[4], f" {count}", va="top", fontsize=7, color="0.2")
    low, high = octree.low, octree.high
    x = np.linspace(low[0], high[0], GRID)
    y = np.linspace(low[1], high[1], GRID)
    world = octree.world
    for i in range(len(world.kinds)):
        gap = section(world.kinds[i], world.rows[i], x, y, z) - world.rows[i, 0]
        if gap.min() > world.growth[i]:
            continue
        moves = world.growth[i] > 0.0
        colour = "#d55e00" if moves else "0.45"
        axes.contourf(x, y, gap, levels=[-1e9, 0.0], colors=[colour], alpha=0.75)
        if moves:
            levels = [world.growth[i]]
            axes.contour(x, y, gap, levels=levels, colors=[colour], linestyles="--")
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.set_title(
        f"slice at z = {z:.2f} m; numbers: members of a leaf; orange: moving",
        fontsize=9,
    )


def section(kind: int, row: Floats, x: Floats, y: Floats, z: float) -> Floats:
    """Distance of a core to the points of a horizontal grid, shape (y, x) [m]."""
    gaps = np.empty((len(y), len(x)))
    reach = float(row[0]) + 1.0
    centre = row[1:4] if kind != ShapeKind.CAPSULE else (row[1:4] + row[4:7]) / 2.0
    size = {
        int(ShapeKind.SPHERE): 0.0,
        int(ShapeKind.CAPSULE): float(np.linalg.norm(row[4:7] - row[1:4])) / 2.0,
    }.get(int(kind), float(np.linalg.norm(row[4:7])))
    gaps[:] = np.inf
    near_y = np.abs(y - centre[1]) < size + reach
    near_x = np.abs(x - centre[0]) < size + reach
    for r in np.flatnonzero(near_y):
        for c in np.flatnonzero(near_x):
            gaps[r, c] = cell_gap(kind, row, x[c], y[r], z, x[c], y[r], z)
    return np.minimum(gaps, 1e6)


def draw_space(axes: Any, cells: Floats, counts: NDArray[np.int32]) -> None:
    """Draw the edges of the leaves with members, darker for more members."""
    from mpl_toolkits.mplot3d.art3d import Line3DCollection

    held = counts > 0
    corners = np.array([[c & 1, c >> 1 & 1, c >> 2 & 1] for c in range(8)])
    pairs = [(a, b) for a in range(8) for b in range(a) if bin(a ^ b).count("1") == 1]
    for cell, count in zip(cells[held], counts[held], strict=True):
        points = np.where(corners == 1, cell[3:], cell[:3])
        edges = [(points[a], points[b]) for a, b in pairs]
        shade = 0.12 + 0.16 * min(int(count), 5)
        axes.add_collection3d(
            Line3DCollection(edges, colors=[(0.0, 0.25, 0.55, shade)], linewidths=0.7)
        )
    axes.set_xlim(cells[:, 0].min(), cells[:, 3].max())
    axes.set_ylim(cells[:, 1].min(), cells[:, 4].max())
    axes.set_zlim(cells[:, 2].min(), cells[:, 5].max())
    axes.set_box_aspect((1, 1, 1))
    axes.set_title("leaves that hold something", fontsize=9)
