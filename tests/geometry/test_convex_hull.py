"""Hulls of points, and what works without the libraries for meshes."""

import subprocess
import sys

import numpy as np

from armguard.geometry.convex_hull import convex_hull

# A scene of primitives is guarded, and one of meshes names the remedy.
WITHOUT = """
import sys
sys.modules["scipy"] = sys.modules["trimesh"] = None
import armguard as ag
guard = ag.Guard(ag.bay_scene(), self_test=False)
print(guard.step(guard.home).level.name)
for add in (
    lambda: ag.Scene().add_robot("panda", "arm"),
    lambda: ag.Hull(points=[(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)]),
):
    try:
        add()
    except ag.ArmguardError as error:
        print(error)
"""


def test_without_the_extra_only_meshes_and_hulls_are_refused():
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT], capture_output=True, text=True, check=False
    )
    remedies = [
        f"meshes and hulls need {library}: pip install 'armguard[meshes]'"
        for library in ("trimesh", "scipy")
    ]
    assert done.stdout.splitlines() == ["CLEAR", *remedies], done.stderr


def test_points_without_volume_have_no_hull():
    cube = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    assert convex_hull(cube).volume == 1.0
    assert convex_hull(cube * (1, 1, 0)) is None
    assert convex_hull(cube[:3]) is None
