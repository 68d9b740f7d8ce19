"""What a recording was judged with: the scene, its fits, figures, claims and hashes."""

from collections import Counter
from dataclasses import asdict, dataclass, fields
from hashlib import sha256

from armguard.errors import ArmguardError
from armguard.prove import Budget, audit_scene
from armguard.prove.audit import STATUSES, claims
from armguard.prove.store import link_print
from armguard.robot.kinematics import kinematic_table
from armguard.robot.stopping import ASSUMPTION, StoppingFigures
from armguard.scene.allowed import allowed_pairs
from armguard.scene.scene import Scene, SceneRobot

# What is no figure of `StoppingFigures`, but belongs to them.
BESIDE = ("tables", "sources", "joints")


@dataclass(frozen=True, slots=True)
class RobotFacts:
    """A robot, as the guard knew it.

    Attributes:
        name: Its name.
        mode: How the distance it keeps is made.
        response: What it does about what is near.
        joints: How many it has.
        links: Links with geometry.
        primitives: Primitives around them.
        contained: Links whose exact shapes are proven to lie in their primitives.
        overreach: How far the primitives of any link reach beyond it at most [m].
        worst_link: That link.
        figures: Stopping figures it has.
        assumed: Of these, the ones that are assumptions.
        fingerprint: Hash of the geometry, files and shapes of all its links; "" if its
            files are not on this machine.
    """

    name: str
    mode: str
    response: str
    joints: int
    links: int
    primitives: int
    contained: int
    overreach: float
    worst_link: str
    figures: int
    assumed: int
    fingerprint: str


@dataclass(frozen=True, slots=True)
class Claims:
    """Pairs of a robot's links that somebody says need no check.

    Attributes:
        count: How many.
        by_status: What proofs made of them, see `armguard.prove.audit`.
        contradicted: Those that are belied by a proof.
        known: Whether proofs could be looked for.
    """

    count: int
    by_status: dict[str, int]
    contradicted: tuple[str, ...]
    known: bool


@dataclass(frozen=True, slots=True)
class ModelFacts:
    """What a recording was judged with.

    Attributes:
        robots: The robots.
        objects: How many objects the scene has.
        period: Time from one cycle to the next [s].
        late: How much later one may come [s].
        buffer: The scene's buffer [m].
        margin: Signed distance up to which pairs are reported [m].
        allowed: Allowed pairs by who says so.
        claims: Of these, the ones that can be proven or belied.
    """

    robots: tuple[RobotFacts, ...]
    objects: int
    period: float
    late: float
    buffer: float
    margin: float
    allowed: dict[str, int]
    claims: Claims

    def to_dict(self) -> dict[str, object]:
        """The same as plain numbers and strings."""
        return asdict(self)


def model_facts(scene: Scene, prove_seconds: float = 0.0) -> ModelFacts:
    """What a scene says of itself.

    Args:
        scene: The scene.
        prove_seconds: Time for proofs that are not kept on this machine [s].
    """
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
    """What the guard knew of a robot."""
    fits = robot.fits
    worst = max(fits, key=lambda link: fits[link].overreach, default="")
    figures, assumed = counted(robot.stopping)
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
        figures=figures,
        assumed=assumed,
        fingerprint=fingerprint(robot),
    )


def counted(figures: StoppingFigures | None) -> tuple[int, int]:
    """Stopping figures of a robot, and how many of them are assumptions."""
    if figures is None:
        return 0, 0
    names = [field.name for field in fields(figures) if field.name not in BESIDE]
    assumed = [n for n in names if ASSUMPTION in figures.sources.get(n, "")]
    return len(names), len(assumed)


def fingerprint(robot: SceneRobot) -> str:
    """Hash of all links of a robot: geometry, mesh files, shapes; "" without files."""
    table = kinematic_table(robot.model)
    digest = sha256()
    try:
        for link, fit in robot.fits.items():
            T = table.T_body_link[link]
            digest.update(link_print(robot.model.links[link], fit, T).encode())
    except OSError:
        return ""
    return digest.hexdigest()[:16]


def claim_facts(scene: Scene, seconds: float) -> Claims:
    """Claims of a scene, and what proofs make of them."""
    count = sum(len(rows) for rows in claims(scene).values())
    try:
        audits = audit_scene(scene, budget=Budget(seconds=seconds))
    except (OSError, ArmguardError):
        # A proof goes by the files of the robot, which may be on another machine.
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
