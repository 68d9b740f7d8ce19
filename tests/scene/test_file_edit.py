"""Scene files are changed by their letters: as intended, and never blindly."""

from pathlib import Path

import pytest

from armguard.errors import SceneError
from armguard.geometry import Pose
from armguard.scene.bay import bay_path
from armguard.scene.file_edit import (
    Entry,
    difference,
    edited,
    values_of,
    write_checked,
)

BAY = bay_path().read_text(encoding="utf-8")

BLOCKS = """\
robots:
  arm: {urdf: arm.urdf}
objects:
  # the first one
  one:
    box: [1, 1, 1]
    at:
      xyz: [0, 0, 1]   # where it stands
      rpy: [0, 0, 1]

  # the second one
  two:
    box: [1, 2, 3]
# the end
buffer: 0.01
"""


def changed_lines(before: str, after: str) -> list[str]:
    return [
        line
        for line in difference(before, after, "file").splitlines()[2:]
        if line[:1] in "+-"
    ]


def test_a_box_more_is_one_line_more_and_nothing_else():
    wall = Entry(Pose(xyz=(0.1, 0.2, 0.3), rpy=(0.0, 0.0, 0.5)), (0.4, 0.02, 0.6))
    after = edited(BAY, {"wall": wall})
    assert changed_lines(BAY, after) == [
        "+  wall: {box: [0.4, 0.02, 0.6], at: {xyz: [0.1, 0.2, 0.3], rpy: [0, 0, 0.5]}}"
    ]


def test_what_moved_changes_in_its_own_line():
    after = edited(BAY, {"rack": Entry(Pose(xyz=(0.5, 0.0, 0.95)))})
    assert changed_lines(BAY, after) == [
        "-    at: {xyz: [0.45, 0, 0.95]}",
        "+    at: {xyz: [0.5, 0, 0.95]}",
    ]
    again = edited(after, {"battery": Entry(Pose(xyz=(0, 0, 1)), (0.1, 0.1, 0.1))})
    assert changed_lines(after, again) == [
        "-  battery: {box: [0.16, 0.18, 0.18], at: {xyz: [0.46, 0, 0.72]}}",
        "+  battery: {box: [0.1, 0.1, 0.1], at: {xyz: [0, 0, 1]}}",
    ]


def test_blocks_keep_the_comments_around_them():
    moved = edited(BLOCKS, {"one": Entry(Pose(xyz=(1, 1, 1)))})
    assert "# the first one" in moved
    assert "# the second one" in moved
    assert values_of(moved)["objects"]["one"]["at"] == {"xyz": [1, 1, 1]}
    gone = edited(BLOCKS, {"one": None, "two": Entry(Pose(), (2, 2, 2))})
    assert "# the second one" in gone
    assert "# the end" in gone
    assert values_of(gone)["objects"] == {
        "two": {"at": {"xyz": [0, 0, 0]}, "box": [2, 2, 2]}
    }
    assert edited("robots: {}\n", {"x": Entry(Pose(), (1, 1, 1))}).endswith(
        "\nobjects:\n  x: {box: [1, 1, 1], at: {xyz: [0, 0, 0]}}\n"
    )


@pytest.mark.parametrize(
    ("text", "changes", "says"),
    [
        ("objects: {a: {box: [1, 1, 1]}}\n", {"a": None}, "by hand"),
        (BLOCKS, {"three": Entry(Pose())}, "not in the scene file"),
        (BLOCKS, {"three": None}, "no object 'three'"),
        (
            "objects:\n  a: &a {box: [1, 1, 1]}\n  b: *a\n",
            {"b": Entry(Pose(xyz=(1, 0, 0)))},
            "by hand",
        ),
        (
            "objects:\n  ball: {sphere: {radius: 1}}\n",
            {"ball": Entry(Pose(), (1, 1, 1))},
            "no box",
        ),
    ],
)
def test_what_cannot_be_edited_is_refused(text, changes, says):
    with pytest.raises(SceneError, match=says):
        edited(text, changes)


def test_a_file_is_written_only_if_it_is_the_one_that_was_shown_and_loads(tmp_path):
    path = tmp_path / "scene.yaml"
    arm = bay_path().parent / "bay_arm.urdf"
    before = f"robots:\n  arm: {{urdf: {arm}, mode: fixed}}\n"
    path.write_text(before, encoding="utf-8")
    good = edited(before, {"wall": Entry(Pose(xyz=(1, 1, 1)), (0.1, 0.1, 0.1))})
    with pytest.raises(SceneError, match="changed meanwhile"):
        write_checked(path, before + "\n", good)
    with pytest.raises(SceneError):
        write_checked(path, before, good.replace("wall", "wa/ll"))
    assert path.read_text(encoding="utf-8") == before
    write_checked(path, before, good)
    assert path.read_text(encoding="utf-8") == good
    assert [file.name for file in Path(tmp_path).iterdir()] == ["scene.yaml"]
