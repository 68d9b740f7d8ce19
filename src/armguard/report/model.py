"""The model of a recording: the scene, its fits, stopping figures, claims, hashes."""

from collections import Counter
from dataclasses import fields
from hashlib import sha256
from typing import Any

from armguard.errors import ArmguardError
from armguard.prove import Budget, audit_scene
from armguard.prove.audit import STATUSES, claims
from armguard.prove.store import link_print
from armguard.robot.kinematics import kinematic_table
from armguard.robot.stopping import ASSUMPTION, StoppingFigures
from armguard.scene.allowed import allowed_pairs
from armguard.scene.scene import Scene, SceneRobot

# Fields of `StoppingFigures` that are no figures, and those that are.
FIGURES = {own.name for own in fields(StoppingFigures)} - {
    "tables",
    "sources",
    "joints",
}


def model_facts(scene: Scene, prove_seconds: float = 0.0) -> dict[str, Any]:
    """The model of a scene; proofs that are not kept here get so much time [s]."""
    return {
        "robots": [robot_facts(robot) for robot in scene.robots.values()],
        "objects": len(scene.objects),
        "period": scene.period,  # from one cycle to the next [s]
        "late": scene.late,  # by which a cycle may be late [s]
        "buffer": scene.largest_buffer,  # [m]
        "margin": scene.margin,  # signed distance up to which pairs are reported [m]
        # Number of allowed pairs of each source.
        "allowed": dict(Counter(rule.source for rule in allowed_pairs(scene))),
        "claims": claim_facts(scene, prove_seconds),
    }


def robot_facts(robot: SceneRobot) -> dict[str, Any]:
    """A robot of the model."""
    fits, stopping = robot.fits, robot.stopping
    worst = max(fits, key=lambda link: fits[link].overreach, default="")
    sources = {} if stopping is None else stopping.sources
    return {
        "name": robot.name,
        "mode": robot.mode,  # how its separation is computed
        "response": robot.response.kind,  # to near pairs
        "joints": len(robot.model.q_names),
        "links": len(fits),  # with geometry
        "primitives": sum(len(fit.shapes) for fit in fits.values()),  # around them
        # Links that are proven to lie in their primitives.
        "contained": sum(fit.contained for fit in fits.values()),
        # Greatest reach of primitives beyond their link [m], and that link.
        "overreach": fits[worst].overreach if worst else 0.0,
        "worst_link": worst,
        # Stopping figures, and how many of them are assumptions.
        "figures": 0 if stopping is None else len(FIGURES),
        "assumed": sum(ASSUMPTION in sources.get(name, "") for name in FIGURES),
        "fingerprint": fingerprint(robot),
    }


def fingerprint(robot: SceneRobot) -> str:
    """Hash of all links: geometry, mesh files, shapes; "" without the files."""
    T_body_link, digest = kinematic_table(robot.model).T_body_link, sha256()
    try:
        for link, fit in robot.fits.items():
            T = T_body_link[link]
            digest.update(link_print(robot.model.links[link], fit, T).encode())
    except OSError:
        return ""
    return digest.hexdigest()[:16]


def claim_facts(scene: Scene, seconds: float) -> dict[str, Any]:
    """Claims that two links of a robot need no check, and the results of proofs."""
    count = sum(len(rows) for rows in claims(scene).values())
    try:
        audits = audit_scene(scene, budget=Budget(seconds=seconds))
    except (OSError, ArmguardError):
        # A proof needs the robot's files, which may be on another machine.
        return {"count": count, "by_status": {}, "contradicted": [], "known": False}
    found = Counter(audit.status for audit in audits)
    return {
        "count": count,
        # Results of the proofs, see `armguard.prove.audit`.
        "by_status": {status: found[status] for status in STATUSES},
        "contradicted": [
            f"{audit.robot}/{audit.proof.link_a} – {audit.proof.link_b}"
            for audit in audits
            if audit.status == "contradicted"
        ],
        "known": True,
    }
