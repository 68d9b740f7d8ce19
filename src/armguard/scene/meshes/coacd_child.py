"""Child process of `cutting`: a mesh in, the points of its convex pieces out.

Run as `python coacd_child.py MESH.npz PIECES.npz CONCAVITY MAX_PIECES`.
"""

import sys

import coacd
import numpy as np

# Every run cuts alike.
SEED = 0


def main(given: str, made: str, concavity: str, max_pieces: str) -> None:
    """Cut the mesh."""
    with np.load(given) as held:
        mesh = coacd.Mesh(held["vertices"], held["faces"])
    coacd.set_log_level("error")
    found = coacd.run_coacd(
        mesh, threshold=float(concavity), max_convex_hull=int(max_pieces), seed=SEED
    )
    if not found:
        sys.exit("no piece came of it")
    np.savez(made, *(vertices for vertices, _ in found))


if __name__ == "__main__":
    main(*sys.argv[1:])
