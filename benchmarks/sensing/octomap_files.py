"""Trees of OctoMap, written cell by cell."""

import numpy as np

# Levels of a tree, and two bits of a child.
DEPTH = 16
FREE, OCCUPIED, DIVIDED = 1, 2, 3


def nodes_of(occupied, free, corner, edge):
    """Children of the divided nodes of a part of a grid, in the order of a file.

    Args:
        occupied: Grid by x, y, z about the tree's origin.
        free: Grid of the same shape.
        corner: Lower corner of the part [cells].
        edge: Its edge [cells].
    """
    half, node, below = edge // 2, 0, []
    shift = len(occupied) // 2
    for k in range(8):
        child = corner + half * np.array([k & 1, k >> 1 & 1, k >> 2])
        low = np.clip(child + shift, 0, len(occupied))
        high = np.clip(child + half + shift, 0, len(occupied))
        part = tuple(slice(a, b) for a, b in zip(low, high, strict=True))
        full = (high - low == half).all()
        if full and occupied[part].all():
            node |= OCCUPIED << 2 * k
        elif full and free[part].all():
            node |= FREE << 2 * k
        elif (occupied[part] | free[part]).any():
            node |= DIVIDED << 2 * k
            below += nodes_of(occupied, free, child, half)
    return [node, *below]


def nodes(occupied, free=None):
    """Children of all divided nodes, as 16 bits each."""
    free = np.zeros_like(occupied) if free is None else free
    corner = np.full(3, -(2 ** (DEPTH - 1)))
    found = nodes_of(occupied, free, corner, 2**DEPTH)
    return np.array(found, dtype="<u2").tobytes()


def body_of(occupied):
    """Body of a file as FCL's octree wants it: signed bytes, without the header."""
    return np.frombuffer(nodes(occupied), dtype=np.int8)


def write_octomap(path, cell, occupied, free=None):
    """Write a tree whose cells are those of grids about the origin."""
    body = nodes(occupied, free)
    header = f"# Octomap OcTree binary file\nid OcTree\nsize {len(body) // 2}\n"
    path.write_bytes(f"{header}res {cell}\ndata\n".encode() + body)
