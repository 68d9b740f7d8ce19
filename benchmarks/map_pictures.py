"""Draws docs/images/map_cell.png and map_slice.png, from examples/cell.

python benchmarks/map_pictures.py
"""

from pathlib import Path

from armguard.maps.job import map_of, read_job
from armguard.maps.picture import draw_map, draw_slice
from armguard.maps.slices import configuration_slice
from armguard.scene import load_scene
from pages import DOCS

CELL = Path(__file__).parents[1] / "examples" / "cell"

# Joints of the slice.
JOINTS = ("left/panda_joint2", "left/panda_joint4")


def main() -> None:
    """Draw both."""
    images = DOCS / "images"
    cell = map_of(read_job(CELL / "cell-job.yaml"))
    draw_map(cell, cell.schedule(), images / "map_cell.png")
    scene = load_scene(CELL / "cell.yaml")
    draw_slice(configuration_slice(scene, JOINTS), images / "map_slice.png")
    print("wrote map_cell.png and map_slice.png")


if __name__ == "__main__":
    main()
