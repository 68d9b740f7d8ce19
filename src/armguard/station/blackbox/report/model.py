"""The model of a recording: the scene, its fits, stopping figures, claims, hashes."""

from collections import Counter
from dataclasses import dataclass, fields
from hashlib import sha256

from armguard.errors import ArmguardError
from armguard.prove import Budget, audit_scene
from armguard.prove.audit import STATUSES, claims
from armguard.prove.store import link_print
from armguard.robot.kinematics import kinematic_table
from armguard.robot.stopping import ASSUMPTION, StoppingFigures
from armguard.scene.allowed import allowed_pairs
from armguard.scene.scene import Scene, SceneRobot

# Fields of `StoppingFigures` that are not figures.
NOT_FIGURES = {"tables", "sources", "joints"}


@dataclass(frozen=True, slots=True)
class RobotFacts:
    """A robot of the model."""

    name: str
    mode: str  # how its separation is computed
    response: str  # to near pairs
    joints: int
    links: int  # with geometry
    primitives: int  # around them
    contained: int  # links that are proven to lie in their primitives
    overreach: float  # greatest reach of primitives beyond their link [m]
    worst_link: str  # that link
    figures: int  # stopping figures
    assumed: int  # of these, assumptions
    fingerprint: str  # see `fingerprint`


@dataclass(frozen=True, slots=True)
class Claims:
    """Claims that two links of a robot need no check."""

    count: int
    by_status: dict[str, int]  # results of the proofs, see `armguard.prove.audit`
    contradicted: tuple[str, ...]  # claims that a proof contradicts
    known: bool  # whether proofs could be looked up


@dataclass(frozen=True, slots=True)
class ModelFacts:
    """The model of a recording."""

    robots: tuple[RobotFacts, ...]
    objects: int
    period: float  # from one cycle to the next [s]
    late: float  # by which a cycle may be late [s]
    buffer: float  # largest one of the scene [m]
    margin: float  # signed distance up to which pairs are reported [m]
    allowed: dict[str, int]  # number of allowed pairs of each source
    claims: Claims  # of these, the ones that can be proven or contradicted


def model_facts(scene: Scene, prove_seconds: float = 0.0) -> ModelFacts:
    """The model of a scene; proofs that are not kept here get so much time [s]."""
    return ModelFacts(
        robots=tuple(robot_facts(robot) for robot in scene.robots.values()),
        objects=len(scene.objects),
        period=scene.period,
        late=scene.late,
        buffer=scene.largest_buffer,
        margin=scene.margin,
        allowed=dict(Counter(rule.source for rule in allowed_pairs(scene))),
        claims=claim_facts(scene, prove_seconds),
    )


def robot_facts(robot: SceneRobot) -> RobotFacts:
    """A robot of the model."""
    fits, stopping = robot.fits, robot.stopping
    worst = max(fits, key=lambda link: fits[link].overreach, default="")
    figures = {field.name for field in fields(StoppingFigures)} - NOT_FIGURES
    sources = {} if stopping is None else stopping.sources
    return RobotFacts(
        name=robot.name,
        mode=robot.mode,
        response=robot.response.kind,
        joints=len(robot.model.q_names),
        links=len(fits),
        primitives=sum(len(fit.shapes) for fit in fits.values()),
        contained=sum(fit.contained for fit in fits.values()),
        overreach=fits[worst].overreach if worst else 0.0,
        worst_link=worst,
        figures=0 if stopping is None else len(figures),
        assumed=sum(ASSUMPTION in sources.get(name, "") for name in figures),
        fingerprint=fingerprint(robot),
    )


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


def claim_facts(scene: Scene, seconds: float) -> Claims:
    """Claims of a scene and the results of proofs."""
    count = sum(len(rows) for rows in claims(scene).values())
    try:
        audits = audit_scene(scene, budget=Budget(seconds=seconds))
    except (OSError, ArmguardError):
        # A proof needs the robot's files, which may be on another machine.
        return Claims(count, {}, (), known=False)
    by_status = Counter(audit.status for audit in audits)
    return Claims(
        count=count,
        by_status={status: by_status[status] for status in STATUSES},
        contradicted=tuple(
            f"{audit.robot}/{audit.proof.link_a} – {audit.proof.link_b}"
            for audit in audits
            if audit.status == "contradicted"
        ),
        known=True,
    )
