"""Claims in `armguard check --prove`: pairs said to need no check, and their proofs."""

from collections import Counter
from collections.abc import Mapping

from armguard.cli.console import out, progress_bar
from armguard.cli.finding import Finding, Status
from armguard.prove import Budget, RowAudit, audit_scene
from armguard.prove.audit import STATUSES, claims
from armguard.scene.scene import Scene

STYLES = {"proved": "blue", "sometimes": "yellow", "open": "yellow"}


def prove_claims(scene: Scene, seconds: float) -> list[RowAudit]:
    """Judge all claims of a scene, with a bar on standard error."""
    total = sum(
        len({frozenset((row.body_a, row.body_b)) for row in rows})
        for rows in claims(scene).values()
    )
    with progress_bar("proving claims", total) as advance:
        return audit_scene(
            scene,
            budget=Budget(seconds=seconds),
            progress=lambda _what, _number, _count: advance(1),
        )


def claim_findings(audits: list[RowAudit]) -> list[Finding]:
    """The count of claims by the results of proofs, and those that need a look."""
    count = Counter(audit.status for audit in audits)
    summary = ", ".join(f"{status} {count[status]}" for status in STATUSES)
    sound = count["proved"] == len(audits)
    return [
        Finding(
            "claims",
            "PASS" if sound else "FAIL" if count["contradicted"] else "WARN",
            f"claims: {len(audits)}, {summary}",
        ),
        *(finding(audit) for audit in audits if audit.status == "contradicted"),
        *(finding(audit) for audit in audits if audit.status in ("sometimes", "open")),
    ]


def finding(audit: RowAudit) -> Finding:
    """One line about a claim that is not proved."""
    proof = audit.proof
    file = "`allow` of the scene file"
    if audit.source == "srdf":
        file = audit.reason.partition(": ")[0]
    delete = f"delete the row of '{proof.link_a}' and '{proof.link_b}' from {file}"
    depth = f"{max(-proof.least, 0.0) * 1e3:.1f} mm deep"
    if audit.status == "contradicted":
        seen = audit.contradiction or {}
        apart = f"are {proof.greatest * 1e3:.1f} mm apart"
        what = f"touch, {depth}" if seen == proof.touching else apart
        sentence = f"{what} at {positions(seen)}"
        remedy = f"{delete}, so that the pair is checked"
    elif audit.status == "sometimes":
        sentence = (
            f"touch in some configurations, {depth} at {positions(proof.nearest)}, and "
            "not in others; the guard does not look"
        )
        remedy = f"{delete}, or accept it"
    else:
        sentence = (
            "are not decided: the distance is proven to stay above "
            f"{proof.bound * 1e3:.1f} mm, the least found is {proof.least * 1e3:.1f} "
            f"mm, {100.0 * proof.share_left:.2g}% of the joint box is left after "
            f"{proof.boxes} boxes"
        )
        remedy = "give it more time: `--prove-seconds 600`"
    pair = f"{audit.robot}/{proof.link_a} and {proof.link_b} ('{audit.reason}')"
    status: Status = "FAIL" if audit.status == "contradicted" else "WARN"
    return Finding("claim", status, f"{pair} {sentence}", remedy)


def positions(q: Mapping[str, float]) -> str:
    """Joint names and values [rad or m]."""
    return ", ".join(f"{name} {value:.4f}" for name, value in q.items()) or "any"


def claim_table(audits: list[RowAudit]) -> dict[str, object]:
    """All claims as plain numbers."""
    count = Counter(audit.status for audit in audits)
    return {
        "count": len(audits),
        **{status: count[status] for status in STATUSES},
        "rows": [claim_row(audit) for audit in audits],
    }


def claim_row(audit: RowAudit) -> dict[str, object]:
    """One claim as plain numbers; distances in mm, positions in rad or m."""
    proof = audit.proof
    return {
        "robot": audit.robot,
        "a": proof.link_a,
        "b": proof.link_b,
        "reason": audit.reason,
        "source": audit.source,
        "status": audit.status,
        "verdict": proof.verdict,
        "least_mm": proof.least * 1e3,
        "nearest": dict(proof.nearest),
        "greatest_mm": proof.greatest * 1e3,
        "farthest": dict(proof.farthest),
        "bound_mm": proof.bound * 1e3,
        "contradiction": audit.contradiction and dict(audit.contradiction),
        "boxes": proof.boxes,
        "share_left": proof.share_left,
        "seconds": proof.seconds,
    }


def show_claims(audits: list[RowAudit]) -> None:
    """Print all claims for people."""
    if not audits:
        return
    out.print("\nclaims, their proofs, least distance found, boxes:")
    for audit in audits:
        proof = audit.proof
        pair = f"{audit.robot}/{proof.link_a}, {proof.link_b}"
        word = audit.reason.rpartition(": ")[2]
        style = STYLES.get(audit.status, "bold magenta")
        out.print(f"  [{style}]{audit.status:12}[/{style}] ", end="")
        out.print(
            f"{pair:52} {proof.verdict:9} {proof.least * 1e3:8.1f} mm "
            f"{proof.boxes:9}  {word}",
            markup=False,
        )
