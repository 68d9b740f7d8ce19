"""A scene is the same after it was archived, with shapes of each kind."""

import numpy as np

from armguard import Cylinder, Guard, Pose, Scene
from armguard.scene.archive import archive_of, scene_of

ARM = """<robot name="arm">
  <link name="base"/>
  <link name="upper">
    <collision>
      <origin xyz="0 0 0.3"/>
      <geometry><cylinder radius="0.05" length="0.5"/></geometry>
    </collision>
  </link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/>
    <child link="upper"/>
    <axis xyz="0 1 0"/>
    <limit lower="-1.5" upper="1.5" velocity="2.0" effort="50"/>
  </joint>
</robot>"""


def test_cylinders_of_links_and_of_objects_come_back(tmp_path):
    file = tmp_path / "arm.urdf"
    file.write_text(ARM, encoding="utf-8")
    scene = Scene(period=0.01)
    scene.add_robot(file, name="arm", stopping={"deceleration": 5.0})
    can = Cylinder(radius=0.1, height=0.3)
    scene.add(can, "can", pose=Pose(xyz=(0.42, 0, 0.4)))
    again = scene_of(archive_of(scene))
    assert archive_of(again) == archive_of(scene)
    before, after = (
        Guard(one, self_test=False).judge_at_rest(np.array([0.5]))
        for one in (scene, again)
    )
    assert before.nearest.distance == after.nearest.distance
