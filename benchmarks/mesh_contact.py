"""Whether two links touch by their meshes, judged by Pinocchio and Coal alone.

Nothing here is ours: the URDF, the meshes, the kinematics and the collisions are all
theirs. What a URDF gives as a cylinder, a box or a sphere is Coal's own shape.
"""

from collections.abc import Mapping
from math import cos, sin
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin

from armguard.robot.model import RobotModel


class MeshContact:
    """A robot in Coal.

    Args:
        urdf: Its URDF.
        packages: Folders in which `package://` names are found.
        model: The same robot of ours; asked only which joints follow others.
        home: Positions of the joints that are not given [rad or m].
    """

    def __init__(
        self,
        urdf: Path,
        packages: list[Path],
        model: RobotModel,
        home: Mapping[str, float],
    ) -> None:
        self._model = pin.buildModelFromUrdf(str(urdf))
        self._geometry = pin.buildGeomFromUrdf(
            self._model,
            str(urdf),
            pin.GeometryType.COLLISION,
            package_dirs=[str(folder) for folder in packages],
        )
        self._data = self._model.createData()
        self._placements = self._geometry.createData()
        self._mimics = {
            name: joint.mimic for name, joint in model.joints.items() if joint.mimic
        }
        self._home = dict(home)
        self._of_link: dict[str, list[int]] = {}
        for k, part in enumerate(self._geometry.geometryObjects):
            link = self._model.frames[part.parentFrame].name
            self._of_link.setdefault(link, []).append(k)

    def touch(self, link_a: str, link_b: str, q: Mapping[str, float]) -> bool:
        """Whether two links touch where the joints stand at q [rad or m]."""
        pin.updateGeometryPlacements(
            self._model, self._data, self._geometry, self._placements, self._q(q)
        )
        request = coal.CollisionRequest()
        for i in self._of_link.get(link_a, []):
            for j in self._of_link.get(link_b, []):
                result = coal.CollisionResult()
                if coal.collide(*self._placed(i), *self._placed(j), request, result):
                    return True
        return False

    def _placed(self, k: int) -> tuple[object, object]:
        T = self._placements.oMg[k]
        shape = self._geometry.geometryObjects[k].geometry
        return shape, coal.Transform3s(T.rotation, T.translation)

    def _q(self, given: Mapping[str, float]) -> np.ndarray:
        known = {**self._home, **given}
        q = pin.neutral(self._model)
        for number in range(1, self._model.njoints):
            name, joint = self._model.names[number], self._model.joints[number]
            mimic = self._mimics.get(name)
            value = (
                known[name]
                if mimic is None
                else mimic.multiplier * known[mimic.joint] + mimic.offset
            )
            if joint.nq == 2:
                q[joint.idx_q : joint.idx_q + 2] = cos(value), sin(value)
            else:
                q[joint.idx_q] = value
        return q
