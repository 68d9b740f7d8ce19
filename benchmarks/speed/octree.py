"""`bench octree`: the octree of the bay at home, audited, in numbers and a picture."""

from pathlib import Path
from typing import Any

from armguard.index import Octree
from armguard.index.picture import draw_octree
from armguard.respond import Guard
from armguard.scene import bay_scene
from timing import Progress

# Nothing is timed.
CYCLES = 0

PICTURE = Path("out/octree.png")


def bench(_: int, progress: Progress) -> dict[str, Any]:
    """Statistics of the tree; its picture is written to `out/octree.png`."""
    index = Guard(bay_scene(), progress=progress).index
    assert isinstance(index, Octree)
    index.check()
    PICTURE.parent.mkdir(exist_ok=True)
    draw_octree(index, PICTURE, title="bay")
    return {"audit": "passed", "picture": str(PICTURE), **index.statistics()}
