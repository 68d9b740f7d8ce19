"""`armguard octree`: the tree of a scene, in numbers and as a picture."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from armguard.cli.console import Json, out, print_json, say, say_progress
from armguard.errors import OctreeError
from armguard.index import Octree
from armguard.index.picture import draw_octree
from armguard.respond import Guard
from armguard.scene import bay_path, load_scene


def octree(
    scene: Annotated[
        Path | None, Argument(help="Scene file; the bay if left out.")
    ] = None,
    png: Annotated[
        Path | None, Option(help="Write a picture of the tree here.")
    ] = None,
    json: Json = False,
) -> None:
    """Show the N-objects octree of a scene at home, audited."""
    path = bay_path() if scene is None else scene
    guard = Guard(load_scene(path, progress=say_progress), progress=say)
    index = guard.index
    if not isinstance(index, Octree):
        raise OctreeError(f"'{path.name}' requests brute force; there is no octree")
    index.check()
    answer = {"scene": path.name, "audit": "passed", **index.statistics()}
    if png is not None:
        draw_octree(index, png, title=path.name)
        answer["png"] = str(png)
    if json:
        print_json(answer)
        return
    for key, value in answer.items():
        out.print(f"{key.replace('_', ' '):24}{value}", markup=False)
