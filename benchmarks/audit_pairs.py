"""Audit of published SRDFs: which of the pairs they switch off can touch.

python benchmarks/audit_pairs.py [ROBOT ...]    writes docs/allowed-pairs.md and .json

Each row is judged by proofs over the whole joint box. Then Coal and Pinocchio, which
share no code with these, judge the proofs by the meshes: at random configurations no
pair that is proven apart may touch, and each contact that belies a row must be one.
"""

import json
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from armguard.cli.claims import claim_row
from armguard.cli.console import jsonable, progress_bar
from armguard.prove import Budget, RowAudit, audit_srdf
from armguard.prove.audit import STATUSES
from armguard.robot.named import find_named_robot, robots_folder
from armguard.scene import Scene
from armguard.scene.scene import SceneRobot
from mesh_contact import MeshContact

ROBOTS = ("panda", "ur5", "xarm7", "baxter")
DOCS = Path(__file__).parents[1] / "docs"

# Time for the proofs of one robot [s].
SECONDS = 600.0

# Configurations Coal is asked for, for each pair proven apart.
SAMPLES = 2000

# Configurations around the deepest contact that Coal is asked for where it does not
# confirm that one, and how far from it they are [rad or m].
NEIGHBOURS = 5000
SPREAD = 0.2


def main() -> None:
    """Audit the robots, print the table and write it."""
    results = [audit(name) for name in sys.argv[1:] or ROBOTS]
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
    lines = [
        "# Allowed pairs, proven",
        "",
        "An SRDF switches off the check of pairs of links and gives a reason in a",
        "word: `Never`, found by sampling, `Default`, `Adjacent`, `User`. "
        "`armguard check --prove`",
        "proves it, or finds the configuration that belies it. Written by",
        "`python benchmarks/audit_pairs.py`; all rows, with configurations, are in",
        "[allowed-pairs.json](allowed-pairs.json).",
        "",
        "**proved**: the pair never touches, or always does, anywhere within the joint",
        "limits. **contradicted**: the file says never, and here is a contact.",
        "**sometimes**: it touches in some configurations and not in others, which the",
        "file's reason does not deny; a guard that takes the row does not see it.",
        "**open**: not decided.",
        "",
        "| robot | rows | proved | contradicted | sometimes | open | pairs | boxes "
        "| time [s] |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for result in results:
        count = Counter(row["status"] for row in result["rows"])
        cells = [count[status] for status in STATUSES]
        lines.append(
            f"| {result['robot']} | {len(result['rows'])} | "
            + " | ".join(map(str, cells))
            + f" | {result['pairs']} | {result['boxes']:,} | {result['seconds']:.0f} |"
        )
    lines += ["", *method()]
    for result in results:
        lines += ["", *robot_section(result)]
    return "\n".join(lines) + "\n"


def method() -> list[str]:
    """How the proof is done."""
    return [
        "## How",
        "",
        "Only the joints between two links matter. Their box of positions is halved",
        "again and again; each part is done when the distance in its middle outweighs",
        "what the joints can change it: by the farthest points of the links about each",
        "axis, or along the normal by the first and the second derivative of both",
        "sides' reach (`src/armguard/prove/box_bound.py`). A link is its hulls and its",
        "primitives, whichever shows more distance. Where the solids can touch and a",
        "mesh is hollow, the surface is cut into small convex parts: if these never",
        "meet anywhere in the box, which is connected, and the links were seen outside",
        "each other once, they stay so. Touching is a distance of up to a micrometre.",
        "",
        "A joint without limits is looked at for a whole turn. Other joints count with",
        "the limits of the URDF: a row may be wrong in a configuration that the",
        "controller never lets happen, or that lies behind a contact of another pair.",
        "",
        "Meshes are judged by Coal, on Pinocchio's kinematics: at random",
        "configurations for each pair proven apart, and at the configuration of each",
        "contact, or around it. Coal's meshes are surfaces.",
    ]


def robot_section(result: dict[str, Any]) -> list[str]:
    """Results of one robot."""
    rows = result["rows"]
    lines = [f"## {result['robot']}", ""]
    words = sorted({row["reason"].rpartition(": ")[2] for row in rows})
    lines += [
        "| reason | " + " | ".join(STATUSES) + " |",
        "| --- |" + " --- |" * len(STATUSES),
    ]
    for word in words:
        own = [row for row in rows if row["reason"].rpartition(": ")[2] == word]
        count = Counter(row["status"] for row in own)
        cells = " | ".join(str(count[status]) for status in STATUSES)
        lines.append(f"| {word} | {cells} |")
    bad = len(result["touching_though_proven_apart"])
    bare = sum(row["verdict"] == "never" and row["boxes"] == 0 for row in rows)
    if bare:
        lines += [
            "",
            f"{bare} of the proved rows name a link without collision geometry.",
        ]
    lines += [
        "",
        f"Coal, asked {result['asked']:,} times about pairs proven apart: "
        f"{bad} contacts.",
    ]
    for status, title in (
        ("contradicted", "Contradicted"),
        ("sometimes", "Touch in some configurations"),
        ("open", "Open"),
    ):
        own = [row for row in rows if row["status"] == status]
        if own:
            lines += ["", f"### {title}", "", *row_table(own, status)]
    return lines


def row_table(rows: list[dict[str, Any]], status: str) -> list[str]:
    """Rows of one status."""
    if status == "open":
        lines = [
            "| links | reason | proven above [mm] | least found [mm] | left |",
            "| --- | --- | --- | --- | --- |",
        ]
        return lines + [
            f"| {row['a']}, {row['b']} | {row['reason'].rpartition(': ')[2]} "
            f"| {row['bound_mm']:.1f} | {row['least_mm']:.1f} "
            f"| {100 * row['share_left']:.2g}% |"
            for row in rows
        ]
    lines = [
        "| links | reason | overlap [mm] | at [rad, m] | meshes touch |",
        "| --- | --- | --- | --- | --- |",
    ]
    return lines + [
        f"| {row['a']}, {row['b']} | {row['reason'].rpartition(': ')[2]} "
        f"| {max(-row['least_mm'], 0.0):.1f} | {place(row['nearest'])} "
        f"| {'yes' if row['touch_by_meshes'] else 'not seen'} |"
        for row in rows
    ]


def place(q: dict[str, float]) -> str:
    """Joint names and positions."""
    return ", ".join(f"{name} {value:.3f}" for name, value in q.items())


if __name__ == "__main__":
    main()
