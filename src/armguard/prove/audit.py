"""Claims that a pair needs no check, judged by proofs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from time import monotonic
from typing import Literal

from armguard.prove.pair_proof import Budget, PairProof
from armguard.prove.pairs import prove_pairs
from armguard.scene.allowed import PairRule, allowed_pairs
from armguard.scene.meshes import Progress
from armguard.scene.scene import Scene, SceneRobot

Status = Literal["proved", "contradicted", "sometimes", "open"]

STATUSES: tuple[Status, ...] = ("proved", "contradicted", "sometimes", "open")


@dataclass(frozen=True, slots=True, kw_only=True)
class RowAudit:
    """A claim, and what proofs make of it.

    Attributes:
        robot: The robot.
        reason: What the file says.
        source: Its file: "srdf" or "scene".
        proof: What is known of the pair.
        status: "proved", nothing is lost by not checking the pair: it never touches, or
            it always does, and the reason does not say otherwise; "contradicted", the
            reason says never and a contact is known, or always and a gap is known;
            "sometimes", the pair touches in some configurations and not in others,
            which the reason does not deny; "open", not decided within the budget.
    """

    robot: str
    reason: str
    source: str
    proof: PairProof
    status: Status

    @property
    def contradiction(self) -> Mapping[str, float] | None:
        """Joint positions that belie the reason; None if none are known."""
        if self.status != "contradicted":
            return None
        return (
            self.proof.touching if claim(self.reason) == "never" else (self.proof.apart)
        )


def audit_srdf(
    robot: SceneRobot,
    *,
    budget: Budget | None = None,
    progress: Progress | None = None,
) -> list[RowAudit]:
    """Judge every row of a robot's SRDF that switches a check off.

    Args:
        robot: The robot.
        budget: What it may cost.
        progress: Called with the pair, its number and their count.
    """
    rows = [
        PairRule(p.link_a, p.link_b, p.reason, "srdf")
        for p in robot.model.disabled_pairs
    ]
    return audit_rows(robot, rows, budget or Budget(), progress)


def audit_scene(
    scene: Scene,
    *,
    budget: Budget | None = None,
    progress: Progress | None = None,
) -> list[RowAudit]:
    """Judge every claim of a scene on two links of one robot.

    Args:
        scene: The scene.
        budget: What it may cost, for all robots together.
        progress: Called with the pair, its number and their count, for each robot.
    """
    budget = Budget() if budget is None else budget
    end = monotonic() + budget.seconds
    audits = []
    for name, rows in claims(scene).items():
        left = Budget(seconds=max(end - monotonic(), 0.0), boxes=budget.boxes)
        audits += audit_rows(scene.robots[name], rows, left, progress)
    return audits


def claims(scene: Scene) -> dict[str, list[PairRule]]:
    """What files and the scene claim of two links of one robot, by robot."""
    found: dict[str, list[PairRule]] = {name: [] for name in scene.robots}
    for rule in allowed_pairs(scene):
        if rule.source not in ("srdf", "scene"):
            continue
        (one, _, a), (other, _, b) = (
            body.partition("/") for body in (rule.body_a, rule.body_b)
        )
        if one == other and a and b and one in found:
            found[one].append(PairRule(a, b, rule.reason, rule.source))
    return {name: rows for name, rows in found.items() if rows}


def audit_rows(
    robot: SceneRobot,
    rows: Sequence[PairRule],
    budget: Budget,
    progress: Progress | None,
) -> list[RowAudit]:
    """Judge claims on links of one robot, in their order."""
    proofs = prove_pairs(
        robot,
        [(row.body_a, row.body_b) for row in rows],
        budget=budget,
        progress=progress,
    )
    return [
        RowAudit(
            robot=robot.name,
            reason=row.reason,
            source=row.source,
            proof=proof,
            status=judge(claim(row.reason), proof),
        )
        for row, proof in zip(rows, proofs, strict=True)
    ]


def claim(reason: str) -> str:
    """The word of an SRDF's reason, which follows the file's name."""
    return reason.rpartition(": ")[2].strip().lower()


def judge(word: str, proof: PairProof) -> Status:
    """What a proof makes of a reason's word."""
    if word == "never" and proof.touching is not None:
        return "contradicted"
    if word == "always" and proof.apart is not None:
        return "contradicted"
    if proof.verdict in ("never", "always"):
        return "proved"
    return "sometimes" if proof.verdict == "sometimes" else "open"
