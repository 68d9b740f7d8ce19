"""Audit of published SRDFs: which of the pairs they switch off can touch.

python benchmarks/audit_pairs.py [ROBOT ...]    writes docs/allowed-pairs.md and .json

Each row is judged by proofs over the whole joint box. Then Coal and Pinocchio, which
share no code with these, judge the proofs by the meshes: at random configurations no
pair that is proven apart may touch, and each contact that belies a row must be one.
"""

import json
from collections.abc import Mapping
from math import cos, sin
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from armguard.cli.claims import claim_row
from armguard.cli.console import jsonable, progress_bar
from armguard.prove import Budget, RowAudit, audit_srdf
from armguard.prove.audit import STATUSES
from armguard.robot.model import RobotModel
from armguard.robot.named import find_named_robot, robots_folder
from armguard.scene import Scene
from armguard.scene.scene import SceneRobot
from episodes.campaign import command
from pages import DOCS, rendered


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


ROBOTS = ("panda", "ur5", "xarm7", "baxter")
# Time for the proofs of one robot [s].
SECONDS = 600.0

# Configurations that Coal judges, for each pair proven apart.
SAMPLES = 2000

# Configurations around the deepest contact that Coal judges where it does not
# confirm that one, and how far from it they are [rad or m].
NEIGHBOURS = 5000
SPREAD = 0.2

# Statuses whose rows are listed, with their titles.
TITLES = {
    "contradicted": "Contradicted",
    "sometimes": "Touch in some configurations",
    "open": "Open",
}


def main() -> None:
    """Audit the robots, print the table and write it."""
    parser = command(__doc__)
    parser.add_argument("robots", nargs="*", metavar="ROBOT", default=ROBOTS)
    results = [audit(name) for name in parser.parse_args().robots]
    text = report(results)
    print(text)
    (DOCS / "allowed-pairs.md").write_text(text, encoding="utf-8")
    (DOCS / "allowed-pairs.json").write_text(as_json(results), encoding="utf-8")


def audit(name: str) -> dict[str, Any]:
    """Audit of one robot's SRDF, judged by Coal."""
    robot = Scene(mode="fixed").add_robot(name, name=name)
    pairs = {frozenset((p.link_a, p.link_b)) for p in robot.model.disabled_pairs}
    with progress_bar(f"proving {name}", len(pairs)) as advance:
        audits = audit_srdf(
            robot,
            budget=Budget(seconds=SECONDS),
            progress=lambda _what, _number, _count: advance(1),
        )
    folder = robots_folder().parent
    judge = MeshContact(
        find_named_robot(name).urdf, [folder, folder.parent], robot.model, robot.home
    )
    rows = []
    asked = 0
    unsound = []
    proofs = {frozenset((a.proof.link_a, a.proof.link_b)): a.proof for a in audits}
    for row in audits:
        touches = None
        if row.status in ("contradicted", "sometimes"):
            touches = confirmed(judge, row, robot)
        rows.append({**claim_row(row), "touch_by_meshes": touches})
    with progress_bar(f"asking Coal about {name}", len(proofs)) as advance:
        for proof in proofs.values():
            advance(1)
            if proof.verdict == "never" and proof.boxes:
                for q in configurations(robot, SAMPLES):
                    asked += 1
                    if judge.touch(proof.link_a, proof.link_b, q):
                        unsound.append([proof.link_a, proof.link_b, q])
    return {
        "robot": name,
        "pairs": len(proofs),
        "seconds": sum(proof.seconds for proof in proofs.values()),
        "boxes": sum(proof.boxes for proof in proofs.values()),
        "asked": asked,
        "touching_though_proven_apart": unsound,
        "rows": rows,
    }


def configurations(robot: SceneRobot, count: int) -> list[dict[str, float]]:
    """Random configurations within the limits."""
    joints = [robot.model.joints[name] for name in robot.model.q_names]
    low = [j.lower if np.isfinite(j.lower) else -np.pi for j in joints]
    high = [j.upper if np.isfinite(j.upper) else np.pi for j in joints]
    rng = np.random.default_rng(0)
    return [
        dict(zip(robot.model.q_names, q.tolist(), strict=True))
        for q in rng.uniform(low, high, (count, len(joints)))
    ]


def confirmed(judge: MeshContact, row: RowAudit, robot: SceneRobot) -> bool:
    """Whether the meshes touch where the pair is nearest, or around there."""
    proof = row.proof
    a, b = proof.link_a, proof.link_b
    if judge.touch(a, b, proof.nearest):
        return True
    rng = np.random.default_rng(0)
    for _ in range(NEIGHBOURS):
        q = {}
        for name, value in proof.nearest.items():
            joint = robot.model.joints[name]
            step = value + rng.normal(0.0, SPREAD)
            q[name] = float(np.clip(step, joint.lower, joint.upper))
        if judge.touch(a, b, q):
            return True
    return False


def as_json(results: list[dict[str, Any]]) -> str:
    """The results, each row on a line of its own."""
    parts = []
    for result in results:
        rows = [json.dumps(jsonable(row)) for row in result["rows"]]
        head = json.dumps({**jsonable(result), "rows": []})
        parts.append(head.removesuffix("]}") + "\n" + ",\n".join(rows) + "\n]}")
    return '{"robots": [\n' + ",\n".join(parts) + "\n]}\n"


def report(results: list[dict[str, Any]]) -> str:
    """The document."""
    by_word = [
        {
            **result,
            "rows": [
                {**row, "word": row["reason"].rpartition(": ")[2]}
                for row in result["rows"]
            ],
        }
        for result in results
    ]
    return rendered("allowed-pairs", results=by_word, statuses=STATUSES, titles=TITLES)


if __name__ == "__main__":
    main()
